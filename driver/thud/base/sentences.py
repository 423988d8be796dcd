"""The words of all notes: one sentence for each code, with the values of `thud.base.note.Note`."""

# What was done with a signal.
PROCESSING = {
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
    "length_unknown": "the header states no length; the samples were read to the end of the file",
    "times_rounded": "the times, rounded to {value:.1g} {unit}, were replaced by a grid of "
    "{rate:.7g} Hz",
    "date_times_rate": "the sample rate is that of the date-times, {value:.7g} {unit}",
    "date_times_coarse": "the date-times are too coarse to show the sample rate",
    # Background.
    "offset_removed": "an offset of {value:.3g} {unit} was removed",
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
    "channels_similar": "channels in another unit resemble the force, but are not included: "
    "{channels}; if they are load cells, name all channels and state a calibration for each",
    "cell_sign": "the peak is {value:.4g} {unit} in a sum of {total:.4g} {unit}; the sign of this "
    "load cell may be wrong",
}
