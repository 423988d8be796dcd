"""Correction of recorded forces for the responses of force plate and recorder."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from thud.level.levels import get_bands

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.recordings.drops import Section
    from thud.recordings.instruments import Plate, RecorderFilter

# Minimum response by which a spectrum is divided.
MIN_RESPONSE = 0.05


@dataclass(frozen=True)
class Chain:
    """Instruments in series whose responses are corrected: force plate, filter of the recorder."""

    instruments: tuple[Plate | RecorderFilter, ...]

    @property
    def highest(self) -> float:
        """Highest corrected frequency, Hz."""
        return min(instrument.highest for instrument in self.instruments)

    def response(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the ratio of measured and applied force, at frequencies in Hz."""
        responses = [instrument.response(frequency) for instrument in self.instruments]
        return np.asarray(np.prod(responses, axis=0))

    def passed(self, frequency: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the fraction of the force after the correction, at frequencies in Hz."""
        octaves = np.log2(np.maximum(frequency, 1e-9) / self.highest)
        return np.asarray(np.cos(np.pi / 2 * np.clip(octaves, 0, 1)) ** 2)

    def noise_gain(self, frequency: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the gain of the noise density by the correction, at least 1."""
        return np.asarray(np.maximum(1 / np.abs(self.response(frequency)) ** 2, 1.0))


def correct_force(
    force: NDArray[np.float64], sample_rate: float, chain: Chain
) -> NDArray[np.float64]:
    """Return the applied force, N, shape (n_sample,), from the measured one, by Fourier transform.

    This is exact up to the highest corrected frequency; above, it would only amplify noise, and is
    reduced to zero within an octave. The measured force, N, has background at both ends; the rate
    is in Hz. Raise InputError if a response does not allow a correction up to the highest edge of
    the one-third-octave bands.
    """
    from scipy.fft import next_fast_len

    for instrument in chain.instruments:
        instrument.require_above(get_bands("third").upper[-1])
    # The impulse response decays within some periods of the highest corrected frequency.
    margin = math.ceil(20 * sample_rate / chain.highest)
    padded = np.pad(force, margin, mode="edge")
    length = next_fast_len(len(padded) + margin, real=True)
    frequency = np.asarray(np.fft.rfftfreq(length, 1 / sample_rate), dtype=np.float64)
    response = chain.response(frequency)
    response *= np.maximum(MIN_RESPONSE / np.abs(response), 1)
    # The transform is periodic: without the first value, its ends meet without a step.
    origin = padded[0]
    spectrum = np.fft.rfft(padded - origin, length) / response * chain.passed(frequency)
    corrected: NDArray[np.float64] = (
        np.fft.irfft(spectrum, length)[margin : margin + len(force)] + origin
    )
    return corrected


def correct(section: Section, chain: Chain | None) -> Section:
    """Return a section of the applied force, and of its bounces, with notes on the instruments.

    Faults must be repaired before: a dropout would ring in the correction.
    """
    if chain is None:
        return section
    rate = section.sample_rate
    return replace(
        section,
        force=correct_force(section.force, rate, chain),
        bounces=tuple(correct(bounce, chain) for bounce in section.bounces),
        chain=chain,
        notes=(*section.notes, *(instrument.note(rate) for instrument in chain.instruments)),
    )
