"""Checks of recordings: what each protects from, and how far levels are off without it.

The sizes are those of a half-sine of 1500 N and 20 ms. A further check is a function in a file,
and a line in the table; its words are in `thud.base.sentences`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from thud.recordings import quantization, signs
from thud.recordings.checks import aliasing, cells, clipping, copies, gaps, jumps, outliers, plate

if TYPE_CHECKING:
    from collections.abc import Callable


class Check(NamedTuple):
    """A check: its function, what it protects from, and the size of its effect."""

    check: Callable[..., Any]
    protects: str
    effect: str


CHECKS = {
    # Of the recorded force of a drop or of a load cell, before its repair: check(section).
    "section": (
        Check(clipping.check, "a top that recorder or amplifier cuts off",
              "at 1450 N 1.3 dB at 250 Hz, at 1200 N 3.9 dB at 125 Hz"),
        Check(gaps.check,
              "samples that are held, clipped, filled by a line or gated, and missing codes",
              "3 ms of the touch 16 dB at 500 Hz, a gate of 40 N 1 dB at 500 Hz, without the bit "
              "of 32 N 0.4 dB at 250 Hz"),
    ),
    # Of a contact, after the removal of the background: check(section, contact).
    "contact": (
        Check(jumps.check, "packets that are lost, filled or exchanged",
              "of 2 ms 12 dB at 250 and 500 Hz"),
        Check(aliasing.check, "content above half the sample rate without a filter before sampling",
              "the size in the warning, at 500 Hz"),
        Check(quantization.check, "an offset that is not known within a step of quantization",
              "an offset of 0.05 % of the peak 0.06 dB at 500 Hz; the uncertainty includes it"),
    ),
    # Of what is more or less than a drop: where it is read or averaged.
    "other": (
        Check(signs.check_peak, "a wrong sign, unit or calibration",
              "kN in place of N 60 dB"),
        Check(cells.check, "load cells that carry no force or count twice",
              "one of four cells 2.5 dB"),
        Check(copies.check, "the same drop twice, and load cells that are averaged",
              "a scatter of zero, and for four cells 12 dB"),
        Check(plate.check_plate, "a force plate that the standard does not allow",
              "a resonance of 1.6 kHz that is not corrected 1.9 dB at 708 Hz"),
        Check(outliers.check, "drops that differ from the others by more than chance",
              "they are marked, not left out"),
    ),
}  # fmt: skip
