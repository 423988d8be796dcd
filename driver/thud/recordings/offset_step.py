"""A step of the offset during a contact, as by a loose connector, and its effect."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.recordings.contact import Contact

# Length of the sections of the background that are averaged, s, and their minimum number on a side.
SECTION = 5e-3
MIN_SECTIONS = 6
# Harmonics of hum that are fitted if hum is significant, and its minimum in standard deviations.
N_HARMONIC = 3
MIN_HUM = 3.0
# A step exceeds the changes of the background over the duration of a contact by this factor, and
# this fraction of the peak.
MIN_RATIO = 5.0
MIN_STEP = 2e-3
# Time constants of an amplifier that may cause the change, s, and the increase of the sum of
# squares, in variances of the residual, up to which it is the cause.
TIME_CONSTANTS = np.geomspace(0.1, 30, 200)
INCREASE = 9.0
# Steps at these fractions of the gate are compared with the interpolated background.
INSTANTS = np.linspace(0, 1, 33)


def find_offset_step(contact: Contact) -> float:
    """Return the step of the offset between the ends of a contact, N; zero if there is none.

    Offset, drift, hum and a step are fitted to the background on both sides. The step must exceed
    the usual changes of the residual over the same time. It is none if the droop of an amplifier,
    -1/tau times the force and decaying with the time constant tau, explains the background.
    """
    rate, first = contact.sample_rate, contact.span[0]
    begin, end = contact.gate[0] - first, contact.gate[1] - first
    width = max(1, round(SECTION * rate))
    force = contact.force + contact.removed
    counts = begin // width, (len(force) - end) // width
    if min(counts) < MIN_SECTIONS:
        return 0.0

    def sections(samples: NDArray[np.floating]) -> NDArray[np.float64]:
        before = samples[begin - counts[0] * width : begin]
        after = samples[end : end + counts[1] * width]
        return np.asarray(np.concatenate([before, after]).reshape(-1, width).mean(axis=1))

    time = sections((np.arange(len(force)) - (begin + end) / 2) / rate)
    mean = sections(force)
    is_after = np.arange(len(time)) >= counts[0]
    frequency, amplitude, deviation = contact.background.hum
    phases = 2 * np.pi * np.outer(time, frequency * np.arange(1, N_HARMONIC + 1))
    hum = [np.cos(phases), np.sin(phases)] if amplitude > MIN_HUM * deviation else []
    columns = np.column_stack([np.ones(len(time)), time, *hum])
    step, residual = _fit(np.column_stack([is_after, columns]), mean)
    lag = round((end - begin) / width) + 1
    changes = [side[lag:] - side[:-lag] for side in (residual[: counts[0]], residual[counts[0] :])]
    freedom = len(time) - columns.shape[1] - 1
    usual = np.sqrt(np.mean(np.concatenate(changes) ** 2) * len(time) / max(freedom, 1))
    if not (freedom > 0 and abs(step) > max(MIN_RATIO * usual, MIN_STEP * contact.peak)):
        return 0.0
    pulse = np.zeros(len(force))
    pulse[begin:end] = contact.gated
    for tau in TIME_CONSTANTS:
        loss = lfilter([-1 / tau / rate], [1, -1 + 1 / tau / rate], pulse)
        _, rest = _fit(columns, mean - sections(loss))
        if rest @ rest < residual @ residual * (1 + INCREASE / freedom):
            return 0.0
    return float(step)


def _fit(
    columns: NDArray[np.floating], values: NDArray[np.float64]
) -> tuple[float, NDArray[np.float64]]:
    """Return the first coefficient of a least-squares fit, and the residual."""
    coefficients = np.linalg.lstsq(columns, values)[0]
    return float(coefficients[0]), np.asarray(values - columns @ coefficients)


def step_errors(step: float, count: int) -> NDArray[np.float64]:
    """Return errors of a force if its offset changed at one of several instants, N, [k, count].

    The removed background is the line between both offsets.
    """
    line = np.linspace(0, step, count)
    index = np.arange(count)
    return np.array([line - step * (index >= instant * count) for instant in INSTANTS])
