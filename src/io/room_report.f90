!> The level in the room below as text: the file and the table on the screen.
module thud_room_report
   use thud_band, only: get_band_name
   use thud_case, only: case_type
   use thud_kinds, only: wp
   use thud_rating, only: get_rounded
   use thud_room, only: few_modes, room_level_type
   use thud_text, only: fixed, newline, to_text
   implicit none (type, external)
   private

   public :: get_room_csv, get_room_table

   !> Width of a column of the table.
   integer, parameter :: column = 13

   !> Resistance of a floor times contact time over mass of the source above which the peak of the force loses less than
   !> 0.1 dB by the floor: of a linear source it loses exp(-pi**2 mass/(4 resistance contact_time)).
   real(wp), parameter :: firm = 214.0_wp

contains

   !> Level and what it is made of, per third.
   subroutine get_room_csv(prediction, text)
      type(room_level_type), intent(in) :: prediction
      !> Text of `room_levels.csv`.
      character(len=:), allocatable, intent(out) :: text
      integer :: i, j

      text = 'nominal_Hz,level_dB,time_of_maximum_s,energy_J,radiation_factor,loss_factor,reverberation_time_s,' &
         //'floor_modes,room_modes'//newline
      do i = 1, size(prediction%bands)
         associate (numbers => [prediction%bands(i)%nominal, prediction%level(i), prediction%time(i), prediction%energy(i), &
            prediction%radiation_factor(i), prediction%loss_factor(i), prediction%reverberation_time(i), &
            prediction%floor_modes(i), prediction%room_modes(i)])
            do j = 1, size(numbers)
               if (j > 1) text = text//','
               text = text//to_text(numbers(j))
            end do
         end associate
         text = text//newline
      end do
   end subroutine get_room_csv

   !> The levels for the screen; thirds of few modes are marked.
   subroutine get_room_table(case, prediction, contact_time, coupled, text)
      type(case_type), intent(in) :: case
      type(room_level_type), intent(in) :: prediction
      !> Contact time of the impact on a rigid floor, s.
      real(wp), intent(in) :: contact_time
      !> The prediction is made of the force on the floor that moves, not of the blocked one.
      logical, intent(in) :: coupled
      !> The table.
      character(len=:), allocatable, intent(out) :: text
      character(len=1) :: mark
      real(wp) :: resistance
      integer :: i

      text = '  '//padded('room below')//padded('L_i,Fmax')//padded('floor modes')//'room modes'//newline
      do i = 1, size(prediction%bands)
         mark = merge('*', ' ', min(prediction%floor_modes(i), prediction%room_modes(i)) < few_modes)
         text = text//'  '//padded(get_band_name(prediction%bands(i))//' Hz') &
            //padded(fixed(prediction%level(i), 1)//' dB '//mark)//padded(fixed(prediction%floor_modes(i), 1)) &
            //fixed(prediction%room_modes(i), 1)//newline
      end do
      text = text//newline//'  L_iA,Fmax '//to_text(get_rounded(prediction%a_weighted))//' dB (' &
         //fixed(prediction%a_weighted, 2)//'), ISO 717-2 annex D: ' &
         //trim(merge('contact force', 'blocked force', coupled))//', statistical mean over positions.'//newline
      resistance = 1/maxval(prediction%conductance)
      text = text//'  Resistance of the floor '//fixed(resistance/1.0e3_wp, 1)//' kN s/m.'
      if (any(min(prediction%floor_modes, prediction%room_modes) < few_modes)) text = text//' *: fewer than ' &
         //fixed(few_modes, 0)//' modes, where single rooms and positions differ by several dB.'
      text = text//newline
      if (.not. coupled .and. contact_time*resistance < firm*case%ball%mass) text = text &
         //'  The floor gives way under the source, and the force on a rigid floor is used: see docs/rooms.md.'//newline
   end subroutine get_room_table

   !> A text of a column's width.
   pure function padded(text) result(cell)
      character(len=*), intent(in) :: text
      character(len=column) :: cell

      cell = text
   end function padded

end module thud_room_report
