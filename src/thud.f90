!> All that a Fortran program needs from thud: a case or a single source model, the force, its levels, the verdict.
module thud
   use thud_ball, only: ball_type, drop_type, get_density, get_impact_velocity
   use thud_band, only: band_type, get_bands, octave_count, octaves
   use thud_case, only: case_type, check_case, get_model_number, new_case
   use thud_case_text, only: get_case_text, read_case
   use thud_compression, only: compression_options_type, compression_type
   use thud_compute, only: assessment_type, compute, impact_type, is_conforming, results_type, scope_type
   use thud_constants, only: version
   use thud_error, only: error_type
   use thud_finite_element, only: finite_element_modulus, finite_element_type
   use thud_force_exposure, only: get_force_exposure_levels, level_methods
   use thud_force_history, only: force_history_type
   use thud_free_modes, only: free_modes_type, get_free_modes, modes_options_type
   use thud_hollow_sphere, only: hollow_sphere_modulus, hollow_sphere_type
   use thud_hunt_crossley, only: hunt_crossley_type
   use thud_kinds, only: wp
   use thud_measured_modes, only: measured_modes_type
   use thud_modal_ball, only: modal_ball_modulus, modal_ball_type
   use thud_refined_drop, only: solve_drop
   use thud_registry, only: model_names
   use thud_run, only: load_case
   use thud_sampling, only: sampling_type
   use thud_source_limits, only: combine_verdicts, conforms, criterion_type, get_criteria, get_peak_count, get_verdict, &
      source_names, verdict_conforms, verdict_fails, verdict_names, verdict_undecided
   use thud_source_model, only: source_model_type
   use thud_two_mass, only: two_mass_type
   implicit none (type, external)
   public

end module thud
