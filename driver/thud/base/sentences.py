"""The words of all notes: one sentence for each code, with the values of `thud.base.note.Note`."""

# Of refusals and of notes of the library, whose words are made where they arise
# (src/case/warnings.f90): the name of an argument, or of group and key, and what is said of it.
LIBRARY = "{name} {text}"

# What was done with a signal.
PROCESSING = {
    # Fits.
    "unknowns_included": "unknown, in the intervals: {unknowns}; noise alone: {errors}",
    "press_included": "unknown, in the intervals as far as the curve does not show it: {unknowns}",
    "not_visible": "not in the intervals, and not visible: {cause} changes {changes}",
    "widened": "intervals widened {value:.3g} times, see the warnings",
    # Reading of files.
    "sign_stated": "the sign was changed: polarity = '{polarity}'",
    "sign_changed": "the sign was changed: the largest peak, {value:.4g} {unit}, is negative",
    "cells_added": "the forces of {value:g} load cells were added",
    "rate_replaced": "the rate of the file, {of_file:.7g} {unit}, was replaced by {value:.7g} "
    "{unit} as stated",
    "unit_replaced": "the unit of the file, {of_file}, was replaced by {unit} as stated",
    "unit_assumed": "the file states no unit; the values are assumed to be in {unit}",
    "unit_of_calibration": "the file states no unit; by the calibration the values are in {unit}",
    "unit_of_data_type": "the data set has no label of a unit; it is a force in units of "
    "{value:.6g} {unit}",
    "factor_not_applied": "{factor} of the file was not applied; the calibration replaces it",
    "times_rounded": "the times, up to {value:.1g} {unit} off, were replaced by a grid of "
    "{rate:.7g} Hz",
    # Records of a known force; the uncertainty is a standard uncertainty.
    "droop_removed": "droop with a time constant of {value:.4g} {unit}, standard uncertainty "
    "{uncertainty:.2%}, taken off",
    "no_droop": "no droop: a time constant above {low:.2g} {unit}",
    # Background.
    "offset_removed": "an offset of {value:.3g} {unit} was removed",
    "drift_removed": "a drift of {value:.3g} {unit} was removed",
    "hum_removed": "hum of {frequency:g} Hz with an amplitude of {value:.3g} {unit} was removed",
    "tone_removed": "a tone of {frequency:.4g} Hz with an amplitude of {value:.3g} {unit} was "
    "removed",
    "noise_remains": "noise of {value:.3g} {unit} remains",
    "plate_corrected": "force plate: resonance of {value:.5g} {unit}, quality {quality:g}, "
    "corrected up to {high:.5g} {unit}; noise there times {gain:.2g}",
    "filter_corrected": "{kind} filter of order {order:g}, -3 dB at {value:.5g} {unit}, corrected "
    "up to {high:.5g} {unit}",
    "section_searched": "searched for drops from {low:g} {unit} to {high:g} {unit} only",
    "drop_left_out": "left out: drop {value:list} at {time:.2f} s, {reason}",
    "drop_not_chosen": "left out: drop {value:list} at {time:.2f} s, only {chosen} were chosen",
    "drop_too_small": "left out: drop {value:list} at {time:.2f} s, whose peak of {peak:.0f} N is "
    "below {fraction:g} of the highest; choose its number (--drops, drops) if it is a drop",
    "bounce_ignored": "a bounce of an earlier drop at {time:.2f} s is no drop and has no number",
    "pulse_ignored": "a pulse of {value:.0f} N at {time:.2f} s is no drop and has no number",
    # Samples, and drops over what is not known of a source.
    "drops_varied": "{drops:g} drops, {lost:g} without results; range: minimum and maximum, "
    "without numerical error; probability: Wilson interval (95 %); not known: {names}",
    "unknown_range": "{low:g} to {high:g} {unit} ({reason})",
    "keys_fixed": "fixed by the case: {names}",
    "conforms_by_calibration": "that the standard ball conforms is put in by the calibration, not "
    "found",
    "no_numerical_errors": "The samples state no numerical errors; a run of a single case states "
    "its own.",
}

# What may be wrong.
WARNINGS = {
    # Signals of files.
    "peak_unusual": "the peak is {value:.4g} {unit}; usual is {low:g} to {high:g} {unit} for "
    "heavy/soft sources",
    "polarity_doubtful": "the peaks are {opposite:.4g} {unit} and {value:.4g} {unit}; the polarity "
    "may be wrong",
    "forces_left_out": "the file has forces in other channels, too, which are not included: "
    "{channels}",
    "cell_sign": "the peak is {value:.4g} {unit} in a sum of {total:.4g} {unit}; the sign of this "
    "load cell may be wrong",
    # Faults of the force.
    "spikes": "spikes ({count:g}) of {value:.3g} {unit} in all were filled by linear interpolation",
    "constant_background": "the background is constant for {value:.3g} {unit} while the force in "
    "the contact is noisy: small forces are missing, as behind a gate, or samples are lost; "
    "offset, levels and contact time may be wrong",
    "jump": "the {what} jumps by {value:.3g} {unit} within the contact: packets or samples are "
    "lost, filled or exchanged, or a contact is loose; levels and contact time may be wrong",
    "flat_top": "the force is flat within {fraction:.2g} % for {duration:.3g} ms at its maximum of "
    "{value:.4g} {unit}: it may be clipped ahead of the recorder",
    "coarse_steps": "the record has steps of {step:.3g} {unit}, and the background lies within one "
    "of them: the offset is uncertain by {value:.2g} {unit}; measure with a smaller range",
    "aliasing": "the force has content up to half the rate, {frequency:g} Hz: without a filter "
    "before sampling, the octave of 500 Hz may be off by {value:.1f} {unit}",
    "short_background": "there are {value:.1f} {unit} of background {side} the contact",
    "offset_step": "the offset changes by {value:.3g} {unit} during the contact; its effect is in "
    "the uncertainty",
    "plate_rings": "the plate keeps ringing after the contact, at {frequency:.0f} Hz with "
    "{value:.2g} {unit}: its resonance affects levels, peaks and contact time; state it in "
    "[plate]: f0 = {frequency:.0f}, Q = {quality:.2g}",
    "plate_rings_differently": "the plate keeps ringing after the contact, at {frequency:.0f} Hz "
    "with {value:.2g} {unit}: its resonance differs from that in [plate]; state it in [plate]: f0 "
    "= {frequency:.0f}, Q = {quality:.2g}",
    # Load cells.
    "cell_without_force": "this load cell carries {value:.1%} of the force; it may be dead",
    # Drops and bounces.
    "drop_like_bounce": "the pulse begins {value:.2f} {unit} after the one before it, as a bounce "
    "would, and has {ratio:.2f} times its peak: if it is its bounce, the amplifier rounds the "
    "force off, and all levels are wrong",
    "no_bounce": "the pulse {value:.0f} {unit} after the contact has {ratio:.2g} times its peak: "
    "it is no bounce after a drop from {height:g} m",
    # The recording as a whole.
    "peaks_unknown": "the number of peaks is unknown: some may be noise or the plate",
    "restitution_partly_known": "the restitution is known of {value:g} of {high:g} drops only",
    "restitution_impossible": "the restitution is {value:.2f}, which is impossible: check mass, "
    "height, calibration and sample rate",
    "restitutions_differ": "the restitution by impulse and by bounces differ by {value:.3f}, with "
    "an expanded uncertainty of {high:.2g}; the effective mass is {mass:.3f} kg: check mass, "
    "height and calibration",
    "effective_mass": "the mass is not stated: the effective mass is assessed",
    "outlier": "{quantity} {value:.4g} lies {score:.3g} standard deviations from the mean of the "
    "drops (Grubbs, 5 %: {critical:.3g})",
    "uncertainty_not_stated": "uncertainty not stated, and not included: {names}",
    # Instruments.
    "plate_assumed": "not stated, and assumed for levels and peak: the force plate is flat within "
    "{percent:g} % up to {frequency:g} Hz ([plate]; up to {value:.2g} {unit} at {band:g} Hz)",
    "share_assumed": "not stated, and assumed for levels and peak: the resonance has the whole "
    "static response of the plate, or half of it ([plate] share; up to {value:.2g} {unit} at "
    "{band:g} Hz)",
    "filter_assumed": "not stated, and assumed for levels and peak: the filter of the recorder is "
    "at a quarter of the sample rate or above ([filter]; up to {value:.2g} {unit} at {band:g} Hz)",
    "noise_ends": "the noise of the background ends near {value:.2g} {unit}: the samples were "
    "smoothed, or drawn up from a lower rate, which changes levels up to 500 Hz and the contact "
    "time; state the filter in [filter], or record without it",
    "plate_not_flat": "force plate: it is flat up to {value:g} {unit}; the standard asks for "
    "{low:g} {unit}",
    "plate_low": "at {frequency:g} Hz the plate reads {value:.2g} {unit} too little (time constant "
    "{time_constant:g} s; 2 % need {needed:.1f} s)",
    "plate_high": "up to {frequency:g} Hz the plate with its resonance of {f0:.5g} Hz is up to "
    "{value:.2g} {unit} off (after the correction, whose resonance is known to {shift:.2g} %)",
    "plate_range": "the plate reads up to {value:.4g} {unit}; the standard asks for {required:g} N",
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
    "date_unknown": "the date of the measurement cannot be read: whether a calibration was due "
    "before is not known",
    # Level in a room.
    "level_below_paths": "the rating is below {high:g} {unit}: in a building, flanking paths, gaps "
    "and bridges that are not in the prediction are expected to be louder",
    "blocked_force": "the floor is not rigid: its motion would change the peak force by about "
    "{value:.1f} {unit}, but the force on a rigid floor is used",
    "blocked_model": "the model {model} has no force on a mobile floor: that on a rigid floor is "
    "used, whose peak the floor would change by at most {high:g} {unit}",
    "source_not_conforming": "the source does not conform ({octaves} from the nominal levels): the "
    "level in the room is not that of a standard source",
    # Measured levels in rooms.
    "few_positions": "levels of {value:g} of the {low:g} positions of the source that ISO 16283-2 "
    "asks for",
    "positions_differ": "the levels of two positions differ by {value:.0f} {unit} on average (up "
    "to {high:g} {unit} is plausible)",
    "background_unknown": "the background is not known: levels are not corrected for it",
    "near_background": "less than {low:g} {unit} above the background at {bands} Hz: levels there "
    "and the ratings are upper bounds",
    "not_standardized": "not standardized: {missing} not stated",
    # Calibrations.
    "steps_in_one_direction": "the record has steps in the same direction one after the other: "
    "each is taken to be the whole known force, {value:.6g} {unit}, not a part of it",
    "stored_values_calibrated": "the file states {factor}, which is not applied: the calibration "
    "is that of stored values, for files with the same value",
    "known_force_uncertain": "uncertainty of the known force not stated: not included "
    "(--uncertainty)",
    "gravity_assumed": "local gravity not stated (gravity, --gravity): {value:.6g} {unit} is used, "
    "and the uncertainty includes {spread:.2%} for {low:.3f} to {high:.3f} {unit} at sea level",
    "tap_misfit": "the ringing differs from decaying oscillations by {value:.1%}, as by modes "
    "close to each other or a hammer that hits twice: the uncertainties include it; tap again",
    # Fits of mobilities.
    "mobility_implausible": "the mean mobility, {value:.2g} {unit}, is not that of a floor "
    "({low:g} to {high:g} {unit}): check the units (m and N, not mm or kN), and whether the values "
    "are of another quantity, or an impedance",
    "real_part_negative": "the measured real part is negative at {value:.2g} {unit} of the "
    "frequencies, which is not possible for a floor: the fit is nowhere negative",
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
    "+-{value:.0f} {unit} of its value",
    "hardly_identifiable": "{names} are hardly identifiable: along {changes} the {confidence:.0%} "
    "interval is +-{value:.0f} {unit}{product}",
    "at_limit": "{name} ended at its limit, {limit}: its interval is cut there, and all intervals "
    "hold inside the limits only",
    "alternative_seen": "the residuals contain the effect of {alternative} ({value:.3g} standard "
    "errors): the {unknown} is not as assumed, and the intervals include the difference",
    "alternative_failed": "{alternative} cannot be computed: the {unknown} counts as known "
    "({reason})",
    "unexplained": "the residuals are {value:.3g} times as large as the uncertainty of the target: "
    "the model does not explain the data",
    "residuals_colored": "the residuals are colored: half of their power lies in the {side}est "
    "{value:.0%} of the compared frequencies: the noise is not as assumed or the model is wrong",
    "residuals_in_contact": "the residual is {value:.3g} {unit} during the contact and {high:.3g} "
    "{unit} otherwise: the model differs from the force by more than the noise",
    "residuals_change": "the residuals are {value:.3g} times as large after the contact as before "
    "it: the noise is not the same throughout",
    "background_too_short": "the background lasts {value:.3g} {unit}: offset, hum and color of the "
    "noise are not known, and the intervals hold for white noise alone",
    "touch_at_limit": "the first touch lies at the limit of the search: give data from first touch "
    "on",
    "larger_than_expected": "the {name} is {value:.2g} times as large as expected",
    # Samples.
    "samples_failed": "{value:.0f} of {high:.0f} samples have no results; most frequent reason: "
    "{reason}",
    "samples_not_standard": "the sources of {value:.0f} of {high:.0f} samples do not conform: "
    "their levels in the room are not those of a standard source",
}
