!> The level in the room below as text: the file and the table on the screen.
module thud_room_report
   use thud_band, only: get_band_name
   use thud_case, only: case_type, get_floor_number
   use thud_csv, only: get_table_csv
   use thud_file, only: text_file_type
   use thud_kinds, only: wp
   use thud_rating, only: class_limits, get_a_weighted_level, get_class, get_rounded, rating_names, rating_titles
   use thud_report, only: line
   use thud_room, only: few_modes, get_octave_levels, get_rated, get_ratings, judge_requirement, room_level_type
   use thud_room_prediction, only: contribution_names
   use thud_text, only: fixed, join, join_quoted, newline, quoted, replaced, significant, to_text
   implicit none (type, external)
   private

   public :: get_room_files, get_room_summary, get_room_table, room_file_names

   !> Files of a prediction.
   character(len=*), parameter :: room_file_names(*) = [character(len=16) :: 'room_levels.csv', 'room_octaves.csv', &
      'room_history.csv']

   !> Position of the rating of one-third octaves.
   integer, parameter :: thirds = findloc(rating_names == 'thirds', .true., dim=1)

   !> Width of a column of the table.
   integer, parameter :: column = 13

   !> Limit of (floor resistance x contact time / source mass) above which the floor lowers the peak force by less than
   !> 0.1 dB; the floor multiplies the peak of a linear source by exp(-pi**2 mass/(4 resistance contact_time)).
   real(wp), parameter :: firm = 214.0_wp

contains

   !> The files: levels and their factors in one-third-octave bands, octave levels, detector levels against time.
   subroutine get_room_files(prediction, files)
      type(room_level_type), intent(in) :: prediction
      !> The files: [size(room_file_names)].
      type(text_file_type), intent(out) :: files(:)
      character(len=:), allocatable :: header, wall_titles
      integer :: i

      files%name = room_file_names
      wall_titles = ''
      do i = 1, size(prediction%path_share, 2) - 1
         wall_titles = wall_titles//',wall_'//to_text(i)//'_share'
      end do
      files(1)%content = get_table_csv('nominal_Hz,level_dB,time_of_maximum_s,spread_dB,energy_J,radiation_factor,' &
         //'loss_factor,reverberation_time_s,floor_modes,room_modes,modal_level_dB,modal_spread_dB,' &
         //'simply_supported_level_dB,clamped_level_dB,direct_share'//wall_titles, &
         reshape([prediction%bands%nominal, prediction%level, prediction%time, prediction%spread, prediction%energy, &
         prediction%radiation_factor, prediction%loss_factor, prediction%reverberation_time, prediction%floor_modes, &
         prediction%room_modes, prediction%modal_level, prediction%modal_spread, prediction%edge_level, &
         prediction%path_share], [size(prediction%level), 14 + size(prediction%path_share, 2)]))
      files(2)%content = get_table_csv('nominal_Hz,level_dB,time_of_maximum_s,modal_level_dB', &
         reshape([prediction%octaves%nominal, prediction%octave_level, prediction%octave_time, &
         get_octave_levels(prediction, prediction%modal_level)], [size(prediction%octave_level), 4]))
      header = 'time_s'
      do i = 1, size(prediction%bands)
         header = header//',level_'//trim(get_band_name(prediction%bands(i)))//'_Hz_dB'
      end do
      files(3)%content = get_table_csv(header, reshape([prediction%history_time, prediction%history], &
         [size(prediction%history_time), size(prediction%bands) + 1]))
   end subroutine get_room_files

   !> Table of the levels for the screen; bands with few modes are marked.
   subroutine get_room_table(case, prediction, contact_time, coupled, text)
      type(case_type), intent(in) :: case
      type(room_level_type), intent(in) :: prediction
      !> Contact time of the impact on a rigid floor, s.
      real(wp), intent(in) :: contact_time
      !> The prediction uses the force on the mobile floor, not the force on a rigid floor.
      logical, intent(in) :: coupled
      !> The table.
      character(len=:), allocatable, intent(out) :: text
      character(len=1) :: mark
      logical :: has_edges
      real(wp) :: resistance
      integer :: i

      has_edges = case%floors(get_floor_number(case))%model%get_support() /= ''
      text = '  '//padded('room below')//padded('statistical')//padded('modal')//padded('simple edges')//padded('clamped') &
         //'spread'//newline
      do i = 1, size(prediction%bands)
         mark = merge('*', ' ', min(prediction%floor_modes(i), prediction%room_modes(i)) < few_modes)
         text = text//'  '//padded(get_band_name(prediction%bands(i))//' Hz') &
            //padded(fixed(prediction%level(i), 1)//' dB '//mark)
         if (i <= prediction%n_modal) then
            text = text//padded(fixed(prediction%modal_level(i), 1)//' dB')
         else
            text = text//padded('-')
         end if
         if (i <= prediction%n_modal .and. has_edges) then
            text = text//padded(fixed(prediction%edge_level(i, 1), 1)//' dB')//padded(fixed(prediction%edge_level(i, 2), 1) &
               //' dB')
         else
            text = text//padded('-')//padded('-')
         end if
         text = text//fixed(prediction%spread(i), 1)//' dB'//newline
      end do
      text = text//newline//get_octave_line('Octaves, statistical:', prediction, prediction%octave_level)
      if (prediction%n_modal > 0) text = text//get_octave_line('Octaves, modal:', prediction, &
         get_octave_levels(prediction, prediction%modal_level))
      call add_ratings(case, prediction, coupled, text)
      resistance = 1/maxval(prediction%conductance)
      text = text//'  Room of '//fixed(prediction%volume, 1)//' m3, reverberation time ' &
         //fixed(minval(prediction%reverberation_time), 2)
      if (case%room%reverberation_time%count > 1) text = text//' to '//fixed(maxval(prediction%reverberation_time), 2)
      text = text//' s.'//newline
      text = text//'  Resistance of the floor '//significant(resistance/1.0e3_wp, 3)//' kN s/m.'//newline
      if (any(min(prediction%floor_modes, prediction%room_modes) < few_modes)) text = text//'  *: fewer than ' &
         //fixed(few_modes, 0)//' modes, where the statistical mean is doubtful.'//newline
      text = text//'  Spread: expected standard deviation of one position of source and microphone.'//newline
      if (.not. coupled .and. contact_time*resistance < firm*case%ball%mass) text = text &
         //'  The floor yields under the source, but the force on a rigid floor is used: see docs/rooms.md.'//newline
   end subroutine get_room_table

   !> Levels of octaves as a line.
   function get_octave_line(title, prediction, level) result(text)
      character(len=*), intent(in) :: title
      type(room_level_type), intent(in) :: prediction
      !> The levels, dB: [n_octave].
      real(wp), intent(in) :: level(:)
      character(len=:), allocatable :: text
      character(len=21) :: cell
      integer :: i

      cell = title
      text = '  '//cell
      do i = 1, size(level)
         text = text//'  '//trim(get_band_name(prediction%octaves(i)))//' Hz '//fixed(level(i), 1)//' dB'
      end do
      text = text//newline
   end function get_octave_line

   !> Adds the ratings, and whether they meet a requirement.
   subroutine add_ratings(case, prediction, coupled, text)
      type(case_type), intent(in) :: case
      type(room_level_type), intent(in) :: prediction
      !> The prediction uses the force on the mobile floor.
      logical, intent(in) :: coupled
      !> The table so far.
      character(len=:), allocatable, intent(inout) :: text
      character(len=1) :: separator
      integer :: i

      text = text//'  Means of both predictions, with their intervals:'//newline
      do i = 1, size(rating_names)
         associate (rated => get_rated(prediction, rating_names(i)))
            text = text//'  '//rating_titles(i)//to_text(get_rounded(rated(1)))//' dB (' &
               //get_range_text(rated(2:))//')'//newline
            if (rating_names(i) == 'octaves') text = text//get_class_line(case, prediction, rated(1))
         end associate
      end do
      text = text//'  Of one-third octaves: statistical ' &
         //fixed(get_a_weighted_level(prediction%bands(1)%set, prediction%level), 1)//' dB, '
      if (prediction%n_modal > 0) then
         text = text//'modal ' &
            //fixed(get_a_weighted_level(prediction%bands(1)%set, prediction%modal_level), 1)//' dB'//newline
      else
         text = text//'no modal prediction: the interval contains neither edges nor model'//newline
      end if
      text = text//'  Contributions, one-third octaves:'
      separator = ' '
      do i = 1, size(contribution_names)
         if (prediction%n_modal == 0 .and. any(contribution_names(i) == ['edges', 'model'])) cycle
         ! As far as the decimals show it.
         if (all(abs(prediction%contribution(:, i, thirds)) < 0.05_wp)) cycle
         text = text//trim(separator)//' '//trim(replaced(trim(contribution_names(i)), '_', ' '))//' ' &
            //fixed(prediction%contribution(1, i, thirds), 1)//' to '//fixed(prediction%contribution(2, i, thirds), 1)
         separator = ','
      end do
      text = text//' dB'//newline
      if (size(prediction%path_share, 2) > 1) text = text//'  Energy that enters the room through the floor: ' &
         //fixed(100*minval(prediction%path_share(:, 1)), 0)//' to '//fixed(100*maxval(prediction%path_share(:, 1)), 0) &
         //' %, from the walls the rest.'//newline
      associate (room => case%room, required => get_rated(prediction, case%room%required_rating))
         if (room%required > 0.0_wp) text = text//'  Required of '//trim(room%required_rating)//': at most ' &
            //to_text(room%required)//' dB: '//trim(judge_requirement(room, prediction))//' (' &
            //get_range_text(required(2:))//').'//newline
      end associate
      text = text//'  Statistical means over positions, by the ' &
         //trim(merge('contact force', 'blocked force', coupled))//'.'//newline
   end subroutine add_ratings

   !> Ends of an interval of ratings, rounded as ratings are.
   function get_range_text(ends) result(text)
      !> The ends, dB: [2].
      real(wp), intent(in) :: ends(2)
      character(len=:), allocatable :: text

      text = to_text(get_rounded(ends(1)))//' to '//to_text(get_rounded(ends(2)))
   end function get_range_text

   !> Whether the class of KS F 2863-2 is stated: that of a rubber ball that conforms.
   pure function has_class(case, prediction) result(yes)
      type(case_type), intent(in) :: case
      type(room_level_type), intent(in) :: prediction
      logical :: yes

      yes = prediction%source_conforms .and. case%source == 'rubber_ball'
   end function has_class

   !> The class of a rating with its limit, as a line; empty for another source than the ball.
   function get_class_line(case, prediction, rating) result(text)
      type(case_type), intent(in) :: case
      type(room_level_type), intent(in) :: prediction
      !> Rating of octaves, dB.
      real(wp), intent(in) :: rating
      character(len=:), allocatable :: text
      integer :: number

      number = get_class(rating)
      text = ''
      if (.not. has_class(case, prediction)) then
         if (.not. prediction%source_conforms) text = '    class not stated: the source does not conform'//newline
      else if (number > 0) then
         text = '    class '//to_text(number)//' (at most '//fixed(class_limits(number), 0)//' dB)'//newline
      else
         text = '    no class (class '//to_text(size(class_limits))//': at most ' &
            //fixed(class_limits(size(class_limits)), 0)//' dB)'//newline
      end if
   end function get_class_line

   !> Ratings and verdict as a group of `summary.nml`.
   function get_room_summary(case, prediction) result(text)
      type(case_type), intent(in) :: case
      type(room_level_type), intent(in) :: prediction
      !> The group.
      character(len=:), allocatable :: text
      real(wp) :: rated(3)

      text = newline//'&room_summary'//newline//line('rating', join_quoted(rating_names), '') &
         //line('meaning', join_quoted(rating_titles), '')//line('level', join(prediction%rating), 'dB, statistical') &
         //line('rounded', join(real(get_rounded(prediction%rating), wp)), 'dB')
      rated = get_rated(prediction, rating_names(1))
      if (has_class(case, prediction)) text = text &
         //line('class', to_text(get_class(rated(1))), 'of octaves, KS F 2863-2; 0: none')
      text = text//line('rated', join(prediction%rated), 'dB, means of both predictions') &
         //line('rated_lower', join(prediction%interval(1, :)), 'dB') &
         //line('rated_upper', join(prediction%interval(2, :)), 'dB')
      if (prediction%n_modal > 0) text = text//line('modal', join(get_ratings(prediction, prediction%modal_level)), &
         'dB, by the modes')
      text = text//line('contribution', join_quoted(contribution_names), '') &
         //line('lower', join(prediction%contribution(1, :, thirds)), 'dB, of one-third octaves') &
         //line('upper', join(prediction%contribution(2, :, thirds)), 'dB, of one-third octaves')
      rated = get_rated(prediction, case%room%required_rating)
      if (case%room%required > 0.0_wp) text = text//line('required', to_text(case%room%required), 'dB') &
         //line('required_rating', quoted(case%room%required_rating), '') &
         //line('required_interval', join(rated(2:)), 'dB') &
         //line('verdict', quoted(judge_requirement(case%room, prediction)), '')
      text = text//'/'//newline
   end function get_room_summary

   !> A text padded to the width of a column.
   pure function padded(text) result(cell)
      character(len=*), intent(in) :: text
      character(len=column) :: cell

      cell = text
   end function padded

end module thud_room_report
