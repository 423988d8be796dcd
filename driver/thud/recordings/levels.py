"""Force exposure levels of recorded drops: background, uncertainty, average and outliers."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import butter, sosfiltfilt
from scipy.stats import t as student

from thud.checks import refuse, require_choice
from thud.levels import force_exposure_levels, get_bands
from thud.recordings.bank import filter_levels

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from thud.recordings.drops import Drop

METHODS = ("exact", "fft", "filter")
# Level above the background, dB, below which a level is only an upper bound, and up to which the
# background is subtracted (ISO 10140-4, ISO 16283-2).
BACKGROUND = (6.0, 15.0)
# Band edge of the low-pass, Hz (paper, section 3), and the order of the Butterworth filter, which
# runs forwards and backwards: 0.004 dB at 708 Hz, 19 dB at the 1.6 kHz of the paper's force plate.
BAND_EDGE = 1250.0
ORDER = 6
# Minimum of the silence that the gate holds before and after the contact, s: what the low-pass
# spreads beyond it is 90 dB below the levels.
MARGIN = 3e-3
# Gates are rounded up to this, s, so that drops share the quadrature.
STEP = 1e-3
# dB per relative change of an energy.
DECIBEL = 10 / math.log(10)
# Probability that any of several drops that differ by chance is marked.
SIGNIFICANCE = 0.05
# Deviation, dB, s or 1, that is rounding and marks no drop.
ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class LevelEstimate:
    """Levels of one drop.

    Attributes
    ----------
    name, bands, method : str
        Name of the drop, ``"octave"`` or ``"third"``, and how the levels were measured.
    level : ndarray, shape (n_band,)
        Force exposure levels, dB; corrected for the background where `flag` says so.
    uncertainty : ndarray, shape (n_band,)
        Combined standard uncertainty of `contributions`, dB.
    measured, background : ndarray, shape (n_band,)
        Levels before the correction, and the level of the noise over the same gate, dB.
    flag : ndarray of str, shape (n_band,)
        ``""``; ``"corrected"``: 6 to 15 dB above the background, which was subtracted;
        ``"background"``: less than 6 dB above it, the level is an upper bound; ``"rate"``: NaN,
        the sample rate is too low for the band.
    contributions : dict of ndarray, shape (n_band,)
        Standard uncertainties, dB: noise, window, method, filter, background.
    steps : tuple of str
        What was done, a sentence each.
    """

    name: str
    bands: str
    method: str
    level: NDArray[np.float64]
    uncertainty: NDArray[np.float64]
    measured: NDArray[np.float64]
    background: NDArray[np.float64]
    flag: NDArray[np.str_]
    contributions: dict[str, NDArray[np.float64]]
    steps: tuple[str, ...]


@dataclass(frozen=True)
class Outlier:
    """A drop that differs from the others by more than chance: marked, never left out.

    Attributes
    ----------
    name, quantity : str
        Name of the drop, and the quantity in which it differs.
    value : float
        Its value.
    score, critical : float
        Deviation from the mean in standard deviations, and the largest one that chance explains.
    """

    name: str
    quantity: str
    value: float
    score: float
    critical: float

    def __str__(self) -> str:
        """Return a sentence."""
        return (
            f"{self.name}: {self.quantity} {self.value:.6g} lies {self.score:.2f} standard "
            f"deviations from the mean of the drops (Grubbs, 5 %: {self.critical:.2f})"
        )


@dataclass(frozen=True, eq=False)
class AverageLevels:
    """Energy average of the levels of drops.

    Attributes
    ----------
    bands, method : str
        As those of the drops.
    names : tuple of str, shape (n_drop,)
        Drops.
    drops : ndarray, shape (n_drop, n_band)
        Level of each drop, dB.
    level, background : ndarray, shape (n_band,)
        Level of the mean energy, corrected for the mean background, and the latter, dB.
    uncertainty : ndarray, shape (n_band,)
        Combined standard uncertainty, dB.
    flag : ndarray of str, shape (n_band,)
        As that of a drop, from the mean energies.
    spread, standard_error : ndarray, shape (n_band,)
        Standard deviation of the drops' levels, and of the average, dB; NaN for a single drop.
    contributions : dict of ndarray, shape (n_band,)
        Standard uncertainties of the average, dB. The repeatability, of ``n_drop - 1`` degrees of
        freedom, holds noise and window, which differ from drop to drop, where it is known.
    outliers : tuple of Outlier
        Drops that differ from the others.
    """

    bands: str
    method: str
    names: tuple[str, ...]
    drops: NDArray[np.float64]
    level: NDArray[np.float64]
    background: NDArray[np.float64]
    uncertainty: NDArray[np.float64]
    flag: NDArray[np.str_]
    spread: NDArray[np.float64]
    standard_error: NDArray[np.float64]
    contributions: dict[str, NDArray[np.float64]]
    outliers: tuple[Outlier, ...] = field(default=())


def measure_levels(
    drop: Drop, bands: str = "octave", method: str = "exact", *, low_pass: bool = False
) -> LevelEstimate:
    """Return the levels of a drop, corrected for the background, with their uncertainty.

    The force within a gate, the contact and at least 3 ms before and after it, is taken; outside,
    it is zero. All methods read this force: ``"exact"`` its band energy, ``"fft"`` the 1 Hz bins of
    a window of 1 s, ``"filter"`` the energy behind filters of class 1.

    Parameters
    ----------
    drop
        Drop of a recording.
    bands
        ``"octave"`` or ``"third"``.
    method
        ``"exact"``, ``"fft"`` or ``"filter"``.
    low_pass
        Whether the force is low-passed at 1.25 kHz before, as in the paper.

    Raises
    ------
    InputError
        Where the method or the bands are not known, or the contact time of the drop is not.
    """
    require_choice("method", method, METHODS)
    force, steps = _gated(drop, low_pass=low_pass)
    rate, edges = drop.sample_rate, get_bands(bands)
    exact = _levels(force, rate, bands, "exact")
    measured = exact if method == "exact" else _levels(force, rate, bands, method)
    noise, spread, shift = _noise_energies(drop, force, bands)
    with np.errstate(divide="ignore"):
        background = 10 * np.log10(noise)
    level, flag, left = _corrected(measured, background)
    energy = 10 ** (level / 10)
    contributions = {
        "noise": DECIBEL * spread / energy,
        "window": DECIBEL * shift / energy,
        "method": np.abs(measured - exact) / math.sqrt(3),
        "filter": _attenuation(edges.upper, rate) / math.sqrt(3) * low_pass,
        "background": left,
    }
    steps = (*steps, f"levels: {_DESCRIPTIONS[method]}", *_background_steps(edges.nominal, flag))
    return LevelEstimate(
        drop.name, bands, method, level, _root_sum(contributions), measured, background, flag,
        contributions, steps,
    )  # fmt: skip


def compare_methods(
    drop: Drop, bands: str = "octave", *, low_pass: bool = False
) -> dict[str, NDArray[np.float64]]:
    """Return the levels of a drop by each method, dB, shape (n_band,), background included."""
    force, _ = _gated(drop, low_pass=low_pass)
    return {method: _levels(force, drop.sample_rate, bands, method) for method in METHODS}


def average_levels(estimates: Sequence[LevelEstimate]) -> AverageLevels:
    """Return the energy average of the levels of drops, their spread and their outliers.

    Raises
    ------
    InputError
        Where there are no drops, or their bands or methods differ.
    """
    if len({(e.bands, e.method) for e in estimates}) != 1:
        refuse("the drops differ in bands or method, or there are none", "levels of one kind")
    first, count = estimates[0], len(estimates)
    drops = np.array([e.level for e in estimates])
    energies = np.array([10 ** (e.measured / 10) for e in estimates])
    with np.errstate(divide="ignore"):
        background = 10 * np.log10(np.mean([10 ** (e.background / 10) for e in estimates], axis=0))
    level, flag, left = _corrected(10 * np.log10(energies.mean(axis=0)), background)
    unknown = np.full(level.shape, np.nan)
    weights = energies / energies.sum(axis=0)
    parts = {
        name: np.array([e.contributions[name] for e in estimates]) for name in first.contributions
    }
    # Relative to the energy of the average, as the energies of the drops add.
    contributions = {
        name: np.sqrt(((weights * part) ** 2).sum(axis=0))
        if name in WITHIN_REPEATABILITY
        else (weights * part).sum(axis=0)
        for name, part in parts.items()
    }
    contributions["background"] = left
    error = unknown
    if count > 1:
        deviation = energies.std(axis=0, ddof=1) / math.sqrt(count)
        error = DECIBEL * deviation / 10 ** (level / 10)
        contributions = {"repeatability": error, **contributions}
    counted = {n: c for n, c in contributions.items() if count == 1 or n not in WITHIN_REPEATABILITY}
    return AverageLevels(
        first.bands, first.method, tuple(e.name for e in estimates), drops, level, background,
        _root_sum(counted), flag, drops.std(axis=0, ddof=1) if count > 1 else unknown, error,
        contributions, _level_outliers(estimates, drops),
    )  # fmt: skip


# Contributions that differ from drop to drop, so that the scatter of drops shows them.
WITHIN_REPEATABILITY = ("noise", "window")


def find_outliers(
    values: Sequence[float] | NDArray[np.float64],
    names: Sequence[str],
    quantity: str,
    uncertainty: Sequence[float] | NDArray[np.float64] | None = None,
    significance: float = SIGNIFICANCE,
) -> tuple[Outlier, ...]:
    """Return the drops whose value differs from that of the others.

    Grubbs' two-sided test, exact for three and more normal values; with ten or more values,
    Rosner's generalisation looks for one outlier in five. A deviation within the expanded
    uncertainty (1.96 times the standard one) of the value itself marks no drop.

    Parameters
    ----------
    values : array_like, shape (n_drop,)
        Values; those that are not finite are left out.
    names
        Names of the drops.
    quantity
        What the values are, for the message.
    uncertainty : array_like, shape (n_drop,), optional
        Standard uncertainties of the values alone.
    significance
        Probability that any of the drops is marked where all differ by chance.
    """
    data = np.asarray(values, dtype=np.float64)
    own = np.zeros(data.shape) if uncertainty is None else np.nan_to_num(uncertainty)
    rest = [int(i) for i in np.flatnonzero(np.isfinite(data))]
    removed: list[Outlier] = []
    last = 0
    for step in range(max(1, len(rest) // 5)):
        count = len(rest)
        if count < 3:  # noqa: PLR2004 - two values lie at the same distance of their mean
            break
        mean, deviation = data[rest].mean(), data[rest].std(ddof=1)
        worst = max(rest, key=lambda i: abs(data[i] - mean))
        distance = abs(data[worst] - mean)
        if distance <= ROUNDING:
            break
        quantile = student.ppf(1 - significance / (2 * count), count - 2)
        critical = (count - 1) / math.sqrt(count) * quantile / math.sqrt(count - 2 + quantile**2)
        score = distance / deviation
        removed.append(Outlier(names[worst], quantity, float(data[worst]), score, critical))
        rest.remove(worst)
        # Rosner: all up to the last that exceeds its critical value are outliers.
        if score > critical and distance > student.ppf(0.975, np.inf) * own[worst]:
            last = step + 1
    return tuple(removed[:last])


def low_pass_force(
    force: NDArray[np.float64], sample_rate: float
) -> tuple[NDArray[np.float64], str]:
    """Return a force below 1.25 kHz, N, shape (n_sample,), without delay, and a sentence on it.

    A Butterworth filter of order 6 runs forwards and backwards; together they are 3.01 dB down at
    1.25 kHz. Where the sample rate, Hz, is too low to hold such frequencies, nothing is done.
    """
    corner = _corner()
    if corner >= sample_rate / 2:
        return force, f"no low-pass at 1.25 kHz: the sample rate, {sample_rate:g} Hz, is one"
    sections = butter(ORDER, corner, fs=sample_rate, output="sos")
    room = min(len(force) - 1, math.ceil(10 * sample_rate / BAND_EDGE))
    filtered: NDArray[np.float64] = sosfiltfilt(sections, force, padlen=max(room, 0))
    return filtered, (
        f"low-pass, -3 dB at 1.25 kHz: Butterworth of order {ORDER}, forwards and backwards "
        "(no delay)"
    )


_DESCRIPTIONS = {
    "exact": "band energy of the force within the gate (exact)",
    "fft": "1 Hz bins of a rectangular window of 1 s, zero outside the gate (fft)",
    "filter": "Butterworth filters of class 1 of IEC 61260-1, the gated force padded until they "
    "have rung out (filter)",
}


def _corner() -> float:
    """Return the corner, Hz, at which one run of the low-pass is 3 dB down; both are 3 dB at 1.25 kHz.

    Two runs attenuate by (1 + (f/corner)**12)**2 in energy, which is 2 at the band edge.
    """
    return float(BAND_EDGE / (math.sqrt(2) - 1) ** (1 / (2 * ORDER)))


def _attenuation(frequency: NDArray[np.float64], sample_rate: float) -> NDArray[np.float64]:
    """Return the attenuation of the low-pass, dB; zero where it is not applied."""
    if _corner() >= sample_rate / 2:
        return np.zeros(frequency.shape)
    warped = np.tan(np.pi * np.minimum(frequency / sample_rate, 0.5))
    ratio = warped / math.tan(math.pi * _corner() / sample_rate)
    return np.asarray(20 * np.log10(1 + ratio ** (2 * ORDER)))


def _gated(drop: Drop, *, low_pass: bool) -> tuple[NDArray[np.float64], tuple[str, ...]]:
    """Return the force of the contact with some silence, zero where not recorded, and the steps."""
    contact, doubt = float(drop.contact_time), drop.contact_time.uncertainty
    if not math.isfinite(contact) or contact <= 0:
        refuse(f"{drop.name}: the contact time is not known", "a drop with one contact")
    force, steps = drop.force, ()
    if low_pass:
        force, sentence = low_pass_force(force, drop.sample_rate)
        steps = (sentence,)
    margin = max(MARGIN, 3 * doubt if math.isfinite(doubt) else MARGIN)
    count = math.ceil(math.ceil((contact + 2 * margin) / STEP) * STEP * drop.sample_rate)
    start = round(float((-margin - drop.time[0]) * drop.sample_rate))
    gated = np.zeros(count)
    source = slice(max(start, 0), max(min(start + count, len(force)), 0))
    if drop.bounces:
        later = math.floor((drop.bounces[0] - drop.time[0]) * drop.sample_rate)
        source = slice(source.start, min(source.stop, later))
    part = force[source]
    gated[source.start - start : source.start - start + len(part)] = part
    words = f"gate: {-1e3 * margin:.1f} to {1e3 * (count / drop.sample_rate - margin):.1f} ms"
    return gated, (*steps, f"{words} after first touch, zero outside")


def _levels(
    force: NDArray[np.float64], rate: float, bands: str, method: str
) -> NDArray[np.float64]:
    """Return levels by a method, dB; NaN where the rate is too low for the band."""
    if method == "filter":
        return filter_levels(force, rate, bands)
    return force_exposure_levels(force, rate, bands, method)


def _corrected(
    measured: NDArray[np.float64], background: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.str_], NDArray[np.float64]]:
    """Return levels corrected for the background, flags, and the correction not made, dB.

    Below 6 dB the correction is that at 6 dB. Above 15 dB there is none, as in the standards; the
    correction left out, up to 0.14 dB, counts as an uncertainty.
    """
    low, high = BACKGROUND
    above = measured - background
    correction = -10 * np.log10(1 - 10 ** (-np.maximum(above, low) / 10))
    made = above <= high
    level = measured - np.where(made, correction, 0.0)
    flag = np.where(above < low, "background", np.where(made, "corrected", ""))
    flag = np.where(np.isnan(measured), "rate", flag)
    return level, flag, np.where(made, 0.0, correction)


def _noise_energies(
    drop: Drop, force: NDArray[np.float64], bands: str
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return expected noise energy, its standard deviation, and that of the offset, N2 s.

    With E = abs(R f)**2 for the band's rows R, force f = s + n and the noise's covariance C:
    mean(E) = abs(R s)**2 + tr(V), var(E) = 4 (R s)' V (R s) + 2 tr(V V), V = R C R'. In a band of
    much more than one degree of freedom, 2 B T, this is 4 E_s S + 2 B T S**2, S the density.
    """
    rate = drop.sample_rate
    rows, transforms, frequency, edges = _quadrature(bands, rate, len(force))
    density = np.maximum(np.nan_to_num(drop.noise.spectrum(frequency)), 0.0)
    density[0] /= 2
    density[-1] /= 2
    step = frequency[1] - frequency[0]
    quiet = _quiet_time(drop)
    # Variance of the mean over the quiet time, as the offset was taken from it.
    lowest = np.array([min(0.5 / quiet, rate / 2)])
    offset = float(np.nan_to_num(drop.noise.spectrum(lowest))[0]) / (2 * quiet)
    measured, ones = rows @ force, rows.sum(axis=1)
    mean, deviation, shift = np.zeros((3, len(edges) - 1))
    for band, (start, stop) in enumerate(zip(edges[:-1], edges[1:], strict=True)):
        part = transforms[start:stop]
        # The real part, of both halves of the spectrum.
        covariance = step * ((part * density) @ part.conj().T).real
        signal, unit = measured[start:stop], ones[start:stop]
        squares = float((covariance**2).sum())
        cross = float(signal @ covariance @ signal)
        mean[band] = np.trace(covariance)
        # The measured signal holds the noise once: its expected part, tr(V V), is taken off.
        variance = max(4 * cross - 2 * squares, 2 * squares)
        # Noise of the estimate of the noise, of 2 B T degrees of freedom in the quiet time.
        width = max(get_bands(bands).upper[band] - get_bands(bands).lower[band], 1 / quiet)
        variance += mean[band] ** 2 / (width * quiet)
        deviation[band] = math.sqrt(variance)
        linear, square = float(signal @ unit), float(unit @ unit)
        shift[band] = math.sqrt(4 * linear**2 * offset + 2 * (square * offset) ** 2)
    return mean, deviation, shift


def _quiet_time(drop: Drop) -> float:
    """Return the duration of the quiet parts from which the noise is known, s."""
    step = 1 / drop.sample_rate
    before = -float(drop.time[0])
    end = drop.bounces[0] if drop.bounces else float(drop.time[-1]) + step
    after = end - float(drop.contact_time)
    source = drop.noise.source
    times = {"before": before, "after": after}
    used = [time for word, time in times.items() if word in source] or [before]
    return max(sum(max(time, 0.0) for time in used), step)


@lru_cache(maxsize=4)
def _quadrature(
    bands: str, rate: float, count: int
) -> tuple[
    NDArray[np.float64], NDArray[np.complex128], NDArray[np.float64], NDArray[np.int64]
]:
    """Return rows R with E_b = sum over the band's rows of (R f)**2, and their transforms.

    Gauss–Legendre nodes in each band, a cosine and a sine each: 2 abs(F(f))**2 is a sum of cosines
    of up to T = count/rate of delay, which B T pi / 2 nodes resolve; twelve more are rounding.

    Returns
    -------
    tuple
        Rows, shape (n_row, count); transforms, shape (n_row, n_frequency), at frequencies, Hz; the
        first row of each band and the end, shape (n_band + 1,).
    """
    edges = get_bands(bands)
    time = np.arange(count) / rate
    rows: list[NDArray[np.float64]] = []
    starts = [0]
    for lower, upper in zip(edges.lower, edges.upper, strict=True):
        number = math.ceil(math.pi * (upper - lower) * count / rate / 2) + 12
        nodes, weights = np.polynomial.legendre.leggauss(number)
        phase = np.pi * ((upper + lower) + (upper - lower) * nodes)[:, None] * time
        scale = np.sqrt((upper - lower) * weights)[:, None] / rate
        rows += [scale * np.cos(phase), scale * np.sin(phase)]
        starts.append(starts[-1] + 2 * number)
    matrix = np.concatenate(rows)
    # Four times the gate resolves the spectrum of noise that is smooth over 1 / (4 T).
    length = 4 * count
    return (
        matrix, np.fft.rfft(matrix, length), np.fft.rfftfreq(length, 1 / rate), np.array(starts),
    )  # fmt: skip


def _root_sum(contributions: dict[str, NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return the combined standard uncertainty."""
    return np.asarray(np.sqrt(np.sum([part**2 for part in contributions.values()], axis=0)))


def _background_steps(nominal: NDArray[np.float64], flag: NDArray[np.str_]) -> tuple[str, ...]:
    """Return sentences on the correction for the background."""
    words = {
        "corrected": "corrected for the background, 6 to 15 dB below",
        "background": "less than 6 dB above the background, an upper bound",
        "rate": "not measured, the sample rate is too low",
    }
    return tuple(
        f"{', '.join(f'{f:g}' for f in nominal[flag == key])} Hz: {what}"
        for key, what in words.items()
        if (flag == key).any()
    )


def _level_outliers(
    estimates: Sequence[LevelEstimate], drops: NDArray[np.float64]
) -> tuple[Outlier, ...]:
    """Return the outliers in any band, at 5 % for all bands together (Bonferroni)."""
    nominal = get_bands(estimates[0].bands).nominal
    names = [e.name for e in estimates]
    own = np.array([np.hypot(e.contributions["noise"], e.contributions["window"]) for e in estimates])
    return tuple(
        outlier
        for band, middle in enumerate(nominal)
        for outlier in find_outliers(
            drops[:, band], names, f"level at {middle:g} Hz, dB,", own[:, band],
            SIGNIFICANCE / len(nominal),
        )
    )  # fmt: skip
