!> Level of an impact in the room below a floor, by transient statistical energy analysis in one-third-octave bands: the
!> force injects energy into the floor, the floor radiates into the room, and the Fast detector shows the level.
module thud_statistical_level
   use thud_ceiling, only: get_cavity_mode_density, get_forced_velocity_ratio, get_mass_law
   use thud_constants, only: pi
   use thud_energy_flow, only: connect, decay_of_60_db, energy_flow_type, get_entering_energies, get_fast_level, &
      new_energy_flow
   use thud_flanking, only: get_junction_rate, get_vibration_reduction, get_walls
   use thud_kinds, only: wp
   use thud_modal_radiation, only: modal_radiation_type
   use thud_plate, only: get_mode_density, get_plate_radiation, get_surface_mass, get_total_loss, plate_type
   use thud_room, only: box_type, finished_room, room_level_type, room_type
   implicit none (type, external)
   private

   public :: get_statistical_level

   !> Least ratio of the energies of the modes above the room to those of the modes beyond it.
   real(wp), parameter :: min_energy_ratio = 1.02_wp

contains

   !> Statistical level in the room, and what it follows from.
   !>
   !> The floor takes the energy E = integral 2 |F|**2 Re Y df in each band, with Re Y averaged over positions. The energy
   !> is injected instantaneously: a contact of 20 ms is short compared with the detector's time constant.
   subroutine get_statistical_level(plate, radiation, room, box, force_level, prediction)
      !> The plate that radiates.
      type(plate_type), intent(in) :: plate
      !> Its conductance, radiation factors and energy beyond the room, in the bands of a rating: [n_band].
      type(modal_radiation_type), intent(in) :: radiation(:)
      !> The room, and the same as a box.
      type(room_type), intent(in) :: room
      type(box_type), intent(in) :: box
      !> Force exposure levels of the force on the floor, dB: [n_band].
      real(wp), intent(in) :: force_level(:)
      !> All but what follows from modes.
      type(room_level_type), intent(out) :: prediction
      integer :: i, n_path

      prediction%bands = box%bands
      prediction%conductance = radiation%conductance
      prediction%surface_mass = get_surface_mass(plate)
      prediction%box = box
      prediction%energy = 10**(force_level/10)*radiation%conductance
      prediction%radiation_factor = radiation%radiation_factor
      prediction%loss_factor = get_total_loss(plate, room%air, prediction%bands%center, &
         (radiation%radiation_factor + radiation%upper_factor)/2)
      n_path = 1 + room%walls%lengths%count
      allocate (prediction%flow(size(radiation)), prediction%path_share(size(radiation), n_path))
      do i = 1, size(radiation)
         prediction%flow(i) = get_flow(plate, radiation(i), room, prediction, i)
         associate (entering => get_entering_energies(prediction%flow(i), n_path + 1), share => prediction%path_share(i, :))
            ! What else radiates, a ceiling's cavity, belongs to the floor.
            share = entering(:n_path)
            share(1) = share(1) + sum(entering(n_path + 1:))
            share = share/sum(share)
         end associate
      end do
      prediction%statistical_level = [(get_fast_level(prediction%flow(i:i)), i=1, size(radiation))]
      prediction%rated_level = spread(prediction%statistical_level, 2, 2)
   end subroutine get_statistical_level

   !> Energies of a band after the impact: floor, walls, room, ceiling cavity and the floor beyond the room, with the flows
   !> between them.
   !>
   !> A plate loses omega eta in total; it radiates rho0 c0 sigma/m'' into the room, and to the other side by the factor
   !> there. The room loses 6 ln 10/T, which contains the flow back into the plates in a finished room and excludes it in a
   !> bare one.
   !>
   !> Energy flows from the floor above the room to the floor beyond it at the rate that gives, with the losses of both and a
   !> steady force, their energies by the modes.
   !>
   !> With a ceiling of transmission t, a fraction of the floor's radiation reaches the room through the stiffness of the
   !> air. Of the rest, t**2 reaches the room directly and 1 - t**2 the cavity, from which sound leaves through the ceiling
   !> (Craik and Smith 2000). The cavity receives t (1 - t) of the sound that the room sends to the ceiling. A ceiling
   !> without mass, t = 1, has no effect.
   pure function get_flow(floor, radiation, room, prediction, band) result(flow)
      !> The whole floor.
      type(plate_type), intent(in) :: floor
      !> Its radiation in the band.
      type(modal_radiation_type), intent(in) :: radiation
      type(room_type), intent(in) :: room
      !> Prediction with dimensions, energies, loss factors and reverberation times.
      type(room_level_type), intent(in) :: prediction
      !> Index of the band.
      integer, intent(in) :: band
      type(energy_flow_type) :: flow
      type(plate_type) :: plate
      type(plate_type) :: plates(1 + room%walls%lengths%count)
      real(wp) :: radiated(size(plates))
      real(wp) :: decay, transmission, forced, free, beyond
      logical :: has_ceiling, lies_beyond, is_finished
      integer :: at_room, i

      ! The part above the room.
      plate = floor
      plate%length = min(prediction%box%sides(1), floor%length)
      plate%width = min(prediction%box%sides(2), floor%width)
      plates = [plate, get_walls(room%walls)]
      at_room = size(plates) + 1
      has_ceiling = room%ceiling%mass > 0.0_wp
      lies_beyond = plate%length*plate%width < floor%length*floor%width*(1 - 1.0e-9_wp)
      is_finished = room%reverberation_of == finished_room
      flow = new_energy_flow(at_room + count([has_ceiling, lies_beyond]))
      associate (third => prediction%bands(band), f => prediction%bands(band)%center, air => room%air, &
         ceiling => room%ceiling, area => plate%length*plate%width, last => size(flow%energy))
         radiated = air%density*air%sound_speed/get_surface_mass(plates) &
            *[radiation%radiation_factor, get_plate_radiation(plates(2:), air, f)]
         decay = decay_of_60_db/prediction%box%reverberation_time(band)
         flow%energy(1) = prediction%energy(band)
         flow%weight(at_room) = air%density*air%sound_speed**2/prediction%box%volume
         flow%mode_density(:at_room) = [get_mode_density(plates), 4*pi*prediction%box%volume*f**2/air%sound_speed**3]
         flow%total(:at_room) = [2*pi*f*[prediction%loss_factor(band), get_total_loss(plates(2:), air, f)], decay]
         flow%internal_loss(:at_room) = [2*pi*f*plates%loss_factor &
            + radiated*[radiation%upper_factor/radiation%radiation_factor, spread(1.0_wp, 1, size(plates) - 1)], &
            merge(0.0_wp, decay, is_finished)]
         if (has_ceiling) then
            transmission = get_mass_law(ceiling, air, f)
            forced = get_forced_velocity_ratio(ceiling, air, radiation%radiation_factor, third%lower, third%upper)
            free = max(1 - forced, 0.0_wp)
            associate (at_cavity => at_room + 1)
               flow%mode_density(at_cavity) = get_cavity_mode_density(ceiling, air, area, f)
               flow%internal_loss(at_cavity) = 2*pi*f*ceiling%loss_factor
               call connect(flow, 1, at_cavity, radiated(1)*free*(1 - transmission**2))
               call connect(flow, at_room, at_cavity, &
                  air%sound_speed*area*transmission*(1 - transmission)/(4*prediction%box%volume))
            end associate
            call connect(flow, 1, at_room, radiated(1)*(forced + free*transmission**2))
         else
            call connect(flow, 1, at_room, radiated(1))
         end if
         do i = 2, size(plates)
            call connect(flow, i, at_room, radiated(i))
            call connect(flow, 1, i, get_junction_rate(plate, plates(i), air, &
               get_vibration_reduction(room%walls, plate, plates(i), i - 1), f))
         end do
         if (lies_beyond) then
            associate (loss => 2*pi*f*prediction%loss_factor(band), above => flow%mode_density(1), &
               ratio => radiation%energy_beyond)
               ! At most almost equal energies of all modes: with few modes, more energy may lie beyond the room.
               flow%mode_density(last) = max(get_mode_density(floor) - above, min_energy_ratio*ratio*above)
               flow%internal_loss(last) = loss
               beyond = loss*ratio/(1 - ratio*above/flow%mode_density(last))
               call connect(flow, 1, last, beyond)
               flow%total(1) = flow%total(1) + beyond
            end associate
         end if
         ! The decay of a finished room contains what it loses to floor and walls.
         if (is_finished) then
            associate (leaving => flow%rate(:, at_room))
               leaving = leaving*min(1.0_wp, decay/max(sum(leaving), tiny(decay)))
            end associate
         end if
      end associate
   end function get_flow

end module thud_statistical_level
