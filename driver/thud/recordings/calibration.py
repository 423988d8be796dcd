"""Calibration, N per unit, from a record of a known force, also behind an amplifier that droops."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg import block_diag
from scipy.special import fdtrc

from thud.base.checks import refuse, require_number, shown_text
from thud.base.files import regular_file
from thud.base.note import Note
from thud.base.units import find_unit
from thud.recordings.config import Config
from thud.recordings.force_units import ALLOWED, Calibration, require_unit
from thud.recordings.formats import read_channels
from thud.recordings.signal import Signal, channel_choices, choose_channels

if TYPE_CHECKING:
    import os

    from numpy.typing import NDArray

# Standard gravity, m/s2, with which a mass is weighed if the local gravity is not stated; its range
# at sea level, from the equator to the poles; and that of stated values, also on high mountains.
STANDARD_GRAVITY = 9.80665
SEA_LEVEL = (9.780, 9.833)
ALLOWED_GRAVITY = (9.76, 9.84)
# A record is reduced to about this many means, read by blocks of this many samples.
MEANS = 4096
BLOCK = 2**20
# Time within which a step changes the level, s, and its maximum as a fraction of the record; the
# fraction of the largest change within it that is a step; means in the running median that ignores
# knocks.
LAG = 0.7
MAX_LAG = 1 / 12
STEP = 0.5
MEDIAN = 5
# Fraction of a plateau that is ignored at either end, and minimum number of means of the rest. The
# rest is reduced to this many means, between which noise is hardly correlated.
SETTLING = 0.15
MIN_PLATEAU = 6
N_MEAN = 24
# A plateau is clipped if more than CUT of its sections reach CLIPPED of full scale, or the extreme
# of the record while another plateau has noise of more than MIN_NOISE steps of quantization.
CUT = 0.2
CLIPPED = 0.999
MIN_NOISE = 3.0
# Standard deviations from zero at which a droop, or a second one, is significant, and those of a
# bound with 95 %.
SIGNIFICANT = 3.0
BOUND = 1.645
# Degree of the polynomials that search for other curvature of a plateau, and the probability of
# noise below which it is significant. Its root mean square affects the step by up to MISFIT_WEIGHT
# times as much; more than MAX_MISFIT of the step is refused.
DEGREE = 3
NOISE_PROBABILITY = 1e-4
MISFIT_WEIGHT = 30.0
MAX_MISFIT = 1e-2
# Maximum decay within the lag, in time constants: a faster one is hardly distinguished from a step.
MAX_DECAY = 0.5
# Range of a known force, N, or mass, kg; maximum relative uncertainty of it, and of the step.
KNOWN = (1e-3, 1e9)
MAX_KNOWN_UNCERTAINTY = 0.5
MAX_UNCERTAINTY = 0.1


def calibrate(  # noqa: PLR0913 - the keys of the configuration
    record: Signal | str | os.PathLike[str],
    *,
    force: float | None = None,
    mass: float | None = None,
    channel: int | str | None = None,
    unit: str | None = None,
    gravity: float | None = None,
    uncertainty: float = 0.0,
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

    Returns
    -------
    Calibration
        The uncertainty includes that of the step: from the residuals and the time constant, or
        from the scatter of several steps, whichever is larger. Notes name what was assumed.

    Raises
    ------
    InputError
        If force and mass are both stated or both missing, or the record is clipped or has no
        clear step, or its decay fits no time constant.
    """
    if (force is None) == (mass is None):
        refuse("calibrate(): state either force or mass", "force in N or mass in kg")
    if mass is None and gravity is not None:
        refuse("calibrate(): gravity is stated with a force", "gravity with a mass")
    local = STANDARD_GRAVITY if gravity is None else gravity
    require_number("calibrate(): gravity", local, *ALLOWED_GRAVITY, "m/s2")
    require_number("calibrate(): uncertainty", uncertainty, 0.0, MAX_KNOWN_UNCERTAINTY)
    if mass is None:
        newtons = require_number("calibrate(): force", force, *KNOWN, "N")
        load = f"{newtons:.6g} N"
    else:
        newtons = local * require_number("calibrate(): mass", mass, *KNOWN, "kg")
        load = f"{mass:g} kg (g = {local:g} m/s2)"
    signal, symbol, unapplied = open_source(record, channel, unit)
    if not symbol:
        refuse(f"{signal.name}: the values are without a unit", f"unit = one of {ALLOWED}")
    steps, notes = _measure_steps(signal)
    size, number = float(np.abs(steps.changes).mean()), len(steps.changes)
    if steps.uncertainty > MAX_UNCERTAINTY * size:
        doubt = f"an uncertainty of {steps.uncertainty:.2g} {symbol}"
        allowed = f"an uncertainty up to {MAX_UNCERTAINTY:.0%}"
        refuse(f"{signal.name}: the step of {size:.4g} {symbol} has {doubt}", allowed)
    spread = 0.0
    if (steps.changes[1:] * steps.changes[:-1] > 0).any():
        notes.append(Note("steps_in_one_direction", value=newtons, unit="N"))
    if unapplied:
        notes.append(Note("stored_values_calibrated", others={"factor": unapplied}))
    if not uncertainty:
        notes.append(Note("known_force_uncertain"))
    if mass is not None and gravity is None:
        low, high = SEA_LEVEL
        # The standard deviation of a rectangular distribution.
        spread = (high - low) / math.sqrt(12) / STANDARD_GRAVITY
        others = {"spread": spread}
        notes.append(Note("gravity_assumed", "", local, low, high, "m/s2", others=others))
    return Calibration(
        f"{newtons / size!r} N/{symbol}",
        math.hypot(steps.uncertainty / size, uncertainty, spread),
        f"{number} step{'s' * (number > 1)} of {load} in {signal.name}",
        tuple(notes),
    )


def open_source(
    record: Signal | str | os.PathLike[str], channel: int | str | None, unit: str | None = None
) -> tuple[Signal, str, str]:
    """Return one channel of a file, or a signal, in its own unit.

    The sample rate is NaN if it is unknown. Then follow the unit, or an empty text, and a factor of
    the file that is not applied.
    """
    if isinstance(record, Signal):
        return record, "" if unit is None else require_unit(record.name, unit), ""
    path = regular_file(record)
    name = shown_text(path)
    channels, _ = choose_channels(read_channels(path), Config(channel=channel), name)
    if len(channels) != 1:
        allowed = f"channel (--channel) = one of {channel_choices(channels)}"
        refuse(f"{name}: has {len(channels)} channels of force", allowed)
    (source,) = channels
    symbol = find_unit(source.unit) if unit is None else require_unit(path.name, unit)
    rate = math.nan if source.sample_rate is None else source.sample_rate
    # Integers are read as fractions of full scale.
    full_scale = 1.0 if source.counts else None
    signal = Signal(name, str(path), rate, source.n_sample, source.samples, full_scale=full_scale)
    return signal, symbol, shown_text(source.unapplied)


class _Steps(NamedTuple):
    """Changes of the level at the steps, and the standard uncertainty of their mean magnitude.

    Then the rate of the droop per mean, the reciprocal of its time constant, and its standard
    uncertainty, and other curvature of the plateaus.
    """

    changes: NDArray[np.float64]
    uncertainty: float
    rate: float
    rate_uncertainty: float
    misfit: float


def _measure_steps(signal: Signal) -> tuple[_Steps, list[Note]]:
    """Return the steps of a record and a note on the time constant of its amplifier.

    Without times, there is no note. Raise InputError if there is no clear step, if a plateau is
    clipped, or if the level between the steps fits no exponential decay.
    """
    name, width = signal.name, max(1, signal.n_sample // MEANS)
    # NaN if it is unknown.
    interval = width / signal.sample_rate
    level, low, high = _means(signal, width)
    longest = max(1, int(MAX_LAG * len(level)))
    lag = longest if math.isnan(interval) else min(longest, max(1, round(LAG / interval)))
    plateaus = _find_plateaus(level, lag)
    if len(plateaus) < 2 or min(len(plateau) for plateau in plateaus) < MIN_PLATEAU:  # noqa: PLR2004
        refuse(f"{name}: has no clear step", "a known force that is put on or taken off")
    for side, values in (("maximum", high), ("minimum", -low)):
        _refuse_clipped(signal, values, plateaus, side)
    steps = _fit_steps(level, plateaus)
    misfit = steps.misfit / float(np.abs(steps.changes).mean())
    if MISFIT_WEIGHT * misfit > MAX_MISFIT:
        refuse(
            f"{name}: the level between the steps deviates by {misfit:.2g} of the step from any "
            "exponential decay with a drift",
            "an amplifier with one time constant, a force and a temperature that are constant",
        )
    if steps.rate * lag > MAX_DECAY:
        refuse(
            f"{name}: the level decays to 1/e within {1 / steps.rate / len(level):.2g} of the "
            "record, too fast for a step to be distinguished from the decay",
            f"a time constant of {lag / MAX_DECAY / len(level):.2g} of the record or more",
        )
    if math.isnan(interval):
        return steps, []
    minimum = interval / (steps.rate + BOUND * steps.rate_uncertainty)
    if steps.rate <= SIGNIFICANT * steps.rate_uncertainty:
        return steps, [Note("no_droop", low=minimum, unit="s")]
    others = {"uncertainty": steps.rate_uncertainty / steps.rate}
    droop = Note("droop_removed", "", interval / steps.rate, minimum, unit="s", others=others)
    return steps, [droop]


def _means(signal: Signal, width: int) -> NDArray[np.float64]:
    """Return mean, minimum and maximum of each section of a record, shape (3, n_section)."""
    stop = signal.n_sample - signal.n_sample % width
    # Blocks of complete sections, few because each read opens the file.
    step = width * max(1, BLOCK // width)
    means = [np.zeros((3, 0))]
    for start in range(0, stop, step):
        sections = signal.read(start, min(start + step, stop)).reshape(-1, width)
        means.append(np.stack([sections.mean(1), sections.min(1), sections.max(1)]))
    return np.concatenate(means, axis=1)


def _find_plateaus(level: NDArray[np.float64], lag: int) -> list[NDArray[np.int64]]:
    """Return the indices of the means between steps that change the level within a lag."""
    if len(level) <= MEDIAN + lag:
        return []
    smooth = np.median(np.lib.stride_tricks.sliding_window_view(level, MEDIAN), axis=1)
    change = smooth[lag:] - smooth[:-lag]
    index = np.flatnonzero(np.abs(change) > STEP * np.abs(change).max())
    breaks = (np.diff(index) > lag) | (np.diff(np.sign(change[index])) != 0)
    steps = [run for run in np.split(index, np.flatnonzero(breaks) + 1) if run.size]
    # From the first mean of a median and a change to their middle.
    middle = MEDIAN // 2 + (lag + 1) / 2
    begins = [0, *(math.ceil(run[-1] + middle) for run in steps)]
    stops = [*(int(run[0] + middle) for run in steps), len(level)]
    plateaus = []
    for begin, stop in zip(begins, stops, strict=True):
        ignored = max(1, int(SETTLING * (stop - begin)))
        plateaus.append(np.arange(begin + ignored, stop - ignored))
    return plateaus


def _refuse_clipped(
    signal: Signal, values: NDArray[np.float64], plateaus: list[NDArray[np.int64]], side: str
) -> None:
    """Raise InputError if a plateau is at full scale, or at one value while another has noise."""
    parts = [values[plateau] for plateau in plateaus]
    # The quantization of a record is no noise.
    step = float(np.diff(np.unique(np.concatenate(parts))).min(initial=math.inf))
    is_noisy = any(np.median(np.abs(np.diff(part))) > MIN_NOISE * step for part in parts)
    limit = float(values.max()) if is_noisy else math.inf
    if signal.full_scale is not None:
        limit = min(limit, CLIPPED * signal.full_scale)
    for plateau, part in zip(plateaus, parts, strict=True):
        if np.mean(part >= limit) > CUT:
            refuse(
                f"{signal.name}: the plateau from {plateau[0] / len(values):.0%} to "
                f"{plateau[-1] / len(values):.0%} of the record is clipped at the {side} of the "
                f"record, {part.max() if side == 'maximum' else -part.max():.5g}",
                "a measuring range that includes the known force",
            )


def _fit_steps(level: NDArray[np.float64], plateaus: list[NDArray[np.int64]]) -> _Steps:
    """Return the steps between plateaus by linear least squares.

    A first-order high-pass of rate r changes a force f to a level v with v' = f' - r (v - b), where
    b is the level without a force: on plateau k, v + r (integral of v) = f_k + a drift. This is
    linear in f_k, the drift and r, however the force was put on, and whatever decays when the
    record begins.
    """
    parts = [np.array_split(plateau, min(len(plateau), N_MEAN)) for plateau in plateaus]
    # Integrals from the first mean to the middle of each; the mean level is a drift of the first.
    centered = level - level.mean()
    once = np.cumsum(centered) - centered / 2
    twice = np.cumsum(once) - once / 2
    values, position, once, twice = (
        np.array([series[block].mean() for blocks in parts for block in blocks])
        for series in (level, np.arange(len(level)) / len(level), once, twice)
    )
    levels = block_diag(*[np.ones((len(blocks), 1)) for blocks in parts])
    columns = np.column_stack([levels, position, position**2, -once])
    parameters, covariance, residual = _least_squares(columns, values)
    rate, rate_uncertainty = max(float(parameters[-1]), 0.0), math.sqrt(covariance[-1, -1])
    if not rate:  # it fits nothing, but is uncertain
        columns = columns[:, :-1]
        parameters, _, residual = _least_squares(columns, values)
    misfit = _misfit(columns, residual, [len(blocks) for blocks in parts])

    count = len(plateaus)
    changes = np.diff(parameters[:count])
    weights = -np.diff(np.sign(changes), prepend=0, append=0) / len(changes)
    variance = weights @ covariance[:count, :count] @ weights + (MISFIT_WEIGHT * misfit) ** 2
    # A second high-pass in series takes away the integral of the integral, too.
    further, uncertainty, _ = _least_squares(np.column_stack([columns, twice]), values)
    if abs(further[-1]) > SIGNIFICANT * math.sqrt(uncertainty[-1, -1]):
        variance += float(weights @ (further[:count] - parameters[:count])) ** 2
    if len(changes) > 1:
        variance = max(variance, np.abs(changes).var(ddof=1) / len(changes))
    return _Steps(changes, math.sqrt(variance), rate, rate_uncertainty, misfit)


def _least_squares(
    columns: NDArray[np.float64], values: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the parameters of least squares, their covariance, and the residual."""
    scale = np.linalg.norm(columns, axis=0)
    inverse = np.linalg.pinv(columns / scale) / scale[:, None]
    parameters = inverse @ values
    residual = values - columns @ parameters
    variance = residual @ residual / max(len(values) - len(parameters), 1)
    variance = max(float(variance), (1e-12 * float(np.ptp(values))) ** 2)
    return parameters, variance * inverse @ inverse.T, residual


def _misfit(
    columns: NDArray[np.float64], residual: NDArray[np.float64], counts: list[int]
) -> float:
    """Return the root mean square of a residual that curves the plateaus, 0 if it may be noise."""
    curves = [
        np.polynomial.legendre.legvander(np.linspace(-1, 1, count), DEGREE)[:, 1:]
        for count in counts
    ]
    design = np.hstack([columns, block_diag(*curves)])
    design /= np.linalg.norm(design, axis=0)
    parameters, _, rank, _ = np.linalg.lstsq(design, residual, rcond=1e-6)
    rest = float(np.sum((residual - design @ parameters) ** 2))
    explained = float(residual @ residual) - rest
    added, freedom = rank - columns.shape[1], len(residual) - rank
    if freedom < 1 or not rest > 0:
        return 0.0
    probability = fdtrc(added, freedom, explained / added / (rest / freedom))
    return math.sqrt(explained / len(residual)) if probability < NOISE_PROBABILITY else 0.0
