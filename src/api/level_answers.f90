!> Answers on levels and ratings of any record; see `thud_answer`.
module thud_level_answers
   use thud_band, only: band_type, get_bands, octave_set
   use thud_bundle, only: bundle_type
   use thud_error, only: error_type
   use thud_force_exposure, only: get_force_exposure_levels
   use thud_kinds, only: wp
   use thud_rating, only: correct_for_background, get_a_weighted_level, get_class, get_inverse_a_rating, get_rounded, &
      get_standardization
   use thud_request, only: request_type
   use thud_source_limits, only: get_peak_count
   use thud_transform, only: get_low_pass
   implicit none (type, external)
   private

   public :: answer_level

contains

   !> Answers a question on a record `force`, N, at `sample_rate`, Hz, or on levels in a room.
   subroutine answer_level(question, request, bundle, error)
      !> `levels`: force exposure levels, dB, in the band set `bands`, by `method`; `peak_count`: number of peaks;
      !> `low_pass`: the record low-passed at `cutoff`, Hz; `rating`: see `answer_rating`.
      character(len=*), intent(in) :: question
      type(request_type), intent(in) :: request
      type(bundle_type), intent(inout) :: bundle
      !> Set if a level cannot be computed.
      type(error_type), allocatable, intent(out) :: error
      type(band_type), allocatable :: bands(:)
      character(len=:), allocatable :: set, method
      real(wp), allocatable :: values(:)

      associate (force => request%get_array('force'), sample_rate => request%get_number('sample_rate'))
         select case (question)
         case ('levels')
            call request%get_text('bands', set)
            call request%get_text('method', method)
            bands = get_bands(set)
            allocate (values(size(bands)))
            call get_force_exposure_levels(force, sample_rate, bands, method, values, error)
            if (.not. allocated(error)) call bundle%add_array('levels', shape(values), values)
         case ('peak_count')
            call bundle%add_number('peak_count', real(get_peak_count(force, sample_rate), wp))
         case ('low_pass')
            allocate (values(size(force)))
            call get_low_pass(force, sample_rate, request%get_number('cutoff'), values)
            call bundle%add_array('force', shape(values), values)
         case default
            call answer_rating(request, bundle)
         end select
      end associate
   end subroutine answer_level

   !> The `levels` in a room, dB, corrected for the levels `background`, dB, and standardized by `reverberation_time`, s, and
   !> `volume`, m3, if the request has them. In the rated bands of the set `bands`, if it has one, also their single-number
   !> ratings: A-weighted level, the same rounded, class (0 for none) and, for octaves, inverse-A curve rating.
   subroutine answer_rating(request, bundle)
      type(request_type), intent(in) :: request
      type(bundle_type), intent(inout) :: bundle
      character(len=:), allocatable :: set
      real(wp), allocatable :: levels(:)
      logical, allocatable :: is_upper_bound(:)
      real(wp) :: a_weighted

      allocate (levels, source=request%get_array('levels'))
      if (request%has('background')) then
         allocate (is_upper_bound(size(levels)))
         call correct_for_background(request%get_array('levels'), request%get_array('background'), levels, is_upper_bound)
         call bundle%add_array('is_upper_bound', shape(levels), merge(1.0_wp, 0.0_wp, is_upper_bound))
      end if
      if (request%has('volume')) levels = levels + get_standardization(request%get_array('reverberation_time'), &
         request%get_number('volume'))
      call bundle%add_array('levels', shape(levels), levels)
      call request%get_text('bands', set)
      if (set == '') return
      a_weighted = get_a_weighted_level(set, levels)
      call bundle%add_number('a_weighted', a_weighted)
      call bundle%add_number('rounded', real(get_rounded(a_weighted), wp))
      call bundle%add_number('class', real(get_class(a_weighted), wp))
      if (set == octave_set) call bundle%add_number('curve', real(get_inverse_a_rating(levels), wp))
   end subroutine answer_rating

end module thud_level_answers
