"""Correction of recorded forces for the responses of force plate and recorder."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from thud.level.levels import get_bands

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from thud.recordings.drops import Section
    from thud.recordings.instruments import Plate, RecorderFilter

    Gain = Callable[[NDArray[np.float64]], NDArray[np.complex128]]

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

    def correction(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the ratio of corrected and measured force, at frequencies in Hz."""
        octaves = np.log2(np.maximum(frequency, 1e-9) / self.highest)
        response = self.response(frequency)
        response *= np.maximum(MIN_RESPONSE / np.abs(response), 1)
        return np.asarray(np.cos(np.pi / 2 * np.clip(octaves, 0, 1)) ** 2 / response)


def filtered(
    force: NDArray[np.float64], sample_rate: float, gain: Gain, margin: int = 0
) -> NDArray[np.float64]:
    """Return a force filtered by a gain, N, shape (n_sample,), by Fourier transform.

    The gain is a function of the frequency, Hz. Before and after the force, N, its first and last
    value continue for a margin, in samples, in which the impulse response of the gain decays.
    """
    # SciPy is slow to import, and a configuration is read by every command.
    from scipy.fft import next_fast_len

    padded = np.pad(force, margin, mode="edge")
    length = next_fast_len(len(padded) + margin, real=True)
    factors = gain(np.asarray(np.fft.rfftfreq(length, 1 / sample_rate), dtype=np.float64))
    # The transform is periodic: without the first value, its ends meet without a step.
    origin = padded[0]
    result = np.fft.irfft(np.fft.rfft(padded - origin, length) * factors, length)
    return np.asarray(result[margin : margin + len(force)] + origin * factors[0].real)


def correct_force(
    force: NDArray[np.float64], sample_rate: float, chain: Chain
) -> NDArray[np.float64]:
    """Return the applied force, N, shape (n_sample,), from the measured one.

    This is exact up to the highest corrected frequency; above, it would only amplify noise, and is
    reduced to zero within an octave. The measured force, N, has background at both ends; the rate
    is in Hz. Raise InputError if a response does not allow a correction up to the highest edge of
    the one-third-octave bands.
    """
    for instrument in chain.instruments:
        instrument.require_above(get_bands("third").upper[-1])
    # The impulse response decays within some periods of the highest corrected frequency.
    margin = math.ceil(20 * sample_rate / chain.highest)
    return filtered(force, sample_rate, chain.correction, margin)


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
