"""Quantization of the record: values that never occur, and an offset within a step."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse
from thud.base.note import Note
from thud.recordings.differences import noise_deviation

if TYPE_CHECKING:
    from thud.recordings.contact import Contact
    from thud.recordings.drops import Section

# Minimum number of different values of a contact over the period of a bit that may be missing.
MIN_VISITS = 4
# Standard deviation of the offset as a fraction of the peak: 0.03 dB at 250, 0.06 dB at 500 Hz.
MAX_OFFSET = 5e-4


def check_codes(section: Section) -> tuple[Note, ...]:
    """Raise InputError if half of the values of a converter never occur in the contact.

    These are the values in which a bit is set, or not set, of all within its period. A smooth force
    may well leave out values.
    """
    step, force = section.quantization.step, section.force[slice(*section.contact)]
    if not step or noise_deviation(force) < step:
        return ()
    codes = np.unique(np.rint((force - force.min()) / step).astype(np.int64))
    period = 4
    while MIN_VISITS * period < len(codes):
        occupied = len(np.unique(codes % period))
        if occupied <= period // 2:
            refuse(
                f"{section.name}: of {period} successive values of the converter, {step:.3g} N "
                f"apart, {period - occupied} never occur",
                "a converter without missing codes",
            )
        period *= 2
    return ()


def check_offset(section: Section, contact: Contact) -> tuple[Note, ...]:
    """Return a warning if the quantization of a background makes its offset uncertain."""
    del section
    quantization = contact.background.quantization
    if quantization.offset < MAX_OFFSET * contact.peak:
        return ()
    others = {"step": quantization.step}
    return (Note("coarse_steps", value=quantization.offset, unit="N", effect=0.0, others=others),)
