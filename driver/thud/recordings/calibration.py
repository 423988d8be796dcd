"""Calibration, N per unit, from a record of a known force."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from thud.base.arguments import check_arguments
from thud.base.checks import refuse, refuse_value, require_number
from thud.recordings.channel import regular_file, shown_path, shown_text
from thud.recordings.force_units import (
    ALLOWED,
    Calibration,
    TimeConstant,
    find_unit,
    require_unit,
)
from thud.recordings.formats import read_channels
from thud.recordings.load_steps import Level, Rate, Steps, measure_steps
from thud.recordings.signal import Signal
from thud.recordings.signal_files import channel_choices, choose_channels

if TYPE_CHECKING:
    import os
    from collections.abc import Callable

    from numpy.typing import NDArray

# A record is reduced to about this many means.
MEANS = 4096
# Number of samples per read.
BLOCK = 2**20
# Standard gravity, m/s2, with which a mass is weighed if the local gravity is not stated; its range
# at sea level, from the equator to the poles; and that of stated values, also on high mountains.
STANDARD_GRAVITY = 9.80665
SEA_LEVEL = (9.780, 9.833)
ALLOWED_GRAVITY = (9.76, 9.84)
# Maximum relative uncertainty of the step, and of a stated time constant.
MAX_UNCERTAINTY = 0.1
MAX_STATED = 0.5
# Standard deviations from zero at which a droop is stated, and those of a bound with 95 %.
SIGNIFICANT = 3.0
BOUND = 1.645


@check_arguments
def calibrate(  # noqa: PLR0913 - the keys of the configuration
    record: Signal | str | os.PathLike[str],
    *,
    force: float | None = None,
    mass: float | None = None,
    channel: int | str | None = None,
    unit: str | None = None,
    gravity: float | None = None,
    uncertainty: float = 0.0,
    time_constant: float | None = None,
    time_constant_uncertainty: float = 0.0,
) -> Calibration:
    """Return N per unit from a record of a known force put on or taken off the plate.

    The force rests between the steps. Behind a charge amplifier the level then decays: its time
    constant, offset and drift are fitted, and each step is free of the decay.

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
        Local acceleration of gravity, m/s2, for a mass; by default 9.80665 m/s2, and the
        uncertainty includes its range at sea level.
    uncertainty
        Relative standard uncertainty of the known force.
    time_constant
        Time constant of the amplifier, s, infinite if it does not droop; by default it is fitted.
    time_constant_uncertainty
        Relative standard uncertainty of the stated time constant. If it is not zero, the fit
        combines what is stated with what the record shows.

    Returns
    -------
    Calibration
        The uncertainty includes that of the step: from the residuals and the time constant, or
        from the scatter of several steps, whichever is larger. Warnings name what was assumed.

    Raises
    ------
    InputError
        If force and mass are both stated or both missing, or the record is clipped or has no
        clear step, or its decay fits no time constant.
    """
    if (force is None) == (mass is None):
        refuse("calibrate(): state either force or mass", "force in N or mass in kg")
    local = _require_gravity(gravity, mass)
    newtons = force if force is not None else (mass or 0.0) * local
    require_number("calibrate(): force", newtons)
    if not newtons > 0 or not 0 <= uncertainty < 1:
        refuse(
            f"calibrate(): force = {newtons:g} N, uncertainty = {uncertainty:g}",
            "a positive force, 0 <= uncertainty < 1",
        )
    source = open_source(record, channel, unit)
    name, symbol, samples, count, sample_rate, full_scale, unapplied = source
    if not symbol:
        refuse(f"{name}: the values are without a unit", f"unit = one of {ALLOWED}")
    level = _means(samples, count)
    # Seconds per mean.
    interval = None if sample_rate is None else max(1, count // MEANS) / sample_rate
    stated = None
    if time_constant is not None:
        stated = _stated_rate(time_constant, time_constant_uncertainty, interval, name)
    steps = measure_steps(level, interval, name, stated, full_scale)
    size, deviation = float(steps.sizes.mean()), steps.uncertainty
    if deviation > MAX_UNCERTAINTY * size:
        refuse(
            f"{name}: the step is {size:.4g} {symbol} with an uncertainty of {deviation:.2g} "
            f"{symbol}",
            f"an uncertainty up to {MAX_UNCERTAINTY:.0%}",
        )
    load = f"{newtons:.6g} N" if mass is None else f"{mass:g} kg (g = {local:g} m/s2)"
    number = len(steps.sizes)
    warnings = _step_warnings(steps, stated, interval, load)
    if unapplied:
        warnings.append(
            f"the file states {unapplied}, which is not applied: the calibration is that of stored "
            "values, for files with the same value"
        )
    spread = 0.0
    if mass is not None and gravity is None:
        # The standard deviation of a rectangular distribution.
        spread = (SEA_LEVEL[1] - SEA_LEVEL[0]) / math.sqrt(12) / STANDARD_GRAVITY
        warnings.append(
            f"local gravity not stated (gravity, --gravity): {STANDARD_GRAVITY} m/s2 is used, and "
            f"the uncertainty includes {100 * spread:.2g} % for {SEA_LEVEL[0]:.3f} to "
            f"{SEA_LEVEL[1]:.3f} m/s2 at sea level"
        )
    return Calibration(
        f"{newtons / size!r} N/{symbol}",
        math.hypot(deviation / size, uncertainty, spread),
        f"{number} step{'s' * (number > 1)} of {load} in {name}",
        _time_constant(steps.rate, interval),
        tuple(warnings),
    )


def _require_gravity(gravity: float | None, mass: float | None) -> float:
    """Return the gravity of a mass, m/s2; raise InputError if it is not one on the earth."""
    if gravity is None:
        return STANDARD_GRAVITY
    if mass is None:
        refuse("calibrate(): gravity is stated with a force", "gravity with a mass")
    require_number("calibrate(): gravity", gravity)
    low, high = ALLOWED_GRAVITY
    if not low <= gravity <= high:
        refuse_value("calibrate(): gravity", gravity, f"{low} to {high} m/s2, such as 9.81")
    return gravity


def _step_warnings(
    steps: Steps, stated: Rate | None, interval: float | None, load: str
) -> list[str]:
    """Return warnings on steps in one direction, and on a stated time constant that differs."""
    warnings = []
    if (steps.signs[1:] == steps.signs[:-1]).any():
        warnings.append(
            "the record has steps in the same direction one after the other: each is taken to be "
            f"the whole known force, {load}, not a part of it"
        )
    if stated and interval and steps.shown:
        difference = abs(stated.value - steps.shown.value)
        if difference > SIGNIFICANT * math.hypot(stated.uncertainty, steps.shown.uncertainty):
            stated_time, shown_time = (
                f"{interval / rate.value:.4g} s" if rate.value else "no droop"
                for rate in (stated, steps.shown)
            )
            warnings.append(
                f"the stated time constant, {stated_time}, differs from the one that the record "
                f"shows, {shown_time}, by more than their uncertainties"
            )
    return warnings


def _stated_rate(value: float, uncertainty: float, interval: float | None, name: str) -> Rate:
    """Return the rate per mean of a time constant, s, with a relative standard uncertainty."""
    if value != math.inf:
        require_number("calibrate(): time_constant", value)
    require_number("calibrate(): time_constant_uncertainty", uncertainty)
    if not value > 0 or not 0 <= uncertainty <= MAX_STATED:
        refuse(
            f"calibrate(): time_constant = {value:g} s, uncertainty = {uncertainty:g}",
            f"a positive time, 0 <= uncertainty <= {MAX_STATED:g}",
        )
    if interval is None:
        refuse(f"{name}: the sample rate is not known", "a column of times, or no time constant")
    return Rate(interval / value, interval / value * uncertainty)


def _time_constant(rate: Rate, interval: float | None) -> TimeConstant | None:
    """Return the time constant of a rate per mean; None if the interval is unknown."""
    if interval is None:
        return None
    highest = rate.value + BOUND * rate.uncertainty
    minimum = interval / highest if highest > 0 else math.inf
    if rate.value <= SIGNIFICANT * rate.uncertainty:
        return TimeConstant(math.inf, 0.0, minimum)
    return TimeConstant(interval / rate.value, rate.uncertainty / rate.value, minimum)


class Source(NamedTuple):
    """Values of one channel: name for messages, unit or "", samples, and their number and rate.

    The full scale is the largest value that the format can hold, None if it is not known.
    """

    name: str
    unit: str
    samples: Callable[[int, int], NDArray[np.float64]]
    n_sample: int
    sample_rate: float | None
    full_scale: float | None
    unapplied: str = ""


def open_source(
    record: Signal | str | os.PathLike[str], channel: int | str | None, unit: str | None = None
) -> Source:
    """Return the values of a channel of a file, or of a signal, in their own unit."""
    if isinstance(record, Signal):
        symbol = "" if unit is None else require_unit(unit, record.name)
        return Source(
            record.name, symbol, record.read, record.n_sample, record.sample_rate, record.full_scale
        )
    path = regular_file(record)
    name = shown_path(path)
    channels = choose_channels(read_channels(path), channel, name)
    if len(channels) != 1:
        refuse(
            f"{name}: has {len(channels)} channels of force",
            f"channel (--channel) = one of {channel_choices(channels)}",
        )
    (selected,) = channels
    symbol = find_unit(selected.unit) if unit is None else require_unit(unit, path.name)
    # Integers are read as fractions of full scale.
    full_scale = 1.0 if selected.counts else None
    return Source(
        name,
        symbol,
        selected.samples,
        selected.n_sample,
        selected.sample_rate,
        full_scale,
        shown_text(selected.unapplied),
    )


def _means(samples: Callable[[int, int], NDArray[np.float64]], count: int) -> Level:
    """Return the means, minima and maxima of the sections of a record."""
    width = max(1, count // MEANS)
    # Blocks of complete sections, few because each read opens the file.
    step = width * max(1, BLOCK // width)
    stop = count - count % width
    blocks = (samples(start, min(start + step, stop)) for start in range(0, stop, step))
    sections = [block.reshape(-1, width) for block in blocks]
    reduced = [(part.mean(axis=1), part.min(axis=1), part.max(axis=1)) for part in sections]
    return Level(*np.concatenate([np.zeros((3, 0)), *map(np.stack, reduced)], axis=1))
