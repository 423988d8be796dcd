!> How a force is sampled in time: rate, length of the record, steps per sample.
module thud_sampling
   use thud_error, only: error_type, input_error
   use thud_field, only: field_type, new_field
   use thud_kinds, only: wp
   use thud_text, only: to_text
   implicit none (type, external)
   private

   public :: check_sampling, get_sample_count, get_sampling_fields, sampling_type

   !> Maximum number of samples of a record; more would fill the memory, and no drop needs them.
   integer, parameter :: max_samples = 5000000

   !> Maximum number of integration steps of a record; more would run for minutes.
   real(wp), parameter :: max_steps = 1.0e8_wp

   !> Relative rounding error of a number of samples: of the decimal numbers duration and rate, and of their product.
   real(wp), parameter :: rounding = 4*epsilon(1.0_wp)

   !> The sampled record; the default rate is the paper's.
   type :: sampling_type
      !> Samples per second, Hz.
      real(wp) :: sample_rate = 44100.0_wp
      !> Length of the record from first touch, s.
      real(wp) :: duration = 0.05_wp
      !> Integration steps per sampling interval.
      integer :: substeps = 1
      !> Whether to compute again at a finer resolution.
      logical :: verify = .false.
   end type sampling_type

contains

   !> Keys, units and allowed ranges of the group `&sampling`.
   function get_sampling_fields(sampling) result(fields)
      !> The sampling that the fields read and set.
      type(sampling_type), intent(in), target :: sampling
      !> One field per component: [4].
      type(field_type) :: fields(4)

      fields = [ &
         new_field('sample_rate', sampling%sample_rate, 'Hz', 'samples per second; from 16000 with finite_element', &
         '[2000, 1e7]'), &
         new_field('duration', sampling%duration, 's', 'duration of the record from first touch', '[0.001, 10]'), &
         new_field('substeps', sampling%substeps, '', 'integration steps per sampling interval', '[1, 10000]'), &
         new_field('verify', sampling%verify, '', 'compute again at a finer resolution, and state the changes')]
   end function get_sampling_fields

   !> Checks the numbers of samples and steps of a record.
   subroutine check_sampling(sampling, error)
      !> The sampling, each value inside its own range.
      type(sampling_type), intent(in) :: sampling
      !> Set if there are too many; the message names the keys, their product and the allowed range.
      type(error_type), allocatable, intent(out) :: error
      integer :: samples

      samples = get_sample_count(sampling)
      if (samples > max_samples) then
         error = input_error('= '//to_text(sampling%duration)//' s at sample_rate = '//to_text(sampling%sample_rate) &
            //' Hz makes '//to_text(samples)//' samples; allowed: up to '//to_text(max_samples), 'sampling', 'duration')
      else if (real(samples, wp)*sampling%substeps > max_steps) then
         error = input_error('= '//to_text(sampling%substeps)//' with '//to_text(samples)//' samples makes ' &
            //to_text(real(samples, wp)*sampling%substeps)//' steps; allowed: up to '//to_text(max_steps), 'sampling', &
            'substeps')
      end if
   end subroutine check_sampling

   !> Number of samples of the record: one at the beginning of each whole sampling interval.
   pure function get_sample_count(sampling) result(n_sample)
      type(sampling_type), intent(in) :: sampling
      !> Samples from first touch on, the first one included; at most 1e8 inside the ranges of the keys.
      integer :: n_sample

      n_sample = int(sampling%duration*sampling%sample_rate*(1 + rounding))
   end function get_sample_count

end module thud_sampling
