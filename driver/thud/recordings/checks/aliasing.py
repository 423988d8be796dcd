"""Content of the force that may be folded into the octave of 500 Hz."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from thud.base.note import Note
from thud.level.levels import get_bands

if TYPE_CHECKING:
    from thud.recordings.contact import Contact
    from thud.recordings.drops import Section

# Fraction of the rate above which content indicates aliasing, and error above which a warning is
# raised, dB.
ALIASED_FRACTION = 0.4
MAX_ERROR = 0.1


def check(section: Section, contact: Contact) -> tuple[Note, ...]:
    """Return a warning if content may alias into the octave of 500 Hz.

    This is content above half the rate, where no filter precedes sampling; from 0.1 dB on, the
    warning states what it adds. The amplitude of a pulse with kinks is assumed to fall as 1/f**2
    there; stated instruments reduce it further.
    """
    rate, bands = contact.sample_rate, get_bands()
    lower, upper = bands.lower[-1], bands.upper[-1]
    # Padded to a length with several frequencies in the octave.
    force = np.pad(contact.gated, (0, int(rate / 20) + 3 * len(contact.gated)))
    frequency = np.fft.rfftfreq(len(force), 1 / rate)
    power = np.abs(np.fft.rfft(force)) ** 2
    noise = contact.background.variances[0] * rate / 2 * len(contact.gated)
    octave_power = power[(frequency > lower) & (frequency < upper)].mean()
    top = max(power[frequency > ALIASED_FRACTION * rate].mean() - 3 * noise, 0.0)
    folded = top * (0.45 * rate / (rate - upper)) ** 4
    if section.chain is not None:
        folded *= abs(section.chain.response(np.array([rate - upper]))[0]) ** 2
    error = 20 * math.log10(1 + math.sqrt(folded / octave_power))
    if error < MAX_ERROR:
        return ()
    return (Note("aliasing", value=error, unit="dB", others={"frequency": rate / 2}),)
