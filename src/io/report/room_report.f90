!> The level in the room below as text: the file and the table on the screen.
module thud_room_report
   use thud_band, only: get_band_name
   use thud_case, only: case_type, get_floor_number
   use thud_csv, only: get_table_csv
   use thud_kinds, only: wp
   use thud_rating, only: class_limits, get_class, get_rounded, rating_names, rating_titles
   use thud_report, only: line
   use thud_room, only: get_band_records, get_rating_index, room_level_type
   use thud_room_uncertainty, only: contribution_names, judge_requirement
   use thud_text, only: fixed, join, join_quoted, newline, quoted, replaced, significant, to_text
   implicit none (type, external)
   private

   public :: get_room_levels_csv, get_room_summary, get_room_table

   !> Width of a column of the table.
   integer, parameter :: column = 13

   !> Limit of (floor resistance x contact time / source mass) above which the floor lowers the peak force by less than
   !> 0.1 dB; the floor multiplies the peak of a linear source by exp(-pi**2 mass/(4 resistance contact_time)).
   real(wp), parameter :: firm = 214.0_wp

contains

   !> Levels and their factors in one-third-octave bands.
   subroutine get_room_levels_csv(prediction, text)
      type(room_level_type), intent(in) :: prediction
      !> Text of `room_levels.csv`.
      character(len=:), allocatable, intent(out) :: text
      character(len=:), allocatable :: header
      real(wp), allocatable :: columns(:)
      integer :: i

      header = 'nominal_Hz'
      columns = prediction%bands%nominal
      associate (records => get_band_records(prediction))
         do i = 1, size(records)
            header = header//','//trim(records(i)%name)
            if (records(i)%unit /= '') header = header//'_'//replaced(trim(records(i)%unit), '/', '_per_')
            columns = [columns, records(i)%values]
         end do
      end associate
      header = header//',direct_share'
      do i = 1, size(prediction%path_share, 2) - 1
         header = header//',wall_'//to_text(i)//'_share'
      end do
      columns = [columns, prediction%path_share]
      associate (n_band => size(prediction%bands))
         text = get_table_csv(header, reshape(columns, [n_band, size(columns)/n_band]))
      end associate
   end subroutine get_room_levels_csv

   !> Table of the levels for the screen.
   subroutine get_room_table(case, prediction, contact_time, coupled, text)
      type(case_type), intent(in) :: case
      type(room_level_type), intent(in) :: prediction
      !> Contact time of the impact on a rigid floor, s.
      real(wp), intent(in) :: contact_time
      !> The prediction uses the force on the mobile floor, not the force on a rigid floor.
      logical, intent(in) :: coupled
      !> The table.
      character(len=:), allocatable, intent(out) :: text
      real(wp) :: resistance
      integer :: i

      text = get_headline(case, prediction)//'  '//padded('room below')//padded('level')//'standard uncertainty'//newline
      do i = 1, size(prediction%bands)
         text = text//'  '//padded(get_band_name(prediction%bands(i))//' Hz') &
            //padded(fixed(prediction%level(i), 1)//' dB')//fixed(prediction%uncertainty(i), 1)//' dB'//newline
      end do
      text = text//newline//'  Octaves:'
      do i = 1, size(prediction%octaves)
         text = text//'  '//trim(get_band_name(prediction%octaves(i)))//' Hz '//fixed(prediction%octave_level(i), 1)//' dB'
      end do
      text = text//newline
      do i = 1, size(rating_names)
         text = text//'  '//get_title(case, i)//to_text(get_rounded(prediction%rating(i)))//' dB'//newline
         if (rating_names(i) == 'octaves') text = text//get_class_line(case, prediction, prediction%rating(i))
      end do
      resistance = 1/maxval(prediction%conductance)
      text = text//'  Energy means over positions, by the '//trim(merge('contact force', 'blocked force', coupled)) &
         //'; '//get_method(prediction)//'.'//newline
      if (size(prediction%path_share, 2) > 1) text = text//'  Energy that enters the room through the floor: ' &
         //fixed(100*minval(prediction%path_share(:, 1)), 0)//' to '//fixed(100*maxval(prediction%path_share(:, 1)), 0) &
         //' %, from the walls the rest.'//newline
      text = text//'  Room of '//fixed(prediction%volume, 1)//' m3, reverberation time ' &
         //fixed(minval(prediction%reverberation_time), 2)
      if (case%room%reverberation_time%count > 1) text = text//' to '//fixed(maxval(prediction%reverberation_time), 2)
      text = text//' s. Resistance of the floor '//significant(resistance/1.0e3_wp, 3)//' kN s/m.'//newline
      if (.not. coupled .and. contact_time*resistance < firm*case%ball%mass) text = text &
         //'  The floor yields under the source, but the force on a rigid floor is used: see docs/rooms.md.'//newline
   end subroutine get_room_table

   !> The rating that is asked for, whether it meets the requirement, and what its uncertainty follows from.
   function get_headline(case, prediction) result(text)
      type(case_type), intent(in) :: case
      type(room_level_type), intent(in) :: prediction
      character(len=:), allocatable :: text
      integer :: i, shown

      shown = get_rating_index(case%room)
      text = '  '//trim(get_title(case, shown))//': '//to_text(get_rounded(prediction%rating(shown))) &
         //' dB, standard uncertainty '//fixed(prediction%rating_uncertainty, 1)//' dB'
      if (case%room%required > 0.0_wp) text = text//'; meets '//get_limit(case%room%required)//' dB with ' &
         //fixed(100*prediction%probability, 0)//' %: '//trim(judge_requirement(prediction))
      if (case%room%required > 0.0_wp .and. .not. prediction%source_conforms) text = text//', the source does not conform'
      text = text//newline//'  Standard uncertainties:'
      do i = 1, size(contribution_names)
         if (prediction%contribution(i) < 0.05_wp) cycle
         text = text//' '//replaced(trim(contribution_names(i)), '_', ' ')//' ' &
            //fixed(prediction%contribution(i), 1)//' dB,'
      end do
      text = text(:len(text) - 1)//'. Rigid boxes, no measurement behind it.'//newline//newline
   end function get_headline

   !> A limit, without a decimal if it is whole.
   function get_limit(required) result(text)
      !> The limit, dB.
      real(wp), intent(in) :: required
      character(len=:), allocatable :: text

      text = fixed(required, merge(0, 1, abs(required - nint(required)) < tiny(required)))
   end function get_limit

   !> Title of a rating; the standards are for the ball.
   pure function get_title(case, rating) result(title)
      type(case_type), intent(in) :: case
      !> Index of the rating.
      integer, intent(in) :: rating
      character(len=len(rating_titles)) :: title

      title = rating_titles(rating)
      if (case%source /= 'rubber_ball') title = 'A-weighted level ('//trim(rating_names(rating))//')'
   end function get_title

   !> By what the levels are computed.
   function get_method(prediction) result(text)
      type(room_level_type), intent(in) :: prediction
      character(len=:), allocatable :: text

      text = 'statistical in all bands'
      if (prediction%n_modal > 0) text = 'by modes up to ' &
         //trim(get_band_name(prediction%bands(prediction%n_modal)))//' Hz, statistical above'
   end function get_method

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
      integer :: i

      text = newline//'&room_summary'//newline//line('rating', join_quoted(rating_names), '') &
         //line('meaning', join_quoted([(get_title(case, i), i=1, size(rating_names))]), '') &
         //line('level', join(prediction%rating), 'dB') &
         //line('uncertainty', to_text(prediction%rating_uncertainty), 'dB, standard') &
         //line('rounded', join(real(get_rounded(prediction%rating), wp)), 'dB')
      if (has_class(case, prediction)) text = text &
         //line('class', to_text(get_class(prediction%rating(1))), 'of octaves, KS F 2863-2; 0: none')
      text = text//line('contribution', join_quoted(contribution_names), '') &
         //line('contributed', join(prediction%contribution), 'dB')
      if (case%room%required > 0.0_wp) text = text//line('required', to_text(case%room%required), 'dB') &
         //line('required_rating', quoted(case%room%rating), '') &
         //line('probability', to_text(prediction%probability), 'that it is met') &
         //line('verdict', quoted(trim(judge_requirement(prediction))), '')
      text = text//'/'//newline
   end function get_room_summary

   !> A text padded to the width of a column.
   pure function padded(text) result(cell)
      character(len=*), intent(in) :: text
      character(len=column) :: cell

      cell = text
   end function padded

end module thud_room_report
