"""Search of drops in a signal, assignment of bounces to them, and the samples around them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import median_filter, uniform_filter1d
from scipy.signal import find_peaks, peak_widths
from tqdm import tqdm

from thud.base.checks import refuse
from thud.base.immutable import Immutable, freeze
from thud.base.note import Note
from thud.level.estimate import Estimate

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from thud.recordings.instruments import Chain
    from thud.recordings.signal import Signal

# Pulses are searched in means over cells, each CELL seconds long; BLOCK cells are read at a time.
CELL = 1e-3
BLOCK = 4_096
# Number of cells in a segment, whose median is the baseline, and of cells in a contact at most.
SEGMENT = 1_000
CONTACT = 25
# A pulse must rise above RISE standard deviations of the noise or RISE_FRACTION of the maximum,
# whichever is less, and above MIN_HEIGHT times the maximum, which must exceed MIN_DEVIATIONS
# standard deviations of the noise.
RISE = 6.0
RISE_FRACTION = 0.4
MIN_HEIGHT = 0.03
MIN_DEVIATIONS = 4.0
# The height of a pulse is that above the higher one of the lowest forces before and after it,
# within WINDOW cells in all. It is at least MIN_PROMINENCE times that above the lower one, and that
# above the baseline: else the force does not return, or stays above 30 % between two peaks.
WINDOW = 400
MIN_PROMINENCE = 0.7
# A pulse starts and ends MARGIN cells beyond the points where it falls below FOOT times its height.
FOOT = 0.2
MARGIN = 2
# Maximum duration above half the height, cells: contacts of balls and tyres last 12 to 40 ms.
MAX_DURATION = 60
# The search begins this long before a section, s, so that a bounce in it is not taken for a drop.
LOOK_BACK = 1.5
# A drop is measured only if it is chosen, as it may be a tap or a knock, if its peak is below this
# fraction of that of the highest.
MIN_DROP = 0.25
# A pulse is neither a drop nor its bounce if its peak is below this fraction of that of the contact
# from which it would bounce, or of the highest (a drop from a fortieth of the height).
MIN_BOUNCE = 0.15
# A pulse whose peak reaches this fraction of the previous peak is a new drop. The limits of the
# standards let a ball return with 0.9 of its velocity, and the force follows the velocity.
NEW_DROP = 0.93
# Longest flight, s: 2 v0/g for a drop height of 2 m.
MAX_FLIGHT = 1.3
# Length of the signal before and after a pulse, and distance to the pulses next to it, s.
BEFORE = 0.25
AFTER = 0.5
GUARD = 2e-3
# Maximum length of the background on either side of the contact, s: a longer one lowers the noise
# of the offset by less than 5 %. Margin between them, s.
MAX_BACKGROUND = 0.1
BACKGROUND_MARGIN = 2e-3
# Minimum length of the background on either side of a contact, s and samples.
MIN_BACKGROUND = 1e-3
MIN_SAMPLES = 4
# Minimum rate, Hz: twice the upper edge of the octave of 500 Hz, with a margin for a filter.
MIN_RATE = 2_000.0
# Deviation of a sample from the cubic through the samples 2 and 3 away from it, as a weighted sum.
FROM_CUBIC = np.array([0.4, -0.9, 0.0, 1.0, 0.0, -0.9, 0.4])


@dataclass(frozen=True, eq=False, repr=False)
class Stage(Immutable):
    """What a stage of a measurement returns: its arrays are read-only, and it can be drawn."""

    def __repr__(self) -> str:
        """Return the numbers and names of the stage in one line, without its arrays."""
        values = [(entry.name, getattr(self, entry.name)) for entry in fields(self)]
        values = [(k, v) for k, v in values if isinstance(v, str | float | Estimate)]
        shown = [f"{k} {v:.6g}" if isinstance(v, float) else f"{k} {v!r}" for k, v in values]
        return f"<{': '.join(filter(None, (type(self).__name__, ', '.join(shown))))}>"

    def plot(self) -> Figure:
        """Draw what the stage has measured or changed."""
        from thud.plot.stage_figures import draw_stage

        return draw_stage(self)


@dataclass(frozen=True)
class Pulse:
    """Where a drop, or a bounce, lies in a signal.

    Attributes
    ----------
    section : tuple of int
        First and stop index of the pulse and its background, up to the pulses next to it.
    contact : tuple of int
        First and stop index of the contact, accurate to about 1 ms.
    peak : float
        Height above the background, N.
    name : str
        Name of the drop, as ``"file.wav, drop 3"``.
    bounces : tuple of Pulse
        Bounces after the drop.
    left_out : Note or None
        Why the drop is measured only if it is chosen.
    notes : tuple of Note
        Possible faults of the pulse as a whole.
    """

    section: tuple[int, int]
    contact: tuple[int, int]
    peak: float
    name: str = ""
    bounces: tuple[Pulse, ...] = ()
    left_out: Note | None = None
    notes: tuple[Note, ...] = ()


@dataclass(frozen=True)
class Quantization:
    """Errors due to quantization with a step, N, that noise does not average.

    `density` is the one-sided density of the error during the contact, N2/Hz, and `offset` the
    standard deviation of the error of the mean background, N.
    """

    step: float = 0.0
    density: float = 0.0
    offset: float = 0.0


@dataclass(frozen=True, eq=False, repr=False)
class Section(Stage):
    """Samples of a signal around one drop or bounce.

    `repair` and `correct` of `thud.recordings` take a section and return one.

    Attributes
    ----------
    name : str
        Name of the drop.
    force : ndarray, shape (n_sample,)
        Force, N.
    sample_rate : float
        Samples per second, Hz.
    start : int
        Index of the first sample in the signal.
    contact : tuple of int
        First and stop index of the contact in the section.
    bounce : Section or None
        Section of the first bounce; None if there is none, or no background on both sides of it.
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
    bounce: Section | None = None
    cells: tuple[Section, ...] = ()
    full_scale: float | None = None
    quantization: Quantization = field(default_factory=Quantization)
    chain: Chain | None = None
    notes: tuple[Note, ...] = ()

    @cached_property
    def offset(self) -> float:
        """Median of the force before and after the contact, N."""
        return float(np.median(np.delete(self.force, slice(*self.contact))))

    @cached_property
    def roughness(self) -> NDArray[np.float64]:
        """Deviation of each sample from a cubic through samples on both sides, N, shape (n,)."""
        return freeze(np.convolve(np.pad(self.force, 3, mode="edge"), FROM_CUBIC, mode="valid"))

    @property
    def noise(self) -> float:
        """Standard deviation of the white noise of a sample in the contact, N."""
        deviation = robust_deviation(self.roughness[slice(*self.contact)])
        return deviation / math.sqrt(float(FROM_CUBIC @ FROM_CUBIC))


def find_drops(
    signal: Signal, begin: float = 0.0, end: float = math.inf, *, progress: bool = False
) -> tuple[list[Pulse], list[Note]]:
    """Return the drops in a signal that begin between two times, s, and notes on other pulses.

    The signal is read in blocks, of which the means over cells are kept. Raise InputError if there
    is no impact, the section is empty, or the rate is too low.
    """
    rate, name = signal.sample_rate, signal.name
    section = min(int(begin * rate), signal.n_sample)
    first, stop = max(0, section - round(LOOK_BACK * rate)), int(min(end * rate, signal.n_sample))
    if not section < stop:
        refuse(
            f"{name}: there are no samples from {begin:g} to {end:g} s",
            f"times from 0 to {signal.n_sample / rate:.4g} s, the first one below the second",
        )
    if not rate >= MIN_RATE:
        refuse(f"{name}: sample_rate = {rate:g} Hz is too low", f"at least {MIN_RATE:g} Hz")
    width = max(1, round(rate * CELL))
    means = []
    starts = range(first, stop, BLOCK * width)
    for start in tqdm(starts, unit="block", desc=name, disable=not progress, leave=False):
        force = signal.read(start, min(start + BLOCK * width, stop))
        bounds = np.arange(0, len(force), width)
        means.append(np.add.reduceat(force, bounds) / np.diff(bounds, append=len(force)))
    pulses = _find_pulses(np.concatenate(means), first, stop, rate)
    drops, ignored = _assign_bounces(pulses, section, rate)
    if not drops:
        refuse(f"{name}: no impact", "a pulse of 12 to 40 ms that rises above the noise")
    names = [f"{name}, drop {k}" if len(drops) > 1 else name for k in range(1, len(drops) + 1)]
    return [replace(drop, name=own) for drop, own in zip(drops, names, strict=True)], ignored


def cut_section(signal: Signal, pulse: Pulse) -> Section:
    """Return the samples around a drop and around its first bounce."""
    first, stop = pulse.section
    contact = pulse.contact[0] - first, pulse.contact[1] - first
    rate = signal.sample_rate
    cells = tuple(
        Section(cell.name, cell.read(first, stop), rate, first, contact, full_scale=cell.full_scale)
        for cell in signal.cells
    )
    force = np.sum([cell.force for cell in cells], axis=0) if cells else signal.read(first, stop)
    bounce = None
    if pulse.bounces:
        bounce = cut_section(signal, replace(pulse.bounces[0], name=f"{pulse.name}, bounce 1"))
        length = min(bounce.contact[0], len(bounce.force) - bounce.contact[1])
        bounce = bounce if length >= max(MIN_BACKGROUND * rate, MIN_SAMPLES) else None
    return Section(
        pulse.name, force, rate, first, contact, bounce, cells, signal.full_scale,
        notes=pulse.notes,
    )  # fmt: skip


def robust_deviation(values: NDArray[np.float64]) -> float:
    """Return the standard deviation of normal values about zero, by their median magnitude."""
    return 1.4826 * float(np.median(np.abs(values)))


def _find_pulses(cells: NDArray[np.float64], first: int, stop: int, rate: float) -> list[Pulse]:
    """Return the pulses in the cells of a signal from a first to before a stop sample."""
    # The median removes spikes, which are shorter than contacts.
    level = uniform_filter1d(median_filter(cells, 3, mode="nearest"), 3, mode="nearest")
    # The baseline is the median of segments; of a single one, that of the cells without a contact.
    count = max(len(cells) // SEGMENT, 1)
    size = len(cells) // count
    fraction = max(0.5 * (size - CONTACT) / size, 0.08) if count == 1 else 0.5
    medians = np.quantile(cells[: count * size].reshape(count, size), fraction, axis=1)
    level -= np.interp(np.arange(len(cells)), (np.arange(count) + 0.5) * size, medians)
    below = -level[level < 0]
    deviation = robust_deviation(below) if below.size else 0.0
    highest = float(level.max())
    if highest <= max(MIN_DEVIATIONS * deviation, 1e-9):
        return []
    least = max(min(RISE * deviation, RISE_FRACTION * highest), MIN_HEIGHT * highest)
    # The first and the last cell may be peaks, and the first of equal ones is the peak.
    level -= 1e-12 * highest * np.arange(len(level))
    level = np.pad(level, 1)
    tops, found = find_peaks(level, height=least, prominence=least, wlen=WINDOW)
    heights = found["prominences"]
    bases = heights, found["left_bases"], found["right_bases"]
    duration, *_ = peak_widths(level, tops, 0.5, bases)
    *_, low, high = peak_widths(level, tops, 1 - FOOT, bases)
    # A force that stays at a step has another base on either side.
    rise = level[tops] - np.minimum(0.0, level[np.array(bases[1:])].min(axis=0))
    is_pulse = (heights > MIN_PROMINENCE * rise) & (duration < MAX_DURATION)
    # The first cell of the level is before the signal.
    width, guard = max(1, round(rate * CELL)), round(GUARD * rate)
    starts = np.maximum(np.ceil(low[is_pulse]) - 1 - MARGIN, 0).astype(int) * width + first
    stops = (np.floor(high[is_pulse]) + MARGIN).astype(int) * width + first
    stops = np.minimum(stops, stop)
    # A section ends before the pulses next to it.
    begins = np.maximum(starts - round(BEFORE * rate), np.append(first, stops + guard)[:-1])
    ends = np.minimum(stops + round(AFTER * rate), np.append(starts - guard, stop)[1:])
    bounds = np.minimum(begins, starts), np.maximum(ends, stops), starts, stops
    return [
        Pulse((begin, end), (start, after), peak)
        for peak, begin, end, start, after in zip(
            *(values.tolist() for values in (heights[is_pulse], *bounds)), strict=True
        )
    ]


def _assign_bounces(
    pulses: Sequence[Pulse], section: int, rate: float
) -> tuple[list[Pulse], list[Note]]:
    """Return the drops from a sample on with their bounces, and notes on the other pulses there.

    Drops below MIN_DROP times the highest pulse are left out, with their numbers.
    """
    groups: list[list[Pulse]] = []
    ignored: list[Note] = []
    flight = MAX_FLIGHT
    highest = max((p.peak for p in pulses if p.contact[0] >= section), default=0.0)
    for pulse in pulses:
        gap = ratio = math.inf
        if groups:
            last = groups[-1][-1]
            gap, ratio = (pulse.contact[0] - last.contact[1]) / rate, pulse.peak / last.peak
        in_flight = gap < 1.02 * flight
        bounced = in_flight and ratio < NEW_DROP
        time = {"time": pulse.contact[0] / rate}
        if pulse.peak < MIN_BOUNCE * (last.peak if bounced else highest):
            ignored.append(Note("pulse_ignored", value=pulse.peak, unit="N", others=time))
        elif bounced:
            groups[-1].append(pulse)
            flight = gap
            if groups[-1][0].contact[0] < section <= pulse.contact[0]:
                ignored.append(Note("bounce_ignored", others=time))
        else:
            left_out, notes = None, pulse.notes
            if pulse.peak < MIN_DROP * highest:
                size = {"peak": pulse.peak, "fraction": MIN_DROP}
                left_out = Note("drop_too_small", others=size)
            elif in_flight and not groups[-1][0].left_out:
                notes = (Note("drop_like_bounce", value=gap, unit="s", others={"ratio": ratio}),)
            groups.append([replace(pulse, left_out=left_out, notes=notes)])
            flight = MAX_FLIGHT
    drops = [replace(drop, bounces=tuple(bounces)) for drop, *bounces in groups]
    return [drop for drop in drops if drop.contact[0] >= section], ignored
