!> Band energies of many records at once, by matrix products.
!>
!> The energy of a record in a band is an integral of its squared spectrum, here a sum over Gauss-Legendre nodes. The spectra
!> of records of length T at the nodes of all bands lie in a space of few dimensions: some 20 more than 2 W T with the
!> highest frequency W (Slepian 1978). The singular value decomposition of the waves at the nodes finds sequences that span
!> it; a record is projected on them once for all bands. Symmetric and antisymmetric sequences halve the work, because
!> records are folded first.
!>
!> The omitted sequences change the square root of a band's energy by at most `max_omitted` times the norm of the record.
module thud_band_projection
   use thud_band, only: band_type
   use thud_constants, only: pi
   use thud_kinds, only: wp
   use thud_lapack, only: dgesvd
   use thud_legendre, only: get_gauss_legendre
   use thud_matrix_product, only: get_product
   implicit none (type, external)
   private

   public :: band_projection_type, get_band_energies, get_window_index, get_window_length, new_band_projection

   !> Sequences whose singular value is at most this fraction of the largest are omitted.
   real(wp), parameter :: max_omitted = 1.0e-11_wp

   !> Maximum product of the number of samples and the squared number of nodes, which takes some two seconds. More would pay
   !> only for thousands of records.
   real(wp), parameter :: max_work = 1.0e9_wp

   !> Records are padded with zeros to one of a few lengths, their window. Number of windows per doubling of the length: a
   !> window is at most 1/11 longer than needed.
   real(wp), parameter :: windows_per_octave = 8.0_wp

   !> Shortest window, samples.
   real(wp), parameter :: shortest_window = 16.0_wp

   !> A space of symmetric or antisymmetric sequences, by their first halves.
   type :: space_type
      !> Orthonormal sequences: [n_sample/2, n_sequence].
      real(wp), allocatable :: sequences(:, :)
      !> Their spectra at the nodes, times the square root of the weight: [n_sequence, n_node].
      real(wp), allocatable :: spectra(:, :)
   end type space_type

   !> Matrices for records of one length, one sampling rate and one choice of bands.
   type :: band_projection_type
      !> Samples of a record, even.
      integer :: n_sample = 0
      !> Symmetric and antisymmetric sequences.
      type(space_type) :: even, odd
      !> Index of the last node of each band: [n_band].
      integer, allocatable :: last_node(:)
   end type band_projection_type

contains

   !> Index, from 1, of the shortest window that holds the samples of a record.
   elemental function get_window_index(n_sample) result(window)
      !> Samples of the record.
      integer, intent(in) :: n_sample
      integer :: window

      window = 1 + ceiling(windows_per_octave*log(max(1.0_wp, n_sample/shortest_window))/log(2.0_wp))
   end function get_window_index

   !> Length of a window.
   elemental function get_window_length(window) result(n_sample)
      !> Index of the window, from 1.
      integer, intent(in) :: window
      !> Samples, even.
      integer :: n_sample

      n_sample = 2*ceiling(shortest_window/2*2.0_wp**((window - 1)/windows_per_octave))
   end function get_window_length

   !> Matrices for a length, a sampling rate and bands.
   subroutine new_band_projection(n_sample, sample_rate, bands, projection)
      !> Samples of the records, even.
      integer, intent(in) :: n_sample
      !> Samples per second, Hz; at least twice the highest edge.
      real(wp), intent(in) :: sample_rate
      !> The bands: [n_band].
      type(band_type), intent(in) :: bands(:)
      !> The matrices; n_sample = 0 if they would take too long, or LAPACK does not find the sequences.
      type(band_projection_type), intent(out) :: projection
      real(wp), allocatable :: node(:), weight(:), angle(:, :), waves(:, :)
      integer :: count(size(bands))
      integer :: i
      logical :: failed(2)

      ! |F|**2 is a sum of cos(a x + b) over [-1, 1] with a up to pi times width times duration; with so many nodes the error
      ! of each is below 2e-14.
      count = ceiling(10 + 0.7_wp*pi*(bands%upper - bands%lower)*n_sample/sample_rate)
      if (n_sample*real(sum(count), wp)**2 > max_work) return
      projection%last_node = [(sum(count(:i)), i=1, size(bands))]
      allocate (node(sum(count)), weight(sum(count)))
      do i = 1, size(bands)
         associate (width => bands(i)%upper - bands(i)%lower, middle => (bands(i)%upper + bands(i)%lower)/2, &
            first => projection%last_node(i) - count(i) + 1, last => projection%last_node(i))
            call get_gauss_legendre(node(first:last), weight(first:last))
            node(first:last) = middle + width/2*node(first:last)
            ! For both signs of the frequency together.
            weight(first:last) = sqrt(width*weight(first:last))/sample_rate
         end associate
      end do
      ! Angles from the middle of the record.
      allocate (angle(n_sample/2, size(node)))
      do i = 1, n_sample/2
         angle(i, :) = 2*pi/sample_rate*(i - (n_sample + 1)/2.0_wp)*node
      end do
      waves = cos(angle)*spread(weight, 1, n_sample/2)
      call find_space(waves, projection%even, failed(1))
      waves = sin(angle)*spread(weight, 1, n_sample/2)
      call find_space(waves, projection%odd, failed(2))
      if (.not. any(failed)) projection%n_sample = n_sample
   end subroutine new_band_projection

   !> The sequences that span weighted waves, by decreasing energy.
   subroutine find_space(waves, space, failed)
      !> First halves of cosines or sines at the nodes, destroyed: [n_half, n_node].
      real(wp), intent(inout) :: waves(:, :)
      type(space_type), intent(out) :: space
      !> LAPACK does not find them.
      logical, intent(out) :: failed
      real(wp) :: values(minval(shape(waves))), work(5*sum(shape(waves)))
      integer :: info, n

      n = size(values)
      allocate (space%sequences(size(waves, 1), n), space%spectra(n, size(waves, 2)))
      call dgesvd('S', 'S', size(waves, 1), size(waves, 2), waves, size(waves, 1), values, space%sequences, size(waves, 1), &
         space%spectra, n, work, size(work), info)
      failed = info /= 0
      if (failed) return
      n = count(values > max_omitted*values(1))
      space%sequences = space%sequences(:, :n)
      space%spectra = spread(values(:n), 2, size(waves, 2))*space%spectra(:n, :)
   end subroutine find_space

   !> Energies of records in bands.
   subroutine get_band_energies(projection, record, energy, square_sum)
      !> Matrices for the length of the records.
      type(band_projection_type), intent(in) :: projection
      !> The records, N: [n_record, at least n_sample].
      real(wp), intent(in) :: record(:, :)
      !> Energies, N^2 s: [n_record, n_band].
      real(wp), intent(out) :: energy(:, :)
      !> Sums of the squared samples, N^2: [n_record].
      real(wp), intent(out) :: square_sum(:)
      integer :: i

      energy = 0.0_wp
      call add_energies(1.0_wp, projection%even)
      call add_energies(-1.0_wp, projection%odd)
      square_sum = 0.0_wp
      do i = 1, projection%n_sample
         square_sum = square_sum + record(:, i)**2
      end do

   contains

      !> Adds the energies of the symmetric or antisymmetric parts of the records.
      subroutine add_energies(sign, space)
         !> 1 for symmetric sequences, -1 for antisymmetric ones.
         real(wp), intent(in) :: sign
         type(space_type), intent(in) :: space
         real(wp), allocatable :: folded(:, :), spectrum(:, :)
         integer :: band, first, j

         allocate (folded(size(record, 1), projection%n_sample/2))
         do j = 1, size(folded, 2)
            folded(:, j) = record(:, j) + sign*record(:, projection%n_sample + 1 - j)
         end do
         spectrum = get_product(get_product(folded, space%sequences), space%spectra)
         first = 1
         do band = 1, size(energy, 2)
            do j = first, projection%last_node(band)
               energy(:, band) = energy(:, band) + spectrum(:, j)**2
            end do
            first = projection%last_node(band) + 1
         end do
      end subroutine add_energies

   end subroutine get_band_energies

end module thud_band_projection
