"""The words of all notes: one sentence for each code, with the values of `thud.base.note.Note`."""

# Of refusals and of notes of the library, whose words are made where they arise
# (src/case/warnings.f90): the name of an argument, or of group and key, and what is said of it.
LIBRARY = "{name} {text}"

# What was done with a signal.
PROCESSING = {
    # Fits.
    "unknowns_included": "unknown, in the intervals: {unknowns}; noise alone: {errors}",
    "not_visible": "not in the intervals, and not visible: {cause} changes {changes}",
    "widened": "intervals widened {value:.3g} times, see the warnings",
    # Surrogates.
    "surrogate": "{accuracy}",
    "undecided": "{accuracy}; it leaves {value:.0f} of {high:.0f} verdicts undecided",
    # Reading of files.
    "sign_stated": "the sign was changed: polarity = '{polarity}'",
    "sign_changed": "the sign was changed: the largest peak, {value:.4g} {unit}, is negative",
    "cells_added": "the forces of {value:g} load cells were added",
    "rate_replaced": "the rate, {of_file:.7g} {unit}, was replaced by {value:.7g} {unit} as stated",
    "unit_replaced": "the unit of the file, {of_file}, was replaced by {unit} as stated",
    "unit_assumed": "the file states no unit; the values are assumed to be in {unit}",
    "unit_of_calibration": "the file states no unit; by the calibration the values are in {unit}",
    "unit_of_data_type": "no unit is stated: a data set of forces, in units of {value:.6g} {unit}",
    "factor_not_applied": "{factor} of the file was not applied; the calibration replaces it",
    "times_rounded": "times up to {value:.1g} {unit} off were replaced by a grid of {rate:.7g} Hz",
    # Records of a known force; the uncertainty is a standard uncertainty.
    "droop_removed": "droop with a time constant of {value:.4g} {unit}, standard uncertainty "
    "{uncertainty:.2%}, was removed",
    "no_droop": "no droop: a time constant above {low:.2g} {unit}",
    # Background.
    "offset_removed": "an offset of {value:.3g} {unit} was removed",
    "drift_removed": "a drift of {value:.3g} {unit} was removed",
    "hum_removed": "hum of {frequency:g} Hz, amplitude {value:.3g} {unit}, was removed",
    "tone_removed": "a tone of {frequency:.4g} Hz, amplitude {value:.3g} {unit}, was removed",
    "noise_remains": "noise of {value:.3g} {unit} remains",
    "plate_corrected": "force plate: resonance of {value:.5g} {unit}, quality {quality:g}, "
    "corrected up to {high:.5g} {unit}; noise there times {gain:.2g}",
    "filter_corrected": "{kind} filter of order {order:g}, −3 dB at {value:.5g} {unit}, corrected "
    "up to {high:.5g} {unit}",
    "section_searched": "searched for drops from {low:g} {unit} to {high:g} {unit} only",
    "drop_left_out": "left out: drop {value:list} at {time:.2f} s, {reason}",
    "drop_not_chosen": "left out: drop {value:list} at {time:.2f} s, only {chosen} were chosen",
    "drop_too_small": "left out: drop {value:list} at {time:.2f} s, whose peak of {peak:.0f} N is "
    "below {fraction:g} of the highest; if it is a drop, choose its number (--drops, drops)",
    "bounce_ignored": "a bounce of an earlier drop at {time:.2f} s is no drop and has no number",
    "pulse_ignored": "a pulse of {value:.0f} N at {time:.2f} s is no drop and has no number",
    # Samples, and drops over what is not known of a source.
    "drops_varied": "{drops:g} drops, {lost:g} without results; range: minimum and maximum, "
    "without numerical error; probability: Wilson interval (95 %); not known: {names}",
    "unknown_range": "{low:g} to {high:g} {unit} ({reason})",
    "keys_fixed": "fixed by the case: {names}",
    "conforms_by_calibration": "the ball conforms by its calibration, not by this result",
    "no_numerical_errors": "samples state no numerical errors; the run of a single case does",
}

# What may be wrong.
WARNINGS = {
    # Signals of files.
    "peak_unusual": "the peak is {value:.4g} {unit}; usual are {low:g} to {high:g} {unit}",
    "polarity_doubtful": "peaks of {opposite:.4g} and {value:.4g} {unit}: check the polarity",
    "forces_left_out": "further channels with forces are not included: {channels}",
    "cell_sign": "the peak of this load cell is {value:.4g} {unit}, that of the sum {total:.4g} "
    "{unit}; its sign may be wrong",
    # Faults of the force.
    "spikes": "spikes ({count:g}) of {value:.3g} {unit} in all were filled by linear interpolation",
    "constant_background": "the background is constant for {value:.3g} {unit}, but the contact is "
    "noisy: a gate or lost samples; offset, levels and contact time may be wrong",
    "jump": "the {what} jumps by {value:.3g} {unit} within the contact: lost or exchanged samples, "
    "or a loose contact; levels and contact time may be wrong",
    "flat_top": "the force is flat within {fraction:.2g} % for {duration:.3g} ms at its maximum of "
    "{value:.4g} {unit}: it may be clipped before the recorder",
    "coarse_steps": "the background lies within one step of the record, {step:.3g} {unit}: the "
    "offset is uncertain by {value:.2g} {unit}; measure with a smaller range",
    "aliasing": "the force has content up to half the sample rate, {frequency:g} Hz: without a "
    "filter before sampling, the octave of 500 Hz may be off by {value:.1f} {unit}",
    "short_background": "there are {value:.1f} {unit} of background {side} the contact",
    "offset_step": "the offset changes by {value:.3g} {unit} during the contact; the uncertainty "
    "includes it",
    "plate_rings": "the plate keeps ringing at {frequency:.0f} Hz with {value:.2g} {unit}, which "
    "changes levels, peaks and contact time; state it in [plate]: f0 = {frequency:.0f}, "
    "Q = {quality:.2g}",
    "plate_rings_differently": "the plate keeps ringing at {frequency:.0f} Hz with {value:.2g} "
    "{unit}, unlike [plate]; state there: f0 = {frequency:.0f}, Q = {quality:.2g}",
    # Load cells.
    "cell_without_force": "this load cell carries {value:.1%} of the force; it may be dead",
    # Drops and bounces.
    "drop_like_bounce": "the pulse begins {value:.2f} {unit} after the one before it with "
    "{ratio:.2f} times its peak: if it is its bounce, the amplifier distorts all levels",
    "no_bounce": "the pulse {value:.0f} {unit} after the contact has {ratio:.2g} times its peak: "
    "it is no bounce after a drop from {height:g} m",
    # The recording as a whole.
    "peaks_unknown": "the number of peaks is unknown: some may be noise or the plate",
    "restitution_partly_known": "the restitution is known of {value:g} of {high:g} drops only",
    "restitution_impossible": "the restitution is {value:.2f}, which is impossible: check mass, "
    "height, calibration and sample rate",
    "restitutions_differ": "the restitution by impulse and by bounces differ by {value:.3f} "
    "(expanded uncertainty {high:.2g}; effective mass {mass:.3f} kg): check mass, height and "
    "calibration",
    "effective_mass": "the mass is not stated: the effective mass is assessed",
    "outlier": "{quantity} {value:.4g} lies {score:.3g} standard deviations from the mean of the "
    "drops (Grubbs, 5 %: {critical:.3g})",
    "uncertainty_not_stated": "uncertainty not stated, and not included: {names}",
    # Instruments.
    "plate_assumed": "assumed, as [plate] is not stated: the force plate is flat within "
    "{percent:g} % up to {frequency:g} Hz (up to {value:.2g} {unit} at {band:g} Hz)",
    "share_assumed": "assumed, as [plate] share is not stated: the resonance has half to all of "
    "the static response of the plate (up to {value:.2g} {unit} at {band:g} Hz)",
    "filter_assumed": "assumed, as [filter] is not stated: the filter of the recorder is at a "
    "quarter of the sample rate or above (up to {value:.2g} {unit} at {band:g} Hz)",
    "noise_ends": "the noise of the background ends near {value:.2g} {unit}: the samples were "
    "smoothed or interpolated, which changes levels and contact time; state [filter]",
    "plate_not_flat": "plate flat up to {value:g} {unit}; the standard requires {low:g} {unit}",
    "plate_low": "at {frequency:g} Hz the plate reads {value:.2g} {unit} too little (time constant "
    "{time_constant:g} s; 2 % need {needed:.1f} s)",
    "plate_high": "up to {frequency:g} Hz the plate with its resonance of {f0:.5g} Hz is up to "
    "{value:.2g} {unit} off (after the correction, whose resonance is known to {shift:.2g} %)",
    "plate_range": "the plate reads up to {value:.4g} {unit}; the standard requires {required:g} N",
    "plate_linear": "from {first:.4g} to {last:.4g} N the plate is linear within {value:.2g} "
    "{unit} (worst at {worst:.4g} N)",
    "plate_unknown": "the {what} of the plate is not known ([plate] {keys})",
    "plate_estimated": "the resonance of the force plate is not stated: its estimated effect, up "
    "to {value:.2g} {unit} at {band:g} Hz, is in the uncertainty",
    "plate_not_recorded": "the record does not show the stated resonance of {frequency:.4g} Hz: "
    "its correction, up to {value:.2g} {unit} at {band:g} Hz, is in the uncertainty; check [plate]",
    "plate_unclear": "the record neither shows nor excludes the stated resonance of "
    "{frequency:.4g} Hz: its correction, {value:.2f} {unit} at 500 Hz, depends on [plate] alone",
    # Dates.
    "calibration_overdue": "its calibration was due on {due}, before the measurement",
    "date_unknown": "the date of the measurement cannot be read: calibrations may be overdue",
    # Level in a room.
    "level_below_paths": "the rating is below {high:g} {unit}: flanking paths, gaps and bridges, "
    "which are not predicted, are expected to be louder",
    "blocked_force": "the force is that on a rigid floor, whose peak differs by {value:.1f} {unit}",
    "blocked_model": "the model {model} has the force on a rigid floor only: this floor would "
    "change its peak by at most {high:g} {unit}",
    "source_not_conforming": "the source does not conform ({octaves} from the nominal levels): the "
    "level in the room is not that of a standard source",
    # Measured levels in rooms.
    "few_positions": "{value:g} positions of the source; ISO 16283-2 requires {low:g}",
    "positions_differ": "the levels of two positions differ by {value:.0f} {unit} on average (up "
    "to {high:g} {unit} is plausible)",
    "background_unknown": "the background is not known: levels are not corrected for it",
    "near_background": "less than {low:g} {unit} above the background at {bands} Hz: levels there "
    "and the ratings are upper bounds",
    "not_standardized": "not standardized: {missing} not stated",
    # Calibrations.
    "steps_in_one_direction": "successive steps in the same direction: each is taken to be the "
    "whole known force, {value:.6g} {unit}",
    "stored_values_calibrated": "{factor} of the file is not applied: the calibration is that of "
    "stored values, for files with the same value",
    "known_force_uncertain": "not included: the uncertainty of the known force (--uncertainty)",
    "gravity_assumed": "gravity not stated (gravity, --gravity): {value:.6g} {unit} is used, with "
    "an uncertainty of {spread:.2%} for {low:.3f} to {high:.3f} {unit} at sea level",
    "tap_misfit": "the ringing differs from decaying oscillations by {value:.1%}, as by close "
    "modes or a double hit: the uncertainties include it; tap again",
    # Fits of mobilities.
    "mobility_implausible": "the mean mobility, {value:.2g} {unit}, is not that of a floor "
    "({low:g} to {high:g} {unit}): check units (m and N, not mm or kN) "
    "and quantity (not an acceleration or an impedance)",
    "real_part_negative": "the measured real part is negative at {value:.2g} {unit} of the "
    "frequencies, which is impossible for a floor: the fit is nowhere negative",
    "mobility_misfit": "the fit differs from the measurement by {value:.0f} {unit}",
    "passivity_misfit": "the condition of a passive floor increases the error of the fit from "
    "{low:.2g} {unit} to {value:.2g} {unit}",
    # Sounds.
    "sound_deviates": "the sound deviates from the prediction by {value:.1f} {unit} in an octave "
    "or in the A-weighted level",
    # Fits.
    "not_converged": "the search has not converged; allow more steps, or start elsewhere",
    "no_effect": "{names} has no effect on the compared quantities: it cannot be fitted",
    "not_identifiable": "{names} are not identifiable: {changes} together do not change the "
    "compared quantities{product}",
    "hardly_known": "{names} is hardly identifiable: its {confidence:.0%} interval is "
    "±{value:.0f} {unit} of its value",
    "hardly_identifiable": "{names} are hardly identifiable: along {changes} the {confidence:.0%} "
    "interval is ±{value:.0f} {unit}{product}",
    "at_limit": "{name} ended at its limit, {limit}: all intervals hold inside the limits only",
    "alternative_seen": "the residuals contain the effect of {alternative} ({value:.3g} standard "
    "errors): the {unknown} is not as assumed, and the intervals include the difference",
    "alternative_failed": "{alternative} failed: the {unknown} counts as known ({reason})",
    "unexplained": "the residuals are {value:.3g} times the uncertainty: the model does not fit",
    "residuals_colored": "half of the power of the residuals lies in the {side}est {value:.0%} of "
    "the compared frequencies: the noise is not as assumed or the model is wrong",
    "residuals_in_contact": "the residual is {value:.3g} {unit} during the contact and {high:.3g} "
    "{unit} otherwise: the model differs from the force by more than the noise",
    "background_too_short": "the background lasts {value:.3g} {unit}: hum and color of the "
    "noise are not known, and the intervals hold for white noise alone",
    "larger_than_expected": "{name} is {value:.2g} standard deviations from its expected value",
    # Samples.
    "samples_failed": "{value:.0f} of {high:.0f} samples failed; most frequent reason: {reason}",
    "samples_not_standard": "the sources of {value:.0f} of {high:.0f} samples do not conform: "
    "their levels in the room are not those of a standard source",
}
