"""Calibration, N per unit, from a record of a known force."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse, require_number
from thud.recordings.channel import shown_path
from thud.recordings.force_units import ALLOWED, Calibration, find_unit, require_unit
from thud.recordings.formats import read_channels
from thud.recordings.restitution import GRAVITY
from thud.recordings.signal import Signal
from thud.recordings.signal_files import choose_channels, regular_file

if TYPE_CHECKING:
    import os
    from collections.abc import Callable

    from numpy.typing import NDArray

# A record is reduced to about this many means, at least MIN_PLATEAU of them in a plateau.
MEANS = 4096
MIN_PLATEAU = 8
# Number of samples per read.
BLOCK = 2**20
# Fractions of the range of the level at which a step up, and a step down, is detected.
UP, DOWN = 0.6, 0.4
# Fraction of a plateau that is ignored at either end.
SETTLING = 0.1
# Maximum relative uncertainty of the step.
MAX_UNCERTAINTY = 0.1


def calibrate(  # noqa: PLR0913 - the keys of the configuration
    record: Signal | str | os.PathLike[str],
    *,
    force: float | None = None,
    mass: float | None = None,
    channel: int | str | None = None,
    unit: str | None = None,
    gravity: float = GRAVITY,
    uncertainty: float = 0.0,
) -> Calibration:
    """Return N per unit from a record of a known force put on or taken off the plate.

    A line is fitted to the level on either side of each step, which removes offset and drift.

    Parameters
    ----------
    record
        File, or a signal in the unit to be calibrated.
    force, mass
        Known force, N, or known mass, kg: one of them.
    channel
        Number or name of the channel of a file.
    unit
        Unit of the values, if the file does not state it.
    gravity
        Local acceleration of gravity, m/s2.
    uncertainty
        Relative standard uncertainty of the known force.

    Returns
    -------
    Calibration
        The uncertainty includes that of the step: from the residuals of the lines or from the
        scatter of several steps, whichever is larger.

    Raises
    ------
    InputError
        If force and mass are both stated or both missing, or the record has no clear step.
    """
    if (force is None) == (mass is None):
        refuse("calibrate(): state either force or mass", "force in N or mass in kg")
    newtons = force if force is not None else (mass or 0.0) * gravity
    require_number("calibrate(): force", newtons)
    if not newtons > 0 or not 0 <= uncertainty < 1:
        refuse(
            f"calibrate(): force = {newtons:g} N, uncertainty = {uncertainty:g}",
            "a positive force, 0 <= uncertainty < 1",
        )
    name, symbol, samples, count = _source(record, channel, unit)
    steps = _steps(_means(samples, count), name)
    size, deviation = _mean(steps)
    if deviation > MAX_UNCERTAINTY * size:
        refuse(
            f"{name}: the step is {size:.4g} {symbol} with an uncertainty of {deviation:.2g} "
            f"{symbol}",
            f"an uncertainty up to {MAX_UNCERTAINTY:.0%}",
        )
    load = f"{newtons:.6g} N" if mass is None else f"{mass:g} kg"
    return Calibration(
        f"{newtons / size!r} N/{symbol}",
        math.hypot(deviation / size, uncertainty),
        f"{len(steps)} step{'s' * (len(steps) > 1)} of {load} in {name}",
    )


def _source(
    record: Signal | str | os.PathLike[str], channel: int | str | None, unit: str | None
) -> tuple[str, str, Callable[[int, int], NDArray[np.float64]], int]:
    if isinstance(record, Signal):
        if unit is None:
            refuse(f"{record.name}: the unit is not stated", f"unit = one of {ALLOWED}")
        return record.name, require_unit(unit, record.name), record.read, record.n_sample
    path = regular_file(record)
    channels = choose_channels(read_channels(path), channel, shown_path(path))
    if len(channels) != 1:
        refuse(f"{shown_path(path)}: {len(channels)} channels match", "channel = one of them")
    selected = channels[0]
    symbol = find_unit(selected.unit) if unit is None else require_unit(unit, path.name)
    if not symbol:
        refuse(f"{shown_path(path)}: the values are without a unit", f"unit = one of {ALLOWED}")
    return shown_path(path), symbol, selected.samples, selected.n_sample


def _means(samples: Callable[[int, int], NDArray[np.float64]], count: int) -> NDArray[np.float64]:
    width = max(1, count // MEANS)
    # Blocks of complete sections, few because each read opens the file.
    step = width * max(1, BLOCK // width)
    stop = count - count % width
    blocks = (samples(start, min(start + step, stop)) for start in range(0, stop, step))
    means = [block.reshape(-1, width).mean(axis=1) for block in blocks]
    return np.concatenate([np.zeros(0), *means])


def _steps(level: NDArray[np.float64], name: str) -> list[tuple[float, float]]:
    """Return size and standard uncertainty of the steps of a level."""
    if not np.isfinite(level).all():
        refuse(f"{name}: a value is not finite", "real numbers")
    # The extremes of a running median ignore knocks on the plate.
    smooth = (
        np.median(np.lib.stride_tricks.sliding_window_view(level, 5), axis=1)
        if len(level) > MIN_PLATEAU
        else np.zeros(1)
    )
    fraction = (level - smooth.min()) / (np.ptp(smooth) or 1.0)
    edges, loaded = [0], bool(fraction[0] > UP)
    for index, value in enumerate(fraction):
        if (not loaded and value > UP) or (loaded and value < DOWN):
            loaded = not loaded
            edges.append(index)
    edges.append(len(level))
    if len(edges) < 3 or min(np.diff(edges)) < MIN_PLATEAU:  # noqa: PLR2004 - two plateaus
        refuse(
            f"{name}: has no clear step", "a record in which a known force is put on or taken off"
        )
    steps = []
    for before, edge, after in zip(edges, edges[1:], edges[2:], strict=False):
        (level_before, u_before), (level_after, u_after) = (
            _level_at(level, *span, edge) for span in ((before, edge), (edge, after))
        )
        steps.append((abs(level_after - level_before), math.hypot(u_before, u_after)))
    return steps


def _level_at(level: NDArray[np.float64], begin: int, end: int, edge: int) -> tuple[float, float]:
    """Return the level at an edge of a plateau, by a fitted line, and its standard uncertainty."""
    settling = max(1, int(SETTLING * (end - begin)))
    plateau = level[begin + settling : end - settling]
    index = np.arange(begin + settling, end - settling) - edge
    line = np.column_stack([np.ones(len(index)), index])
    (value, slope), *_ = np.linalg.lstsq(line, plateau, rcond=None)
    residual = plateau - line @ [value, slope]
    variance = residual @ residual / (len(index) - 2)
    covariance = variance * np.linalg.inv(line.T @ line)
    return float(value), math.sqrt(covariance[0, 0])


def _mean(steps: list[tuple[float, float]]) -> tuple[float, float]:
    sizes, deviations = np.array(steps).T
    count = len(sizes)
    within = math.sqrt(float(deviations @ deviations)) / count
    scatter = float(sizes.std(ddof=1)) / math.sqrt(count) if count > 1 else 0.0
    return float(sizes.mean()), max(within, scatter)
