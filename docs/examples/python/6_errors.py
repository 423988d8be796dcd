"""Errors and warnings."""

import warnings

import thud

# %% ThudError, InputError, NumericalError
try:
    thud.solve(thud.Ball(mass=-1.0))
except thud.ThudError as error:
    if note := error.note:
        print(type(error).__name__, note.subject, note.low, note.high)

# %% PlausibilityWarning
with warnings.catch_warnings(record=True, action="always") as caught:
    thud.solve(thud.Ball(mass=7.0, wall_thickness=0.02))
print([str(warning.message) for warning in caught])

# %% FitWarning
warnings.simplefilter("error", thud.FitWarning)
