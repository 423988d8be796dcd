"""Search of drops in a signal, and assignment of bounces to them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import median_filter, uniform_filter1d
from tqdm import tqdm

from thud.base.checks import refuse
from thud.base.note import Note
from thud.recordings.differences import robust_deviation
from thud.recordings.quantization import Quantization

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from thud.recordings.response import Chain
    from thud.recordings.signal import Signal

# Pulses are searched in means over cells, each CELL seconds long; BLOCK cells are read at a time.
CELL = 1e-3
BLOCK = 4_096
# Number of cells in a segment; the baseline is interpolated between the medians of the segments.
SEGMENT = 1_000
# A pulse must rise above RISE standard deviations of the noise or RISE_FRACTION of the maximum,
# whichever is less; the maximum must exceed MIN_DEVIATIONS standard deviations of the noise.
RISE = 6.0
RISE_FRACTION = 0.4
MIN_DEVIATIONS = 4.0
# A pulse starts and ends MARGIN cells beyond the points where it falls below FOOT times its peak.
FOOT = 0.2
MARGIN = 2
# Background next to a pulse, in cells from the points at half its height. DISTANCE: the nearest
# distance. LENGTH: the farthest distance on the left, the length on the right.
DISTANCE = 6
LENGTH = 20
# A cell is a spike if it is higher than its neighbors by this factor: contacts are longer.
SPIKE = 3.0
# Maximum gap within one pulse, in cells.
MAX_GAP = 4
# Minimum height of a pulse as a fraction of the highest one of a signal.
MIN_HEIGHT = 0.03
# Duration of a pulse above half its peak, s: contacts of balls and tyres last 12 to 40 ms.
DURATIONS = (0.003, 0.06)
# The search begins this long before a section, s, so that a bounce in it is not taken for a drop.
LOOK_BACK = 1.5
# A drop is measured only if it is chosen, as it may be a tap or a knock, if its peak is below this
# fraction of that of the highest.
MIN_DROP = 0.25
# A pulse is neither a drop nor its bounce if its peak is below this fraction of that of the contact
# from which it would bounce, or of the highest (a drop from a fortieth of the height); or if the
# medians of the forces before and after it, over STEP cells each, differ by this fraction of it.
MIN_BOUNCE = 0.15
MAX_CHANGE = 0.3
STEP = 100
# Two peaks are two impacts if the force between them falls below this fraction of the lower peak.
VALLEY = 0.3
# A pulse whose peak reaches this fraction of the previous peak is a new drop. The limits of the
# standards let a ball return with 0.9 of its velocity, and the force follows the velocity.
NEW_DROP = 0.93
# Longest and shortest flight, s: 2 v0/g for drop heights of 2 m and of 0.5 mm.
MAX_FLIGHT = 1.3
MIN_FLIGHT = 0.02
# Length of a window before and after a pulse, s.
BEFORE = 0.25
AFTER = 0.5
# Minimum rate, Hz: twice the upper edge of the octave of 500 Hz, with a margin for a filter.
MIN_RATE = 2_000.0


@dataclass(frozen=True)
class SecondPeak:
    """A second peak in a pulse, N, the force between both, N, and the time of the first one, s."""

    peak: float
    valley: float
    time: float


@dataclass(frozen=True)
class Pulse:
    """Where a drop, or a bounce, lies in a signal.

    Attributes
    ----------
    name : str
        Name of the drop, as ``"file.wav, drop 3"``.
    section : tuple of int
        First and stop index of the pulse and its background, up to the pulses next to it.
    contact : tuple of int
        First and stop index of the contact, accurate to about 1 ms.
    bounces : tuple of Pulse
        Bounces after the drop.
    second_peak : SecondPeak or None
        A second impact in the pulse.
    left_out : Note or None
        Why the drop is measured only if it is chosen.
    notes : tuple of Note
        Possible faults of the pulse as a whole.
    """

    name: str
    section: tuple[int, int]
    contact: tuple[int, int]
    bounces: tuple[Pulse, ...] = ()
    second_peak: SecondPeak | None = None
    left_out: Note | None = None
    notes: tuple[Note, ...] = ()


@dataclass(frozen=True, eq=False)
class Section:
    """Samples of a signal around one drop or bounce.

    `thud.recordings.repair.repair` and `thud.recordings.response.correct` take a section and return
    one.

    Attributes
    ----------
    name, second_peak
        As in `Pulse`.
    force : ndarray, shape (n_sample,)
        Force, N.
    sample_rate : float
        Samples per second, Hz.
    start : int
        Index of the first sample in the signal.
    contact : tuple of int
        First and stop index of the contact in the section.
    bounces : tuple of Section
        Sections of the bounces after the drop.
    cells : tuple of Section
        Sections of the load cells whose sum this is.
    full_scale : float or None
        Largest force that the sample format can hold, N; None if unknown.
    quantization : Quantization
        Errors of the recorded force by quantization.
    chain : Chain or None
        Instruments whose responses were corrected.
    notes : tuple of Note
        What was done in each stage, and possible faults.
    """

    name: str
    force: NDArray[np.float64]
    sample_rate: float
    start: int
    contact: tuple[int, int]
    bounces: tuple[Section, ...] = ()
    cells: tuple[Section, ...] = ()
    second_peak: SecondPeak | None = None
    full_scale: float | None = None
    quantization: Quantization = field(default_factory=Quantization)
    chain: Chain | None = None
    notes: tuple[Note, ...] = ()

    @property
    def background(self) -> NDArray[np.float64]:
        """Force before and after the contact, N."""
        return np.concatenate([self.force[: self.contact[0]], self.force[self.contact[1] :]])

    def plot(self) -> Figure:
        """Draw the force of the drop and its bounces."""
        from thud.plot.stage_figures import draw_section

        return draw_section(self)


@dataclass
class _Candidate:
    """A pulse: first and stop index in the signal, its height, N, and whether the force stays."""

    start: int
    stop: int
    peak: float
    is_step: bool
    second_peak: SecondPeak | None
    bounces: list[_Candidate] = field(default_factory=list)
    notes: list[Note] = field(default_factory=list)
    left_out: Note | None = None


@dataclass(frozen=True)
class Search:
    """The drops in a signal, in order, and notes on the pulses that are no drops."""

    drops: tuple[Pulse, ...]
    ignored: tuple[Note, ...]


def find_drops(
    signal: Signal, begin: float = 0.0, end: float = math.inf, *, progress: bool = False
) -> Search:
    """Return the drops in a signal that begin between two times, s.

    The signal is read in blocks, of which the means over cells are kept. Raise InputError if there
    is no impact, the section is empty, or the rate is too low.
    """
    rate, name = signal.sample_rate, signal.name
    section = min(int(begin * rate), signal.n_sample)
    first_sample = max(0, section - round(LOOK_BACK * rate))
    stop_sample = int(min(end * rate, signal.n_sample))
    if not section < stop_sample:
        refuse(
            f"{name}: there are no samples from {begin:g} to {end:g} s",
            f"times from 0 to {signal.n_sample / rate:.4g} s, the first one below the second",
        )
    if not rate >= MIN_RATE:
        refuse(f"{name}: sample_rate = {rate:g} Hz is too low", f"at least {MIN_RATE:g} Hz")
    cells = _cell_means(signal, first_sample, stop_sample, progress=progress)
    pulses = _pulses(cells, first_sample, rate)
    highest = max((p.peak for p in pulses), default=0.0)
    pulses = [pulse for pulse in pulses if pulse.peak > MIN_HEIGHT * highest]
    drops, ignored = _assign_bounces(pulses, section, rate)
    before = [pulse for drop in drops if drop.start < section for pulse in (drop, *drop.bounces)]
    ignored += [
        Note("bounce_ignored", others={"time": pulse.start / rate})
        for pulse in before
        if section <= pulse.start
    ]
    drops = [drop for drop in drops if section <= drop.start]
    if not drops:
        refuse(f"{name}: no impact", "a pulse of 12 to 40 ms that rises above the noise")
    located = tuple(_locate(name, rate, drops, pulses, (section, stop_sample)))
    return Search(located, tuple(ignored))


def cut_section(signal: Signal, pulse: Pulse) -> Section:
    """Return the samples around a drop and around its bounces."""
    first, stop = pulse.section
    contact = pulse.contact[0] - first, pulse.contact[1] - first
    parts = [
        Section(part.name, part.read(first, stop), signal.sample_rate, first, contact,
                full_scale=part.full_scale)
        for part in signal.cells or (signal,)
    ]  # fmt: skip
    force = parts[0].force
    for part in parts[1:]:
        force = force + part.force
    return Section(
        pulse.name,
        force,
        signal.sample_rate,
        first,
        contact,
        tuple(cut_section(signal, bounce) for bounce in pulse.bounces),
        tuple(parts) if signal.cells else (),
        pulse.second_peak,
        signal.full_scale,
        notes=pulse.notes,
    )


def _cell_means(
    signal: Signal, first_sample: int, stop_sample: int, *, progress: bool
) -> NDArray[np.float64]:
    """Return the means of a signal over cells, N; the last cell may be shorter."""
    width = max(1, round(signal.sample_rate * CELL))
    starts = range(first_sample, stop_sample, BLOCK * width)
    means = []
    for start in tqdm(starts, unit="block", desc=signal.name, disable=not progress, leave=False):
        force = signal.read(start, min(start + BLOCK * width, stop_sample))
        whole = len(force) // width * width
        means.append(force[:whole].reshape(-1, width).mean(axis=1))
        if whole < len(force):
            means.append(force[whole:].mean(keepdims=True))
    return np.concatenate(means)


def _baseline(cells: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the force between the pulses, N, from medians, or a low quantile of few cells."""
    n = len(cells)
    if n < 2 * SEGMENT:
        # The quantile excludes a contact of up to 25 cells.
        fraction = np.clip(0.5 * (n - 25) / n, 0.08, 0.5)
        return np.full(n, np.quantile(cells, fraction))
    count = n // SEGMENT
    segments = cells[: count * SEGMENT].reshape(count, SEGMENT)
    middle = (np.arange(count) + 0.5) * SEGMENT
    return np.interp(np.arange(n), middle, np.median(segments, axis=1))


def _without_spikes(cells: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return cells of which single ones that are far above their neighbors have the median."""
    middle = np.median(cells)
    neighbors = median_filter(cells, 3, mode="nearest")
    height = cells - middle
    is_spike = (height > SPIKE * (neighbors - middle)) & (height > height.max() / 2)
    return np.where(is_spike, neighbors, cells)


def _pulses(cells: NDArray[np.float64], first: int, rate: float) -> list[_Candidate]:
    """Return the pulses in cells; `first` is the first sample of the cells."""
    width = max(1, round(rate * CELL))
    level = uniform_filter1d(_without_spikes(cells), 3, mode="nearest") - _baseline(cells)
    below = -level[level < 0]
    deviation = robust_deviation(below) if below.size else 0.0
    highest = float(level.max(initial=0.0))
    threshold = min(RISE * deviation, RISE_FRACTION * highest)
    if highest <= max(MIN_DEVIATIONS * deviation, 1e-9):
        return []
    above = np.flatnonzero(level > max(threshold, 0.01 * highest))
    groups = np.split(above, np.flatnonzero(np.diff(above) > MAX_GAP) + 1)
    pulses: list[_Candidate] = []
    for group in groups:
        top = int(group[0] + np.argmax(level[group[0] : group[-1] + 1]))
        earliest = -(-(pulses[-1].stop - first) // width) if pulses else 0
        if top < earliest:
            continue
        low, high = (_find_edge(level, top, step, level[top] / 2) for step in (-1, 1))
        # A maximum on the flank of a higher pulse is noise.
        if level[low : high + 1].max() > level[top]:
            continue
        if not DURATIONS[0] <= (high - low + 1) * width / rate <= DURATIONS[1]:
            continue
        # Slow noise moves the background next to the pulse away from the baseline.
        left, right = (
            level[max(earliest, low - LENGTH) : low - DISTANCE],
            level[high + DISTANCE :][:LENGTH],
        )
        backgrounds = [np.quantile(side, 0.4) if side.size else 0.0 for side in (left, right)]
        begin = max(low - SEGMENT, 0)
        fraction = (np.arange(begin, min(high + SEGMENT, len(level))) - low) / max(high - low, 1)
        line = np.interp(fraction, (0, 1), backgrounds)
        corrected = level[begin : begin + len(line)] - line
        peak = float(corrected[top - begin])
        edges = (
            begin + _find_edge(corrected, side - begin, step, FOOT * peak)
            for side, step in ((low, -1), (high, 1))
        )
        start, stop = (edge + step for edge, step in zip(edges, (-MARGIN, 1 + MARGIN), strict=True))
        start = max(start, earliest)
        group_start = max(group[0], earliest, begin) - begin
        second_peak = _second_peak(
            corrected[group_start : group[-1] + 1 - begin], (first + top * width) / rate
        )
        span = first + start * width, first + stop * width
        # A second impact next to this one is shorter than half of STEP.
        sides = (
            level[max(low - DISTANCE - STEP, 0) : low - DISTANCE],
            level[high + DISTANCE :][:STEP],
        )
        change = [float(np.median(side)) if side.size else 0.0 for side in sides]
        is_step = abs(change[1] - change[0]) > MAX_CHANGE * peak
        pulses.append(_Candidate(*span, peak, is_step, second_peak))
    return pulses


def _find_edge(envelope: NDArray[np.float64], start: int, direction: int, threshold: float) -> int:
    """Return the last cell above the threshold; two successive cells below it end the pulse."""
    edge = start
    while 0 <= edge + direction < len(envelope) and (
        envelope[edge + direction] > threshold
        or (
            0 <= edge + 2 * direction < len(envelope) and envelope[edge + 2 * direction] > threshold
        )
    ):
        edge += direction
    return edge


def _second_peak(envelope: NDArray[np.float64], time: float) -> SecondPeak | None:
    """Return the second of two peaks of a pulse that a deep valley separates, if there is one."""
    top = int(np.argmax(envelope))
    for side in (envelope[top:], envelope[: top + 1][::-1]):
        lowest = np.minimum.accumulate(side)
        k = int(np.argmax(side - lowest))
        if lowest[k] < VALLEY * side[k] and side[k] > VALLEY * envelope[top]:
            return SecondPeak(float(side[k]), float(lowest[k]), time)
    return None


def _assign_bounces(
    pulses: list[_Candidate], section: int, rate: float
) -> tuple[list[_Candidate], list[Note]]:
    """Return the drops with their bounces, and the pulses that are neither.

    Drops below MIN_DROP times the highest pulse from the sample `section` on are left out, with
    their numbers.
    """
    drops: list[_Candidate] = []
    ignored: list[Note] = []
    flight = MAX_FLIGHT
    before: _Candidate | None = None
    highest = max((p.peak for p in pulses if not p.is_step and p.start >= section), default=0.0)
    for pulse in pulses:
        gap = np.inf if before is None else (pulse.start - before.stop) / rate
        in_flight = before is not None and MIN_FLIGHT < gap < 1.02 * flight
        ratio = pulse.peak / before.peak if before else np.inf
        bounced = in_flight and ratio < NEW_DROP
        lowest = MIN_BOUNCE * (before.peak if bounced and before else highest)
        if pulse.is_step or pulse.peak < lowest:
            time = {"time": pulse.start / rate}
            ignored.append(Note("pulse_ignored", value=pulse.peak, unit="N", others=time))
            continue
        if bounced:
            drops[-1].bounces.append(pulse)
            flight = gap
        else:
            if pulse.peak < MIN_DROP * highest:
                size = {"peak": pulse.peak, "fraction": MIN_DROP}
                pulse.left_out = Note("drop_too_small", others=size)
            elif before is not None and in_flight and not before.left_out:
                others = {"ratio": float(ratio)}
                pulse.notes.append(
                    Note("drop_like_bounce", value=float(gap), unit="s", others=others)
                )
            drops.append(pulse)
            flight = MAX_FLIGHT
        before = pulse
    return drops, ignored


def _locate(
    name: str,
    rate: float,
    drops: list[_Candidate],
    pulses: list[_Candidate],
    limits: tuple[int, int],
) -> Iterator[Pulse]:
    """Yield the drops with their sections, which end before the pulses next to them."""
    indices = {id(p): k for k, p in enumerate(pulses)}
    guard, (first_sample, stop_sample) = round(2 * CELL * rate), limits

    def locate(pulse: _Candidate, title: str) -> Pulse:
        k = indices[id(pulse)]
        low = pulses[k - 1].stop + guard if k else first_sample
        high = pulses[k + 1].start - guard if k + 1 < len(pulses) else stop_sample
        low = max(low, pulse.start - round(BEFORE * rate))
        high = min(high, pulse.stop + round(AFTER * rate), stop_sample)
        stop = min(pulse.stop, stop_sample)
        bounces = tuple(
            locate(bounce, f"{title}, bounce {j}") for j, bounce in enumerate(pulse.bounces, 1)
        )
        return Pulse(
            title, (min(low, pulse.start), max(high, stop)), (pulse.start, stop), bounces,
            pulse.second_peak, pulse.left_out, tuple(pulse.notes),
        )  # fmt: skip

    for k, drop in enumerate(drops, start=1):
        yield locate(drop, name if len(drops) == 1 else f"{name}, drop {k}")
