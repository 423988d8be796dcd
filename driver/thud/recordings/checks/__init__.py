"""Checks of recordings; each states what it protects from, and how far levels are off without it.

The sizes are those of a half-sine of 1500 N and 20 ms. A further check of a drop is a function in
`force`, and an entry here; its words are in `thud.base.sentences`. Checks of more or less than a
drop are called where that is read or averaged: `thud.recordings.signal.check_peak` of a signal (kN
in place of N: 60 dB), and here `check_cells` of load cells (without one of four 2.5 dB),
`copies.check` and `outliers.check` of several drops, and `plate.check_plate` (a resonance of 1.6
kHz that is not corrected: 1.9 dB at 708 Hz).
"""

from thud.recordings.checks import force

# Of the repaired force of a load cell, or of the drop: check(section).
CELL_CHECKS = (force.check_clipping, force.check_lost, force.check_noise)
# Of the repaired force of the drop: check(section).
SECTION_CHECKS = (force.check_slope,)
# Of a contact, after the removal of the background: check(section, contact).
CONTACT_CHECKS = (force.check_aliasing,)
