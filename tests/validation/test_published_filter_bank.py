"""The filter bank against a published library, PyOctaveBand."""

from __future__ import annotations

import numpy as np
import pyoctaveband
import pytest

import thud
from thud.level.levels import BANDWIDTHS
from thud.recordings.filters import filter_levels

pytestmark = pytest.mark.slow

REFERENCE_PRESSURE = 2e-5
SECONDS = 10
# Bands per octave, and limits that select the bands.
BANDS = {"octave": (1, [30, 600]), "third": (3, [24, 660])}
# Noise of 0.5 N, 70 dB below the peak, as a recording has it.
DEVIATION = 0.5


def recording(force: str, rate: int) -> np.ndarray:
    """Return a drop in 10 s of silence with noise, N."""
    time = np.arange(SECONDS * rate) / rate - 2
    if force == "half-sine":
        pulse = np.where((time >= 0) & (time <= 0.02), 1500 * np.sin(np.pi * time / 0.02), 0)
    else:
        floor = thud.solve().floor_force
        pulse = np.interp(time, np.arange(len(floor)) / 44100, floor, left=0, right=0)
    return pulse + np.random.default_rng(rate).normal(scale=DEVIATION, size=len(time))


def library_levels(force: np.ndarray, rate: int, bands: str, **options: object) -> np.ndarray:
    """Return levels of an energy, from the library's levels of a mean square pressure."""
    fraction, limits = BANDS[bands]
    bank = pyoctaveband.OctaveFilterBank(rate, fraction=fraction, limits=limits, **options)
    levels = np.asarray(bank.filter(force, detrend=False)[0])
    assert len(levels) == len(thud.get_bands(bands).nominal)
    return levels + 20 * np.log10(REFERENCE_PRESSURE) + 10 * np.log10(SECONDS)


@pytest.mark.parametrize("bands", BANDWIDTHS)
@pytest.mark.parametrize("force", ["half-sine", "shell"])
@pytest.mark.parametrize("rate", [8000, 44100, 51200, 96000])
def test_recording_reads_the_same(force: str, rate: int, bands: str) -> None:
    record = recording(force, rate)
    found = filter_levels(record, rate, bands)
    theirs = library_levels(record, rate, bands, order=3, resample=False)
    np.testing.assert_allclose(found, theirs, rtol=0, atol=0.1)
    # Other filters of class 1 (its own default, order 6) differ by their skirts.
    other = library_levels(record, rate, bands)
    assert np.abs(found - other).max() < 0.8
