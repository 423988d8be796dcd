!> The table of quantities: every number of a result can have, with its symbol, unit, meaning and display format. Summary,
!> tables and schema use this table, and so does the Python package through the schema.
module thud_quantities
   use thud_force_history, only: force_history_type
   use thud_kinds, only: wp
   implicit none (type, external)
   private

   public :: get_quantities, get_quantity, history_quantity_count, quantities, quantity_type, sample_quantity_count

   !> A number that a result can have.
   type :: quantity_type
      !> Name in files and programs.
      character(len=24) :: name = ''
      !> Name in tables for readers.
      character(len=24) :: title = ''
      !> Symbol in formulas and figures, in matplotlib's math notation.
      character(len=20) :: symbol = ''
      !> SI unit, blank for pure numbers.
      character(len=8) :: unit = ''
      !> Unit on the screen.
      character(len=8) :: display_unit = ''
      !> Number of display units in one SI unit.
      real(wp) :: display_scale = 1.0_wp
      !> Decimals on the screen.
      integer :: decimals = 3
      !> Meaning.
      character(len=72) :: meaning = ''
      !> Which results have this quantity: `of_sample`, `of_impact` or `of_others`.
      integer :: results = 0
   end type quantity_type

   !> Every impact, including the samples of a sweep.
   integer, parameter :: of_sample = 1
   !> Every impact, but not the samples of a sweep.
   integer, parameter :: of_impact = 2
   !> Other results only.
   integer, parameter :: of_others = 3

   !> The quantities: first those of samples, then those of impacts, in the order of `get_quantities`, then all others.
   type(quantity_type), parameter :: quantities(*) = [ &
      quantity_type('contact_time', 'contact time', 'T', 's', 'ms', 1.0e3_wp, 2, 'contact time', of_sample), &
      quantity_type('peak_force', 'peak force', 'F_{max}', 'N', 'N', 1.0_wp, 0, 'maximum force on the floor', of_sample), &
      quantity_type('peak_elastic_force', 'peak elastic force', 'F_{E,max}', 'N', 'N', 1.0_wp, 0, &
      'maximum elastic force', of_sample), &
      quantity_type('max_deflection', 'peak deflection', 'd_{max}', 'm', 'mm', 1.0e3_wp, 2, &
      'maximum deflection', of_sample), &
      quantity_type('restitution', 'restitution', 'e', '', '', 1.0_wp, 3, 'coefficient of restitution', of_sample), &
      quantity_type('impulse', 'impulse', 'I', 'N s', 'N s', 1.0_wp, 2, &
      'time integral of the force on the floor', of_sample), &
      quantity_type('impact_velocity', 'impact velocity', 'v_0', 'm/s', 'm/s', 1.0_wp, 3, &
      'velocity at first touch', of_impact), &
      quantity_type('exact_contact_time', 'exact contact time', 'T', 's', 'ms', 1.0e3_wp, 3, &
      'contact time, resolved between time steps', of_impact), &
      quantity_type('touch_time', 'time of first touch', 't_0', 's', 'ms', 1.0e3_wp, 3, &
      'time of first touch in the record', of_impact), &
      quantity_type('sample_rate', 'sample rate', 'f_s', 'Hz', 'kHz', 1.0e-3_wp, 3, 'samples per second', of_impact), &
      quantity_type('impulse_residual', 'impulse residual', '', '', '', 1.0_wp, 6, &
      'relative residual of the momentum balance', of_impact), &
      quantity_type('energy_residual', 'energy residual', '', '', '', 1.0_wp, 6, &
      'relative residual of the energy balance', of_impact), &
      quantity_type('octave_31_5_error', 'error at 31.5 Hz', '', 'dB', 'dB', 1.0_wp, 2, &
      'numerical error of the level of the 31.5 Hz octave', of_impact), &
      quantity_type('octave_63_error', 'error at 63 Hz', '', 'dB', 'dB', 1.0_wp, 2, &
      'numerical error of the level of the 63 Hz octave', of_impact), &
      quantity_type('octave_125_error', 'error at 125 Hz', '', 'dB', 'dB', 1.0_wp, 2, &
      'numerical error of the level of the 125 Hz octave', of_impact), &
      quantity_type('octave_250_error', 'error at 250 Hz', '', 'dB', 'dB', 1.0_wp, 2, &
      'numerical error of the level of the 250 Hz octave', of_impact), &
      quantity_type('octave_500_error', 'error at 500 Hz', '', 'dB', 'dB', 1.0_wp, 2, &
      'numerical error of the level of the 500 Hz octave', of_impact), &
      quantity_type('contact_time_error', 'error of contact time', '', 's', 'ms', 1.0e3_wp, 3, &
      'numerical error of the contact time', of_impact), &
      quantity_type('restitution_error', 'error of restitution', '', '', '', 1.0_wp, 4, &
      'numerical error of the coefficient of restitution', of_impact), &
      quantity_type('peak_force_error', 'error of peak force', '', 'N', 'N', 1.0_wp, 1, &
      'numerical error of the maximum force on the floor', of_impact), &
      quantity_type('peak_count', 'force peaks', '', '', '', 1.0_wp, 0, &
      'number of peaks of the assessed force', of_others), &
      quantity_type('mass', 'mass', 'M', 'kg', 'kg', 1.0_wp, 3, 'mass of the source', of_others), &
      quantity_type('drop_height', 'drop height', 'h', 'm', 'm', 1.0_wp, 3, 'drop height', of_others), &
      quantity_type('effective_mass', 'effective mass', 'M', 'kg', 'kg', 1.0_wp, 3, &
      'impulse divided by the change of velocity', of_others), &
      quantity_type('margin', 'margin', '', 'dB', 'dB', 1.0_wp, 2, &
      'minimum distance of the assessed octave levels to limits, > 0 inside', of_others), &
      quantity_type('floor_work', 'energy to the floor', 'W', 'J', 'mJ', 1.0e3_wp, 1, &
      'energy that the source gives to the floor', of_others), &
      quantity_type('room_rating', 'level in the room', 'L_{iA,Fmax}', 'dB', 'dB', 1.0_wp, 1, &
      'A-weighted maximum Fast level in the room, re 20 uPa', of_others), &
      quantity_type('standardized_rating', 'standardized level', "L'_{iA,Fmax,V,T}", 'dB', 'dB', 1.0_wp, 1, &
      'A-weighted maximum Fast level, standardized, re 20 uPa', of_others)]

   !> Number of quantities of a sample of a sweep.
   integer, parameter :: sample_quantity_count = count(quantities%results == of_sample)
   !> Number of quantities of an impact, which has those of a sample too.
   integer, parameter :: history_quantity_count = count(quantities%results <= of_impact)

contains

   !> Values of the quantities of an impact, SI units, NaN for unknown errors: [history_quantity_count].
   function get_quantities(history) result(values)
      type(force_history_type), intent(in) :: history
      real(wp) :: values(history_quantity_count)

      values = [history%contact_time, history%peak_force, history%peak_elastic_force, history%max_deflection, &
         history%restitution, history%impulse, history%impact_velocity, &
         history%exact_contact_time, history%touch_time, history%sample_rate, history%impulse_residual, &
         history%energy_residual, history%numerical_error%octave, history%numerical_error%contact_time, &
         history%numerical_error%restitution, history%numerical_error%peak_force]
   end function get_quantities

   !> A quantity of the table by its name.
   pure function get_quantity(name) result(quantity)
      !> Name of a quantity in the table.
      character(len=*), intent(in) :: name
      type(quantity_type) :: quantity

      quantity = quantities(findloc(quantities%name == name, .true., dim=1))
   end function get_quantity

end module thud_quantities
