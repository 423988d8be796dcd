"""Measured drops against a pipeline that a reader can check at a glance.

The line between the medians of the background, a threshold of 1 % of the peak, and the energies of
a Fourier transform: no model of noise and flanks, no uncertainty. What the measurement does beyond
it changes clean recordings by little: the hum of 2 N by up to 0.16 dB, other levels by 0.05 dB.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import thud

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

RECORDINGS = Path(__file__).parents[2] / "inputs/recordings"


def measure_plainly(force: NDArray[np.float64], rate: float) -> tuple[NDArray[np.float64], float]:
    """Return octave levels, dB, and contact time, s, of a force with one drop, N."""
    top = int(np.argmax(force))
    first, stop = top - int(0.012 * rate), top + int(0.016 * rate)
    # Sides of a period of the hum.
    period = int(0.02 * rate)
    sides = slice(first - period, first), slice(stop, stop + period)
    middles = first - period / 2, stop + period / 2
    medians = [np.median(force[side]) for side in sides]
    force = force - np.interp(np.arange(len(force)), middles, medians)
    smooth = np.convolve(force, np.full(max(1, round(1e-4 * rate)), 1.0), mode="same")
    above = np.flatnonzero(smooth[first:stop] > 0.01 * smooth[top]) + first
    begin, end = above[0], above[-1]
    gate = force[begin - round(1e-3 * rate) : end + round(1e-3 * rate)]
    spectrum = np.abs(np.fft.rfft(gate, 64 * len(gate)) / rate) ** 2
    frequency = np.fft.rfftfreq(64 * len(gate), 1 / rate)
    bands = thud.get_bands()
    energies = [
        2 * (high - low) * spectrum[(frequency >= low) & (frequency < high)].mean()
        for low, high in zip(bands.lower, bands.upper, strict=True)
    ]
    return 10 * np.log10(energies), float(end - begin) / rate


def test_examples_agree_with_a_plain_pipeline(oracle: Callable[..., None]) -> None:
    paths = sorted(RECORDINGS.glob("drop_*.wav"))
    recording = thud.read_recording(paths, config=RECORDINGS / "lab.toml")
    levels, times = [], []
    for drop in recording.drops:
        recorded = drop.force + drop.contact.removed
        plain, contact_time = measure_plainly(recorded, drop.sample_rate)
        levels.append(plain - drop.levels())
        times.append(1e3 * (contact_time - drop.contact_time.value))
    # Hum within the gate: 2 N for 20 ms are 0.04 N s, 2 % of the spectrum in the octave of 63 Hz.
    difference = np.array(levels)
    assert np.abs(difference[:, 2:]).max() < 0.05, difference
    oracle("levels of recordings: plain pipeline", "independent code", difference, 0.18, "dB")
    oracle("contact times of recordings: plain pipeline", "independent code", times, 0.11, "ms")
