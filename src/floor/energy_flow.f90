!> Coupled subsystems of a statistical energy analysis in one band: their losses and the energy flow between them.
module thud_energy_flow
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: add_subsystem, connect, energy_flow_type, get_loss_matrix, new_energy_flow

   !> Subsystems and the flow between them.
   type :: energy_flow_type
      !> Modes per hertz of the subsystems, s: [n].
      real(wp), allocatable :: mode_density(:)
      !> Minimum total loss rates, including the flow to others, 1/s; the last subsystems may have none: [at most n].
      real(wp), allocatable :: total(:)
      !> Minimum rates of the losses that go to no other subsystem, 1/s: [n].
      real(wp), allocatable :: internal_loss(:)
      !> Rate at which energy flows from j to i, 1/s: [n, n].
      real(wp), allocatable :: rate(:, :)
   end type energy_flow_type

contains

   !> Subsystems without flow between them.
   pure function new_energy_flow(mode_density, total, internal_loss) result(flow)
      !> Modes per hertz, s: [n].
      real(wp), intent(in) :: mode_density(:)
      !> Minimum total loss rates, 1/s; the last subsystems may have none: [at most n].
      real(wp), intent(in) :: total(:)
      !> Minimum rates of the losses that go to no other subsystem, 1/s: [n].
      real(wp), intent(in) :: internal_loss(:)
      type(energy_flow_type) :: flow

      allocate (flow%mode_density, source=mode_density)
      allocate (flow%total, source=total)
      allocate (flow%internal_loss, source=internal_loss)
      allocate (flow%rate(size(internal_loss), size(internal_loss)), source=0.0_wp)
   end function new_energy_flow

   !> Adds a subsystem without flow to others.
   pure subroutine add_subsystem(flow, mode_density, internal_loss)
      type(energy_flow_type), intent(inout) :: flow
      !> Modes per hertz, s; loss rate, 1/s.
      real(wp), intent(in) :: mode_density, internal_loss
      real(wp), allocatable :: rate(:, :)

      call move_alloc(flow%rate, rate)
      associate (n => size(flow%internal_loss))
         allocate (flow%rate(n + 1, n + 1), source=0.0_wp)
         flow%rate(:n, :n) = rate
      end associate
      flow%mode_density = [flow%mode_density, mode_density]
      flow%internal_loss = [flow%internal_loss, internal_loss]
   end subroutine add_subsystem

   !> Adds an energy flow from one subsystem to another, and the flow back by reciprocity: n1 a12 = n2 a21.
   pure subroutine connect(flow, from, to, rate)
      type(energy_flow_type), intent(inout) :: flow
      !> Indices of the subsystems.
      integer, intent(in) :: from, to
      !> Rate at which energy flows from the first to the second, 1/s.
      real(wp), intent(in) :: rate

      flow%rate(to, from) = flow%rate(to, from) + rate
      flow%rate(from, to) = flow%rate(from, to) + rate*flow%mode_density(from)/flow%mode_density(to)
   end subroutine connect

   !> Matrix A of dE/dt = -A E. The sum of a column is the loss that goes to no subsystem: the total loss minus the flow to
   !> others, but at least the internal loss.
   pure function get_loss_matrix(flow) result(loss_matrix)
      type(energy_flow_type), intent(in) :: flow
      !> A, 1/s: [n, n].
      real(wp) :: loss_matrix(size(flow%internal_loss), size(flow%internal_loss))
      real(wp) :: leaving
      integer :: i

      loss_matrix = -flow%rate
      do i = 1, size(flow%internal_loss)
         leaving = sum(flow%rate(:, i))
         loss_matrix(i, i) = loss_matrix(i, i) + leaving + flow%internal_loss(i)
         if (i <= size(flow%total)) loss_matrix(i, i) = max(loss_matrix(i, i), flow%total(i))
      end do
   end function get_loss_matrix

end module thud_energy_flow
