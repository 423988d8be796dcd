!> Band energies of many records at once, by two matrix products.
!>
!> The energy of a record f in a band is f'Qf with the sinc kernel Q of the band (see `thud_force_exposure`). All bands lie
!> below one frequency W. The eigenvectors of the kernel of all frequencies below W are the discrete prolate spheroidal
!> sequences (Slepian 1978). Only about 2 W T of them have significant eigenvalues for records of length T. The kernel
!> commutes with a tridiagonal matrix: both have the same eigenvectors, and the matrix gives them quickly and without
!> cancellation. A record
!> is projected on the sequences once for all bands; the spectrum of the projection at Gauss-Legendre nodes gives the
!> energies. The sequences are symmetric or antisymmetric, so records are folded first, which halves the work.
!>
!> The omitted sequences change the square root of a band's energy by at most sqrt(max_omitted_energy) times the norm of the
!> record; the error of the quadrature is below `quadrature_error`.
module thud_band_projection
   use thud_band, only: band_type
   use thud_constants, only: pi
   use thud_kinds, only: wp
   use thud_lapack, only: dgemm, dstevr
   use thud_legendre, only: get_gauss_legendre
   implicit none (type, external)
   private

   public :: band_projection_type, get_band_energies, get_window_length, get_window_index, is_projection_fast, &
      new_band_projection

   !> The last sequences are omitted: those whose energy in all bands together is at most this fraction of the maximum
   !> energy of a sequence.
   real(wp), parameter :: max_omitted_energy = 1.0e-22_wp

   !> Error of a quadrature over a band, relative to the maximum of its integrand.
   real(wp), parameter :: quadrature_error = 1.0e-17_wp

   !> Number of sequences computed in addition to 2 W T. This is enough: `max_omitted_energy` is reached
   !> after 12 to 20 of them.
   integer, parameter :: margin = 32

   !> Maximum product of the number of samples and the squared number of sequences, which takes some two seconds. More
   !> would pay only for thousands of records.
   real(wp), parameter :: max_work = 5.0e8_wp

   !> Records are padded with zeros to one of a few lengths, their window. Number of windows per doubling of the length: a
   !> window is at most 1/11 longer than needed.
   integer, parameter :: windows_per_octave = 8

   !> Shortest window, samples.
   integer, parameter :: shortest_window = 16

   !> Matrices for records of one length, one sampling rate and one choice of bands.
   type :: band_projection_type
      !> Samples of a record, even.
      integer :: n_sample = 0
      !> First halves of the symmetric sequences: [n_sample/2, n_even].
      real(wp), allocatable :: even(:, :)
      !> First halves of the antisymmetric sequences: [n_sample/2, n_odd].
      real(wp), allocatable :: odd(:, :)
      !> Spectra of the symmetric sequences at the nodes, times the square root of the weight: [n_even, n_node].
      real(wp), allocatable :: cosine(:, :)
      !> Spectra of the antisymmetric sequences, likewise: [n_odd, n_node].
      real(wp), allocatable :: sine(:, :)
      !> Index of the last node of each band: [n_band].
      integer, allocatable :: last_node(:)
   end type band_projection_type

contains

   !> Index, from 1, of the shortest window that holds the samples of a record.
   elemental function get_window_index(n_sample) result(window)
      !> Samples of the record.
      integer, intent(in) :: n_sample
      integer :: window

      window = 1
      if (n_sample <= shortest_window) return
      window = floor(windows_per_octave*log(real(n_sample, wp)/shortest_window)/log(2.0_wp)) + 1
      ! Lengths are rounded: the next window may be the right one.
      if (get_window_length(window) < n_sample) window = window + 1
   end function get_window_index

   !> Length of a window.
   elemental function get_window_length(window) result(n_sample)
      !> Index of the window, from 1.
      integer, intent(in) :: window
      !> Samples, even.
      integer :: n_sample

      n_sample = 2*nint(shortest_window/2*2.0_wp**(real(window - 1, wp)/windows_per_octave))
   end function get_window_length

   !> Whether the matrices for records of this length can be computed quickly; only then to project is worthwhile.
   pure function is_projection_fast(n_sample, sample_rate, bands) result(fast)
      !> Samples of the records.
      integer, intent(in) :: n_sample
      !> Samples per second, Hz.
      real(wp), intent(in) :: sample_rate
      !> The bands: [n_band].
      type(band_type), intent(in) :: bands(:)
      logical :: fast

      fast = n_sample*real(get_rank(n_sample, maxval(bands%upper)/sample_rate), wp)**2 <= max_work
   end function is_projection_fast

   !> Number of sequences to compute.
   pure function get_rank(n_sample, half_width) result(rank)
      integer, intent(in) :: n_sample
      !> W divided by the sampling rate.
      real(wp), intent(in) :: half_width
      integer :: rank

      rank = min(n_sample, int(2*n_sample*half_width) + margin)
   end function get_rank

   !> Matrices for a length, a sampling rate and bands.
   subroutine new_band_projection(n_sample, sample_rate, bands, projection)
      !> Samples of the records, even.
      integer, intent(in) :: n_sample
      !> Samples per second, Hz; at least twice the highest edge.
      real(wp), intent(in) :: sample_rate
      !> The bands: [n_band].
      type(band_type), intent(in) :: bands(:)
      !> The matrices; n_sample = 0 if LAPACK does not find the sequences.
      type(band_projection_type), intent(out) :: projection
      real(wp), allocatable :: node(:), root_weight(:), spectrum_weight(:), angle(:, :)
      integer :: i

      call set_sequences(projection, n_sample, maxval(bands%upper)/sample_rate)
      if (projection%n_sample == 0) return
      call get_nodes(bands, real(n_sample, wp)/sample_rate, node, root_weight, projection%last_node)
      ! Angles from the middle of the record.
      allocate (angle(n_sample/2, size(node)))
      do i = 1, n_sample/2
         angle(i, :) = 2*pi/sample_rate*(i - (n_sample + 1)/2.0_wp)*node
      end do
      ! The factor 2 adds the other half of a sequence.
      spectrum_weight = 2*root_weight/sample_rate
      call get_spectra(projection%even, cos(angle), spectrum_weight, projection%cosine)
      call get_spectra(projection%odd, sin(angle), spectrum_weight, projection%sine)
      call omit_sequences(projection%even, projection%cosine)
      call omit_sequences(projection%odd, projection%sine)
   end subroutine new_band_projection

   !> The sequences: eigenvectors of Slepian's tridiagonal matrix.
   subroutine set_sequences(projection, n, half_width)
      !> The matrices; n_sample stays 0 if LAPACK does not find the sequences.
      type(band_projection_type), intent(inout) :: projection
      !> Samples of the records, even.
      integer, intent(in) :: n
      real(wp), intent(in) :: half_width
      real(wp), dimension(n) :: diagonal, off_diagonal, values
      real(wp) :: work(20*n)
      real(wp), allocatable :: vectors(:, :)
      integer :: support(2*n), integer_work(10*n)
      integer :: i, rank, n_value, status

      rank = get_rank(n, half_width)
      diagonal = [(((n - 1 - 2*i)/2.0_wp)**2*cos(2*pi*half_width), i=0, n - 1)]
      off_diagonal = [(real(i, wp)*(n - i)/2, i=1, n)]
      allocate (vectors(n, rank))
      call dstevr('V', 'I', n, diagonal, off_diagonal, 0.0_wp, 0.0_wp, n - rank + 1, n, 0.0_wp, n_value, values, vectors, &
         n, support, work, size(work), integer_work, size(integer_work), status)
      if (status /= 0 .or. n_value /= rank) return
      projection%n_sample = n
      ! The largest eigenvalue belongs to the first sequence, which is symmetric; then the symmetry alternates.
      vectors = vectors(:, rank:1:-1)
      projection%even = (vectors(:n/2, 1::2) + vectors(n:n/2 + 1:-1, 1::2))/2
      projection%odd = (vectors(:n/2, 2::2) - vectors(n:n/2 + 1:-1, 2::2))/2
   end subroutine set_sequences

   !> Nodes of the quadrature over each band.
   subroutine get_nodes(bands, duration, node, root_weight, last_node)
      type(band_type), intent(in) :: bands(:)
      !> Length of the record, s.
      real(wp), intent(in) :: duration
      !> Frequencies, Hz: [n_node].
      real(wp), allocatable, intent(out) :: node(:)
      !> Square roots of the weights of |F|**2, for both signs of the frequency together: [n_node].
      real(wp), allocatable, intent(out) :: root_weight(:)
      !> Index of the last node of each band: [n_band].
      integer, allocatable, intent(out) :: last_node(:)
      integer :: count(size(bands))
      integer :: i

      count = get_node_count(pi*(bands%upper - bands%lower)*duration)
      last_node = [(sum(count(:i)), i=1, size(bands))]
      allocate (node(sum(count)), root_weight(sum(count)))
      do i = 1, size(bands)
         associate (width => bands(i)%upper - bands(i)%lower, middle => (bands(i)%upper + bands(i)%lower)/2, &
            first => last_node(i) - count(i) + 1, last => last_node(i))
            call get_gauss_legendre(node(first:last), root_weight(first:last))
            node(first:last) = middle + width/2*node(first:last)
            root_weight(first:last) = sqrt(width*root_weight(first:last))
         end associate
      end do
   end subroutine get_nodes

   !> Number of Gauss-Legendre nodes that integrate cos(a x + b) over [-1, 1] to `quadrature_error`: |F|**2 is a
   !> sum of such functions. The remainder with N nodes is at most a**(2N) 2**(2N + 1) (N!)**4
   !> / ((2N + 1) ((2N)!)**3).
   elemental function get_node_count(a) result(count)
      !> Maximum angle a.
      real(wp), intent(in) :: a
      integer :: count
      real(wp) :: logarithm

      count = 0
      do
         count = count + 1
         logarithm = 2*count*log(a) + (2*count + 1)*log(2.0_wp) + 4*log_gamma(count + 1.0_wp) &
            - log(2*count + 1.0_wp) - 3*log_gamma(2*count + 1.0_wp)
         if (logarithm < log(quadrature_error)) exit
      end do
   end function get_node_count

   !> Spectra of sequences at the nodes.
   subroutine get_spectra(sequences, waves, weight, spectra)
      !> Halves of the sequences: [n_half, n_sequence].
      real(wp), intent(in) :: sequences(:, :)
      !> Cosines or sines: [n_half, n_node].
      real(wp), intent(in) :: waves(:, :)
      !> Weights of the nodes: [n_node].
      real(wp), intent(in) :: weight(:)
      !> Weighted spectra: [n_sequence, n_node].
      real(wp), allocatable, intent(out) :: spectra(:, :)
      integer :: i

      spectra = matmul(transpose(sequences), waves)
      do i = 1, size(weight)
         spectra(:, i) = weight(i)*spectra(:, i)
      end do
   end subroutine get_spectra

   !> Removes the last sequences, which have nearly no energy in the bands.
   subroutine omit_sequences(sequences, spectra)
      !> Halves of the sequences: [n_half, n_sequence].
      real(wp), allocatable, intent(inout) :: sequences(:, :)
      !> Their weighted spectra: [n_sequence, n_node].
      real(wp), allocatable, intent(inout) :: spectra(:, :)
      real(wp) :: energy(size(spectra, 1))
      integer :: count

      energy = sum(spectra**2, dim=2)
      count = findloc(energy > max_omitted_energy*maxval(energy), .true., dim=1, back=.true.)
      sequences = sequences(:, :count)
      spectra = spectra(:count, :)
   end subroutine omit_sequences

   !> Energies of records in bands.
   subroutine get_band_energies(projection, n_record, record, folded, energy, square_sum)
      !> Matrices for the length of the records.
      type(band_projection_type), intent(in) :: projection
      integer, intent(in) :: n_record
      !> The records, N: [n_record, n_sample].
      real(wp), intent(in) :: record(n_record, projection%n_sample)
      !> Workspace: [n_record, n_sample].
      real(wp), intent(inout) :: folded(n_record, projection%n_sample)
      !> Energies, N^2 s: [n_record, n_band].
      real(wp), intent(out) :: energy(n_record, size(projection%last_node))
      !> Sums of the squared samples, N^2: [n_record].
      real(wp), intent(out) :: square_sum(n_record)
      real(wp) :: spectrum(n_record, size(projection%cosine, 2))
      integer :: half, i, band, first

      half = projection%n_sample/2
      square_sum = 0.0_wp
      do i = 1, half
         associate (front => record(:, i), back => record(:, 2*half + 1 - i))
            folded(:, i) = front + back
            folded(:, half + i) = front - back
            square_sum = square_sum + front**2 + back**2
         end associate
      end do
      energy = 0.0_wp
      call project(n_record, folded, projection%even, projection%cosine, spectrum)
      call add_squares()
      call project(n_record, folded(:, half + 1:), projection%odd, projection%sine, spectrum)
      call add_squares()

   contains

      !> Adds the squared spectra of each band.
      subroutine add_squares()
         first = 1
         do band = 1, size(projection%last_node)
            do i = first, projection%last_node(band)
               energy(:, band) = energy(:, band) + spectrum(:, i)**2
            end do
            first = projection%last_node(band) + 1
         end do
      end subroutine add_squares

   end subroutine get_band_energies

   !> Weighted spectra of folded records.
   subroutine project(n_record, folded, sequences, sequence_spectra, record_spectra)
      integer, intent(in) :: n_record
      real(wp), intent(in) :: sequences(:, :)
      !> Weighted spectra of the sequences: [n_sequence, n_node].
      real(wp), intent(in) :: sequence_spectra(:, :)
      !> Folded records: [n_record, n_half].
      real(wp), intent(in) :: folded(n_record, size(sequences, 1))
      !> Weighted spectra of the records: [n_record, n_node].
      real(wp), intent(inout) :: record_spectra(n_record, size(sequence_spectra, 2))
      real(wp) :: coefficient(n_record, size(sequences, 2))

      associate (half => size(sequences, 1), rank => size(sequences, 2))
         call dgemm('N', 'N', n_record, rank, half, 1.0_wp, folded, n_record, sequences, half, 0.0_wp, coefficient, &
            n_record)
         call dgemm('N', 'N', n_record, size(sequence_spectra, 2), rank, 1.0_wp, coefficient, n_record, sequence_spectra, &
            rank, 0.0_wp, record_spectra, n_record)
      end associate
   end subroutine project

end module thud_band_projection
