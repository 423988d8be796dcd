"""Definition of the contact time (docs/recordings_theory.md, section 3)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

# A contact lasts from the first to the last time at which the force reaches this fraction of its
# peak,
# averaged over AVERAGED s within first touch and release.
THRESHOLD = 0.01
AVERAGED = 1e-4


def contact_span(force: ArrayLike, sample_rate: float) -> tuple[float, float]:
    """Return begin and end of a contact, s from first touch.

    The force, N, shape (n_sample,), runs from first touch to release, without noise.
    """
    values = np.asarray(force, dtype=np.float64)
    time = np.arange(len(values)) / sample_rate
    mean = average_within(values[:, None], time, time, AVERAGED)[:, 0]
    above = np.nonzero(mean >= THRESHOLD * values.max())[0]
    ends = []
    for last, beyond in ((above[0], above[0] - 1), (above[-1], above[-1] + 1)):
        fraction = 0.0
        if 0 <= beyond < len(mean):
            fraction = (mean[last] - THRESHOLD * values.max()) / (mean[last] - mean[beyond])
        ends.append((last + fraction * (beyond - last)) / sample_rate)
    return ends[0], ends[1]


def average_within(
    values: NDArray[np.float64],
    time: NDArray[np.float64],
    at: NDArray[np.float64],
    width: float,
) -> NDArray[np.float64]:
    """Return means of columns over a width around times, within the first and last time.

    The values, shape (n_time, n_column), at uniformly spaced times are linear between them.
    """
    step = time[1] - time[0]
    area = np.zeros_like(values)
    np.cumsum((values[1:] + values[:-1]) * (step / 2), axis=0, out=area[1:])
    low = np.maximum(at - width / 2, time[0])
    high = np.minimum(at + width / 2, time[-1])
    columns = [np.interp(high, time, column) - np.interp(low, time, column) for column in area.T]
    return np.asarray(np.stack(columns, axis=1) / (high - low)[:, None], dtype=np.float64)
