!> The level in the room below as a table on the screen.
module thud_room_table
   use thud_band, only: get_band_name
   use thud_case, only: case_type
   use thud_kinds, only: wp
   use thud_rating, only: class_limits, get_class, get_rounded, rating_names
   use thud_records, only: get_rating_title, has_class
   use thud_room, only: get_rating_index, room_level_type
   use thud_room_uncertainty, only: contribution_names, judge_requirement
   use thud_source_limits, only: verdict_names
   use thud_text, only: fixed, marked, newline, padded, replaced, significant, to_text
   implicit none (type, external)
   private

   public :: get_room_table

   !> Width of a column of the table.
   integer, parameter :: column = 13

   !> Limit of (floor resistance x contact time / source mass) above which the floor lowers the peak force by less than
   !> 0.1 dB; the floor multiplies the peak of a linear source by exp(-pi**2 mass/(4 resistance contact_time)).
   real(wp), parameter :: firm = 214.0_wp

contains

   !> Table of the levels.
   function get_room_table(case, prediction, contact_time, coupled) result(text)
      type(case_type), intent(in) :: case
      type(room_level_type), intent(in) :: prediction
      !> Contact time of the impact on a rigid floor, s.
      real(wp), intent(in) :: contact_time
      !> The prediction uses the force on the mobile floor, not the force on a rigid floor.
      logical, intent(in) :: coupled
      character(len=:), allocatable :: text
      real(wp) :: resistance
      integer :: i, class

      i = get_rating_index(case%room)
      text = '  '//trim(get_rating_title(case, i))//': '//to_text(get_rounded(prediction%rating(i))) &
         //' dB, standard uncertainty '//fixed(prediction%rating_uncertainty, 1)//' dB'
      associate (required => case%room%required)
         ! Without a decimal if it is whole.
         if (required > 0.0_wp) text = text//'; meets '//fixed(required, merge(0, 1, abs(required - nint(required)) &
            < tiny(required)))//' dB with '//fixed(100*prediction%probability, 0)//' %: ' &
            //marked(verdict_names(judge_requirement(prediction)), judge_requirement(prediction))
         if (required > 0.0_wp .and. .not. prediction%source_conforms) text = text//', the source does not conform'
      end associate
      text = text//newline//'  Standard uncertainties:'
      do i = 1, size(contribution_names)
         if (prediction%contribution(i) < 0.05_wp) cycle
         text = text//' '//replaced(trim(contribution_names(i)), '_', ' ')//' ' &
            //fixed(prediction%contribution(i), 1)//' dB,'
      end do
      text = text(:len(text) - 1)//'. Rigid boxes, no measurement behind it.'//newline//newline &
         //'  '//padded('room below', column)//padded('level', column) &
         //'standard uncertainty'//newline
      do i = 1, size(prediction%bands)
         text = text//'  '//padded(get_band_name(prediction%bands(i))//' Hz', column) &
            //padded(fixed(prediction%level(i), 1)//' dB', column)//fixed(prediction%uncertainty(i), 1)//' dB'//newline
      end do
      text = text//newline//'  Octaves:'
      do i = 1, size(prediction%octaves)
         text = text//'  '//trim(get_band_name(prediction%octaves(i)))//' Hz '//fixed(prediction%octave_level(i), 1)//' dB'
      end do
      text = text//newline
      do i = 1, size(rating_names)
         text = text//'  '//get_rating_title(case, i)//to_text(get_rounded(prediction%rating(i)))//' dB'//newline
         ! Another source than the ball has no class.
         if (rating_names(i) /= 'octaves' .or. prediction%source_conforms .and. .not. has_class(case, prediction)) cycle
         class = get_class(prediction%rating(i))
         if (.not. prediction%source_conforms) then
            text = text//'    class not stated: the source does not conform'//newline
         else if (class > 0) then
            text = text//'    class '//to_text(class)//' (at most '//fixed(class_limits(class), 0)//' dB)'//newline
         else
            text = text//'    no class (class '//to_text(size(class_limits))//': at most ' &
               //fixed(class_limits(size(class_limits)), 0)//' dB)'//newline
         end if
      end do
      resistance = 1/maxval(prediction%conductance)
      text = text//'  Energy means over positions, by the '//trim(merge('contact force', 'blocked force', coupled))//'; '
      if (prediction%n_modal > 0) then
         text = text//'by modes up to '//trim(get_band_name(prediction%bands(prediction%n_modal))) &
            //' Hz, statistical above.'//newline
      else
         text = text//'statistical in all bands.'//newline
      end if
      if (size(prediction%path_share, 2) > 1) text = text//'  Energy that enters the room through the floor: ' &
         //fixed(100*minval(prediction%path_share(:, 1)), 0)//' to '//fixed(100*maxval(prediction%path_share(:, 1)), 0) &
         //' %, from the walls the rest.'//newline
      text = text//'  Room of '//fixed(prediction%box%volume, 1)//' m3, reverberation time ' &
         //fixed(minval(prediction%box%reverberation_time), 2)
      if (case%room%reverberation_time%count > 1) text = text//' to '//fixed(maxval(prediction%box%reverberation_time), 2)
      text = text//' s. Resistance of the floor '//significant(resistance/1.0e3_wp, 3)//' kN s/m.'//newline
      if (.not. coupled .and. contact_time*resistance < firm*case%ball%mass) text = text &
         //'  The floor yields under the source, but the force on a rigid floor is used: see docs/rooms.md.'//newline
   end function get_room_table

end module thud_room_table
