!> Plates above each other, with ribs and resilient layers, and the functions that resolve their waves.
!>
!> Each plate is orthotropic, with bending stiffnesses and, if it is not rigid in shear, shear stiffnesses. Its edges are
!> held by springs against deflection and rotation, which may be rigid.
module thud_plate_stack
   use thud_constants, only: pi
   use thud_kinds, only: wp
   use thud_plate, only: get_bending_stiffness, get_surface_mass, plate_type
   implicit none (type, external)
   private

   public :: edge_type, layer_type, orthotropic_type, plate_stack_type, ribs_type, rigid_support
   public :: get_counts, get_degree, get_lines, get_resolved_frequency, get_simplified, get_spaced_positions, has_shear, &
      has_sines, is_uncoupled, new_orthotropic, with_clamped_edges, with_rigid_edges

   !> A spring of this stiffness or more is a rigid support.
   real(wp), parameter :: rigid_support = 1.0e15_wp

   !> Maximum number of functions of a stack, if all are coupled, if those of equal symmetry in one or in both directions
   !> are, if only those along the width are, and if none is. The first four take about as long.
   integer, parameter :: max_coupled(0:2) = [700, 1100, 1700]
   integer, parameter :: max_half_coupled = 6000, max_uncoupled = 100000

   !> Frequency that the functions of a simplified stack resolve, Hz: above the highest band of a rating.
   real(wp), parameter :: simplified_limit = 800.0_wp

   !> Lowest frequency that functions resolve, Hz: far below all bands; the few waves up to it are resolved by the fewest.
   real(wp), parameter :: min_resolved = 1.0_wp

   !> Ratio of the number of modes of a beam to that of the half waves which they resolve.
   real(wp), parameter :: beam_ratio = 1.2_wp

   !> Longer side of the smallest part of a floor that represents it, m.
   real(wp), parameter :: min_part = 1.0_wp

   !> Poisson's ratio of plates; it affects only edges that are not held.
   real(wp), parameter :: poisson = 0.2_wp

   !> Springs along an edge of a plate.
   type :: edge_type
      !> Stiffness against deflection, N/m2, and against rotation, N, per length.
      real(wp) :: deflection = rigid_support, rotation = 0.0_wp
   end type edge_type

   !> Equal beams below a plate along its length.
   type :: ribs_type
      !> Positions across the ribs, m: [n_rib].
      real(wp), allocatable :: position(:)
      !> Stiffness of one rib in bending, N m2, in shear, N, in torsion, N m2, and in warping, N m4.
      real(wp) :: bending = 0.0_wp, shear = 0.0_wp, torsion = 0.0_wp, warping = 0.0_wp
      !> Bending stiffness that a flange without slip adds, N m2, and its slip by shear force, 1/N.
      real(wp) :: composite = 0.0_wp, slip = 0.0_wp
      !> Mass per length, kg/m, and its moment of inertia about the axis of rotation, kg m.
      real(wp) :: mass = 0.0_wp, inertia = 0.0_wp
      real(wp) :: loss_factor = 0.0_wp
   end type ribs_type

   !> A plate.
   type :: orthotropic_type
      !> Bending stiffness per width along length and width, coupling of both curvatures, and torsion, N m; the energy per
      !> area is (B_x w_xx**2 + 2 B_xy w_xx w_yy + B_y w_yy**2 + 4 B_t w_xy**2)/2.
      real(wp) :: along = 0.0_wp, across = 0.0_wp, coupling = 0.0_wp, torsion = 0.0_wp
      !> Shear stiffness per width of both directions, N/m; 0: rigid.
      real(wp) :: shear(2) = 0.0_wp
      !> Mass per area, kg/m2, and its moment of inertia, kg.
      real(wp) :: mass = 0.0_wp, inertia = 0.0_wp
      real(wp) :: loss_factor = 0.0_wp
      !> Edges at x = 0, x = length, y = 0 and y = width.
      type(edge_type) :: edge(4)
      !> Lines on which the plate rests, m: x = constant and y = constant.
      real(wp), allocatable :: line_x(:), line_y(:)
      type(ribs_type), allocatable :: ribs
   end type orthotropic_type

   !> The connection of two plates.
   type :: layer_type
      !> Stiffness per area, N/m3, and its loss factor.
      real(wp) :: stiffness = 0.0_wp, loss_factor = 0.0_wp
      !> Springs along lines y = constant: positions, m, stiffness per length, N/m2, and loss factor.
      real(wp), allocatable :: line_y(:)
      real(wp) :: line_stiffness = 0.0_wp, line_loss_factor = 0.0_wp
   end type layer_type

   !> Plates of equal sides, the upper one first.
   type :: plate_stack_type
      !> Length and width, m.
      real(wp) :: length = 1.0_wp, width = 1.0_wp
      type(orthotropic_type), allocatable :: plate(:)
      !> The layers between them: [n_plate - 1].
      type(layer_type), allocatable :: layer(:)
      !> Number of the plate that radiates into the room, and of the one that bears, which has losses at its edges.
      integer :: radiator = 1, bearing = 1
   end type plate_stack_type

contains

   !> Stiffnesses and mass of a homogeneous thin plate.
   pure function new_orthotropic(plate) result(thin)
      type(plate_type), intent(in) :: plate
      type(orthotropic_type) :: thin

      associate (mean => get_bending_stiffness(plate), root => sqrt(plate%stiffness_ratio))
         thin%along = mean/root
         thin%across = mean*root
         ! H = coupling + 2 torsion.
         thin%coupling = poisson*plate%torsion_ratio*mean
         thin%torsion = (1 - poisson)/2*plate%torsion_ratio*mean
      end associate
      thin%mass = get_surface_mass(plate)
      thin%loss_factor = plate%loss_factor
   end function new_orthotropic

   !> As many positions of lines a distance apart as fit into a width, symmetric about its middle, m: [n].
   pure function get_spaced_positions(width, spacing, thickness) result(position)
      !> Width and distance, m.
      real(wp), intent(in) :: width, spacing
      !> Thickness of what lies on the lines, m: at an edge itself it would not move.
      real(wp), intent(in) :: thickness
      real(wp), allocatable :: position(:)
      integer :: i, n

      n = max(1, int(width/spacing*(1 + epsilon(1.0_wp))))
      if (thickness > 0.0_wp .and. (n - 1)*spacing > width - thickness) n = n - 1
      position = width/2 + spacing*[(i - (n + 1)/2.0_wp, i=1, n)]
   end function get_spaced_positions

   !> A stack whose bearing plate has clamped edges.
   pure function with_clamped_edges(stack) result(clamped)
      type(plate_stack_type), intent(in) :: stack
      type(plate_stack_type) :: clamped

      clamped = stack
      clamped%plate(clamped%bearing)%edge = edge_type(rigid_support, rigid_support)
   end function with_clamped_edges

   !> A stack whose stiffest edges are rigid: springs against rotation from 1e7 B/l and against deflection from 1e10 B/l**3
   !> on change frequencies by less than 1e-6, but would be lost in the rounding of the largest stiffness.
   pure function with_rigid_edges(stack) result(held)
      type(plate_stack_type), intent(in) :: stack
      type(plate_stack_type) :: held
      real(wp) :: bending(4), side(4)
      integer :: i

      held = stack
      side = [stack%length, stack%length, stack%width, stack%width]
      do i = 1, size(held%plate)
         associate (plate => held%plate(i))
            bending = [plate%along, plate%along, plate%across, plate%across]
            where (plate%edge%rotation >= 1.0e7_wp*bending/side) plate%edge%rotation = rigid_support
            where (plate%edge%deflection >= 1.0e10_wp*bending/side**3) plate%edge%deflection = rigid_support
         end associate
      end do
   end function with_rigid_edges

   !> Frequency up to which the functions of a stack resolve its waves, Hz; 0 if even few waves need too many functions.
   pure function get_resolved_frequency(stack, max_frequency) result(frequency)
      type(plate_stack_type), intent(in) :: stack
      !> Frequency up to which the modes are wanted, Hz.
      real(wp), intent(in) :: max_frequency
      real(wp) :: frequency
      integer :: i, limit

      associate (uncoupled => is_uncoupled(stack))
         limit = max_coupled(count(is_symmetric(stack)))
         if (uncoupled(1)) limit = max_half_coupled
         if (all(uncoupled)) limit = max_uncoupled
      end associate
      ! Rotations take about as long as two plates.
      if (any(has_shear(stack%plate))) limit = limit/2
      frequency = max_frequency
      do while (sum([(product(real(get_all_counts(stack%plate(i)), wp)), i=1, size(stack%plate))]) > limit)
         frequency = 0.95_wp*frequency
         if (frequency >= min_resolved) cycle
         frequency = 0.0_wp
         exit
      end do
   contains

      !> Number of functions of x and of y of a plate, with the rotations of ribs: [2].
      pure function get_all_counts(plate) result(n)
         type(orthotropic_type), intent(in) :: plate
         integer :: n(2)

         n = get_counts(stack, plate, frequency)
         if (allocated(plate%ribs)) n(2) = n(2) + size(plate%ribs%position)
      end function get_all_counts
   end function get_resolved_frequency

   !> The middle of a stack with simply supported edges and no further supports, as large as functions resolve its waves up
   !> to the bands of a rating: as a rule all of it.
   pure function get_simplified(stack) result(part)
      type(plate_stack_type), intent(in) :: stack
      type(plate_stack_type) :: part
      real(wp) :: cut
      integer :: i

      part = stack
      associate (bearing => part%plate(part%bearing))
         bearing%edge = edge_type()
         if (allocated(bearing%line_x)) deallocate (bearing%line_x)
         if (allocated(bearing%line_y)) deallocate (bearing%line_y)
      end associate
      do while (get_resolved_frequency(part, simplified_limit) < simplified_limit &
         .and. max(part%length, part%width) > min_part)
         if (part%length > part%width) then
            part%length = 0.9_wp*part%length
            cycle
         end if
         ! Both sides of the width, with the positions across it.
         cut = 0.05_wp*part%width
         part%width = part%width - 2*cut
         do i = 1, size(part%plate)
            if (allocated(part%plate(i)%ribs)) call move(part%plate(i)%ribs%position)
         end do
         do i = 1, size(part%layer)
            if (allocated(part%layer(i)%line_y)) call move(part%layer(i)%line_y)
         end do
      end do
   contains

      !> Moves positions, without those beyond the new width.
      pure subroutine move(position)
         real(wp), allocatable, intent(inout) :: position(:)

         position = pack(position - cut, position > cut .and. position < cut + part%width)
      end subroutine move
   end function get_simplified

   !> Whether each mode of a stack has one number of half waves along the length, and one along the width: simply supported
   !> plates, with ribs and lines of springs along it: [2].
   pure function is_uncoupled(stack) result(yes)
      type(plate_stack_type), intent(in) :: stack
      logical :: yes(2)
      integer :: i

      yes = .true.
      do i = 1, size(stack%plate)
         yes = yes .and. [has_sines(stack%plate(i), 1), has_sines(stack%plate(i), 2)]
         if (allocated(stack%plate(i)%ribs)) yes(2) = .false.
      end do
      if (any([(allocated(stack%layer(i)%line_y), i=1, size(stack%plate) - 1)])) yes(2) = .false.
   end function is_uncoupled

   !> Whether the supports and ribs of a stack are symmetric along the length, and along the width: [2].
   pure function is_symmetric(stack) result(yes)
      type(plate_stack_type), intent(in) :: stack
      logical :: yes(2)
      integer :: i, k

      yes = .true.
      do i = 1, size(stack%plate)
         do k = 1, 2
            associate (edges => stack%plate(i)%edge(2*k - 1:2*k))
               yes(k) = yes(k) .and. size(get_lines(stack%plate(i), k)) == 0 &
                  .and. abs(edges(1)%deflection - edges(2)%deflection) <= 0.0_wp &
                  .and. abs(edges(1)%rotation - edges(2)%rotation) <= 0.0_wp
            end associate
         end do
         if (.not. allocated(stack%plate(i)%ribs)) cycle
         associate (position => stack%plate(i)%ribs%position)
            yes(2) = yes(2) .and. all(abs(position + position(size(position):1:-1) - stack%width) <= 1.0e-9_wp*stack%width)
         end associate
      end do
   end function is_symmetric

   !> Number of functions of x and of y that resolve the waves of a plate up to a frequency: [2].
   pure function get_counts(stack, plate, frequency) result(n)
      type(plate_stack_type), intent(in) :: stack
      type(orthotropic_type), intent(in) :: plate
      !> Frequency, Hz.
      real(wp), intent(in) :: frequency
      integer :: n(2)
      real(wp) :: sides(2), stiffness(2)
      ! More functions than any stack may have.
      real(wp), parameter :: many = 1.0e6_wp
      real(wp) :: half, inertia
      integer :: i

      sides = [stack%length, stack%width]
      stiffness = [plate%along, plate%across]
      inertia = plate%mass*(2*pi*frequency)**2
      do i = 1, 2
         associate (b => stiffness(i), s => plate%shear(i))
            if (s > 0.0_wp) then
               half = sides(i)/2*sqrt((inertia*b + sqrt((inertia*b)**2 + 4*b*s**2*inertia))/(2*b*s))
            else
               half = sides(i)/2*(inertia/b)**0.25_wp
            end if
         end associate
         half = min(half, many)
         if (has_sines(plate, i)) then
            n(i) = 4 + int(2*half/pi)
         else if (has_shear(plate)) then
            n(i) = get_degree(half)
         else
            ! Modes of a beam lack the coupling of both curvatures at free edges: some more.
            n(i) = 4 + int(beam_ratio*2*half/pi)
         end if
      end do
   end function get_counts

   !> Degree of the polynomials that resolve a wave: its Legendre coefficients end about there.
   elemental function get_degree(half) result(degree)
      !> Phase of the wave over half the length, rad.
      real(wp), intent(in) :: half
      integer :: degree

      degree = 8 + int(half + 4*half**(1.0_wp/3))
   end function get_degree

   !> Whether a plate yields in shear.
   elemental function has_shear(plate) result(yes)
      type(orthotropic_type), intent(in) :: plate
      logical :: yes

      yes = maxval(plate%shear) > 0.0_wp
   end function has_shear

   !> Whether both ends of a plate in one direction are simply supported, without further supports.
   pure function has_sines(plate, direction) result(yes)
      type(orthotropic_type), intent(in) :: plate
      !> 1: along the length, 2: along the width.
      integer, intent(in) :: direction
      logical :: yes

      associate (edges => plate%edge(2*direction - 1:2*direction))
         yes = all(edges%deflection >= rigid_support .and. edges%rotation <= 0.0_wp)
      end associate
      yes = yes .and. size(get_lines(plate, direction)) == 0
   end function has_sines

   !> Positions of the lines across a direction on which a plate rests, m: [n_line].
   pure function get_lines(plate, direction) result(position)
      type(orthotropic_type), intent(in) :: plate
      !> 1: along the length, 2: along the width.
      integer, intent(in) :: direction
      real(wp), allocatable :: position(:)

      allocate (position(0))
      if (direction == 1 .and. allocated(plate%line_x)) position = plate%line_x
      if (direction == 2 .and. allocated(plate%line_y)) position = plate%line_y
   end function get_lines

end module thud_plate_stack
