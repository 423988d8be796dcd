!> Remarks on what is possible but not plausible: input of no rubber, moduli of another model, forces of no source.
module thud_remarks
   use thud_ball, only: get_density
   use thud_case, only: case_type, get_model_number
   use thud_force_history, only: force_history_type, remark_length
   use thud_kinds, only: wp
   use thud_registry, only: model_names
   use thud_text, only: fixed, quoted, to_text
   implicit none (type, external)
   private

   public :: get_remarks

   !> Densities of rubbers, from unfilled natural rubber with pores to highly filled, kg/m3: [2].
   real(wp), parameter :: rubber_density(2) = [800.0_wp, 2200.0_wp]

   !> Moduli of elasticity of rubbers, from gels to ebonite, Pa: [2].
   real(wp), parameter :: rubber_modulus(2) = [1.0e4_wp, 1.0e9_wp]

   !> Two moduli count as the same within this part.
   real(wp), parameter :: same_modulus = 0.02_wp

   !> Levels over all frequencies of ball and tyre, the sums of their nominal octaves, dB re 1 N and 1 s: [2].
   real(wp), parameter :: source_level(2) = [39.7_wp, 47.8_wp]

   !> Distance from them of a force that is probably given in other units, dB.
   real(wp), parameter :: far = 40.0_wp

contains

   !> Remarks on a case and its force.
   subroutine get_remarks(case, history, remarks)
      !> The case, checked.
      type(case_type), intent(in) :: case
      type(force_history_type), intent(in) :: history
      !> Sentences: [n].
      character(len=remark_length), allocatable, intent(out) :: remarks(:)
      real(wp) :: typical, other, level
      integer :: i

      allocate (remarks(0))
      typical = case%models(get_model_number(case))%model%get_paper_modulus()
      ! Only these models use wall and modulus.
      if (typical > 0.0_wp) then
         associate (modulus => case%ball%youngs_modulus, density => get_density(case%ball))
            if (is_outside(density, rubber_density)) call add('&ball: the wall has a density of '//fixed(density, 0) &
               //' kg/m3, rubbers have '//range(rubber_density)//'; check mass, outer_radius and wall_thickness')
            if (is_outside(modulus, rubber_modulus)) call add('&ball: youngs_modulus = '//to_text(modulus) &
               //' Pa, rubbers have '//range(rubber_modulus)//'; check the unit')
            do i = 1, size(model_names)
               other = case%models(i)%model%get_paper_modulus()
               if (.not. (other > 0.0_wp .and. abs(other - typical) > same_modulus*typical)) cycle
               if (abs(modulus - other) > same_modulus*other) cycle
               call add('&ball: youngs_modulus = '//to_text(modulus)//" Pa is the paper's ball in the model " &
                  //quoted(model_names(i))//'; in '//quoted(case%model)//' that ball has '//to_text(typical)//' Pa')
               exit
            end do
         end associate
      end if
      level = 10*log10(max(sum(history%floor_force**2)/history%sample_rate, tiny(1.0_wp)))
      if (level < source_level(1) - far .or. level > source_level(2) + far) call add('the force exposure level over all ' &
         //'frequencies is '//fixed(level, 1)//' dB, more than '//fixed(far, 0)//' dB from those of the standard sources, ' &
         //range(source_level)//' dB; check the units of the input')

   contains

      !> Adds a sentence.
      subroutine add(sentence)
         character(len=*), intent(in) :: sentence
         character(len=remark_length) :: new

         new = sentence
         remarks = [remarks, new]
      end subroutine add

   end subroutine get_remarks

   !> Whether a value lies outside a range.
   pure function is_outside(value, range) result(outside)
      real(wp), intent(in) :: value
      !> Minimum and maximum: [2].
      real(wp), intent(in) :: range(2)
      logical :: outside

      outside = value < range(1) .or. value > range(2)
   end function is_outside

   !> A range as text.
   pure function range(ends) result(text)
      !> Minimum and maximum: [2].
      real(wp), intent(in) :: ends(2)
      character(len=len(to_text(ends(1))//' to '//to_text(ends(2)))) :: text

      text = to_text(ends(1))//' to '//to_text(ends(2))
   end function range

end module thud_remarks
