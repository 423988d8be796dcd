!> Standard uncertainty of the level in the room, and the probability that a requirement is met.
!>
!> Four contributions are independent of each other: the support of the edges if it is not stated, what else is not known of
!> floor and room, the source, and the model. The first three are the scatter of the levels of varied dwellings and balls
!> about the level of their nominal values, by tests/bench/room_boxes.py (docs/room_theory.md). The fourth is a judgement: no
!> data determine how much buildings differ from rigid boxes.
module thud_room_uncertainty
   use thud_kinds, only: wp
   use thud_plate_stack, only: plate_stack_type
   use thud_rating, only: get_rounded
   use thud_room, only: get_rating_index, room_level_type, room_type
   use thud_source_limits, only: verdict_conforms, verdict_fails, verdict_undecided
   implicit none (type, external)
   private

   public :: add_uncertainty, contribution_names, get_probability, judge_requirement

   !> Contributions to the uncertainty.
   character(len=*), parameter :: contribution_names(*) = [character(len=14) :: 'edges', 'floor_and_room', 'source', &
      'model']

   !> Number of bands.
   integer, parameter :: n_band = 12

   !> Scatter of the level in a band by the support of the edges, and by what else is not known of floor and room, dB: of a
   !> single plate, of plates above each other, and of joists: [n_band, 3].
   real(wp), parameter :: band_edges(n_band, 3) = reshape([ &
      5.0_wp, 4.0_wp, 3.0_wp, 2.5_wp, 2.5_wp, 2.0_wp, 2.0_wp, 1.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, &
      3.0_wp, 2.0_wp, 1.5_wp, 2.0_wp, 2.0_wp, 2.5_wp, 2.0_wp, 1.5_wp, 1.5_wp, 0.0_wp, 0.0_wp, 0.0_wp, &
      3.5_wp, 4.5_wp, 3.0_wp, 2.5_wp, 2.0_wp, 2.5_wp, 0.5_wp, 0.5_wp, 1.0_wp, 0.5_wp, 0.5_wp, 0.5_wp], [n_band, 3])
   real(wp), parameter :: band_floor(n_band, 3) = reshape([ &
      1.5_wp, 1.0_wp, 1.5_wp, 1.5_wp, 1.0_wp, 1.5_wp, 1.5_wp, 1.5_wp, 1.0_wp, 1.0_wp, 1.0_wp, 1.0_wp, &
      1.0_wp, 1.5_wp, 1.5_wp, 1.5_wp, 1.5_wp, 2.0_wp, 2.5_wp, 1.5_wp, 1.5_wp, 1.5_wp, 1.5_wp, 1.5_wp, &
      1.5_wp, 1.0_wp, 1.0_wp, 2.0_wp, 1.5_wp, 1.0_wp, 1.0_wp, 1.5_wp, 1.0_wp, 1.0_wp, 1.5_wp, 1.0_wp], [n_band, 3])

   !> The same of the A-weighted level, dB: [3].
   real(wp), parameter :: rating_edges(3) = [0.5_wp, 1.5_wp, 0.5_wp], rating_floor(3) = [1.0_wp, 1.0_wp, 0.5_wp]

   !> Scatter of the level in a band and of the A-weighted level by the balls of the calibrated set about the modal ball, dB.
   real(wp), parameter :: band_source(n_band) = [0.0_wp, 0.0_wp, 0.0_wp, 0.5_wp, 1.5_wp, 0.5_wp, 1.0_wp, 0.5_wp, 1.0_wp, &
      1.0_wp, 0.5_wp, 1.0_wp]
   real(wp), parameter :: rating_source = 0.5_wp

   !> Error of the model, dB.
   real(wp), parameter :: model_error = 2.0_wp

   !> Probabilities from which a requirement is met, and up to which it is missed: one standard uncertainty.
   real(wp), parameter, public :: met_from = 0.84_wp, missed_up_to = 0.16_wp

contains

   !> Adds the uncertainties of levels and ratings.
   pure subroutine add_uncertainty(stack, edges_are_known, prediction)
      !> The plates above each other.
      type(plate_stack_type), intent(in) :: stack
      !> The support of the edges is known.
      logical, intent(in) :: edges_are_known
      !> Prediction with its levels.
      type(room_level_type), intent(inout) :: prediction
      real(wp) :: edges(n_band)
      integer :: i, kind, n

      kind = 1
      if (allocated(stack%plate)) then
         if (size(stack%plate) > 1) kind = 2
         if (any([(allocated(stack%plate(i)%ribs), i=1, size(stack%plate))])) kind = 3
      end if
      ! Edges matter where the level follows from modes.
      n = merge(0, prediction%n_modal, edges_are_known)
      edges = 0.0_wp
      edges(:n) = band_edges(:n, kind)
      prediction%uncertainty = sqrt(edges**2 + band_floor(:, kind)**2 + band_source**2 + model_error**2)
      prediction%contribution = [merge(rating_edges(kind), 0.0_wp, n > 0), rating_floor(kind), rating_source, model_error]
      prediction%rating_uncertainty = norm2(prediction%contribution)
   end subroutine add_uncertainty

   !> Probability that the rounded rating is at most the required one.
   pure function get_probability(room, prediction) result(probability)
      !> A room with a requirement.
      type(room_type), intent(in) :: room
      type(room_level_type), intent(in) :: prediction
      real(wp) :: probability

      associate (distance => floor(room%required) + 0.5_wp - get_rounded(prediction%rating(get_rating_index(room))))
         probability = erfc(-distance/(sqrt(2.0_wp)*prediction%rating_uncertainty))/2
      end associate
   end function get_probability

   !> Verdict on the requirement of a room.
   pure function judge_requirement(prediction) result(verdict)
      !> Prediction with its probability.
      type(room_level_type), intent(in) :: prediction
      !> Undecided if the source does not conform.
      integer :: verdict

      verdict = verdict_undecided
      if (.not. prediction%source_conforms) return
      if (prediction%probability >= met_from) verdict = verdict_conforms
      if (prediction%probability <= missed_up_to) verdict = verdict_fails
   end function judge_requirement

end module thud_room_uncertainty
