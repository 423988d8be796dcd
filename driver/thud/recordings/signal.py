"""Recorded channels as forces in newtons: opened, calibrated, added, and plausible."""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse, require_number, shown, shown_text
from thud.base.errors import InputError
from thud.base.files import regular_file
from thud.base.immutable import Immutable, freeze
from thud.base.note import Note
from thud.base.units import find_unit, size_of
from thud.level.levels import finite_array
from thud.recordings.config import HINT, POLARITIES, SUM, Config
from thud.recordings.force_units import ALLOWED, EXAMPLES, RECORDED, Calibration, newtons_per_unit
from thud.recordings.formats import MIN_SAMPLES, read_channels

if TYPE_CHECKING:
    import os
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from thud.recordings.formats import Channel, Samples

# Range of sample rates, Hz.
RATES = (1.0, 1e9)
# Peak forces of heavy/soft sources, N: from drops of some centimeters to the tyre on stiff floors.
PEAKS = (300.0, 15000.0)
# Maximum factor beyond this range that a drop height can explain.
MAX_FACTOR = 20.0
# Factors by which a peak in another unit is wrong.
WRONG_UNITS = {"kN": 1000.0, "mN": 0.001}
# Minimum ratio of the peaks of both signs from which the sign is determined.
MIN_PEAK_RATIO = 1.5
# Minimum peak of a load cell of the opposite sign, as a fraction of the peak of the sum, that
# raises a warning.
MIN_OPPOSITE = 0.05
# Number of samples per read, and approximate number from which the background level is estimated.
BLOCK = 2**18
SAMPLED = 2**16
# Minimum and maximum sample rate, Hz: the octave of 500 Hz needs 1.42 kHz and room for a filter.
RECORDER_RATES = (2500.0, 1e8)
# Minimum peak of a channel of force that was not chosen, as a fraction of the chosen peak, that
# raises a warning: without one of four load cells, levels are 2.5 dB too low. If the sum of the
# peaks deviates by less from the chosen peak, this is their sum.
MIN_MISSING = 0.2
MAX_SUM_DEVIATION = 0.1
# A direction at the end of a name: Fx, Force_Y, z1.
AXIS = re.compile(r"(?:^|[^a-z])f?(?P<axis>[xyz])\d*$")


@dataclass(frozen=True, eq=False)
class Signal(Immutable):
    """Force of one channel of a file, N; only requested samples are read.

    Attributes
    ----------
    name : str
        Name of the file, and of the channel if there are several.
    path : str
        Path of the file; empty for an array.
    sample_rate : float
        Samples per second, Hz.
    n_sample : int
        Number of samples.
    samples : ndarray, shape (n_sample,), or callable
        The recorded values, or a function that reads them from a sample to before another one.
    scale : float
        Force per recorded value, N, positive if positive values are compression.
    full_scale : float or None
        Largest force that the sample format can hold, N; None if unknown.
    date : str
        Date of the measurement; empty if unknown.
    calibration : str
        Description of the calibration.
    calibration_uncertainty : float or None
        Relative standard uncertainty of the calibration; None if unknown.
    notes : tuple of Note
        Processing when the file was read, and possible faults; the subject is the name of the
        signal, or of one of its load cells.
    cells : tuple of Signal
        Load cells whose sum this is.
    """

    name: str
    path: str
    sample_rate: float
    n_sample: int
    samples: Samples = field(repr=False)
    scale: float = 1.0
    full_scale: float | None = None
    date: str = ""
    calibration: str = ""
    calibration_uncertainty: float | None = None
    notes: tuple[Note, ...] = ()
    cells: tuple[Signal, ...] = ()

    @classmethod
    def from_array(cls, force: ArrayLike, sample_rate: float, name: str = "recording") -> Signal:
        """Return the signal of a force in memory, N, shape (n_sample,)."""
        values = finite_array(f"{name}: force", force)
        rate = require_number(f"{name}: sample_rate", sample_rate, *RATES, "Hz")
        return cls(name, "", rate, len(values), freeze(values.copy()))

    @cached_property
    def checksum(self) -> str:
        """SHA-256 of the file, or of the values of an array, in hexadecimal digits."""
        if not self.path:
            return hashlib.sha256(self.read(0, self.n_sample).tobytes()).hexdigest()
        try:
            with Path(self.path).open("rb") as file:
                return hashlib.file_digest(file, "sha256").hexdigest()
        except OSError as error:
            refuse(f"{self.name}: cannot be read ({error.strerror})", "a readable file", error)

    def read(self, start: int, stop: int) -> NDArray[np.float64]:
        """Return the force of the samples from start to before stop, N, positive in compression.

        Raise InputError if the file has changed, is damaged, or holds non-finite values.
        """
        if not 0 <= start <= stop <= self.n_sample:
            refuse(f"{self.name}: samples {start} to {stop}", f"samples 0 to {self.n_sample}")
        values = self.samples
        force = values(start, stop) if callable(values) else values[start:stop]
        force = force * self.scale
        if force.shape != (stop - start,):
            problem = f"{force.size} samples from sample {start}, {stop - start} expected"
            refuse(f"{self.name}: {problem}", "a file that is complete and does not change")
        if not np.isfinite(force).all():
            index = start + int(np.flatnonzero(~np.isfinite(force))[0])
            refuse(f"{self.name}: sample {index + 1} is not finite", "real numbers")
        return force


def add_signals(cells: Sequence[Signal], name: str) -> Signal:
    """Return the sum of signals of equal rate and length."""
    first = cells[0]
    notes: list[Note] = []
    known = [cell.calibration_uncertainty for cell in cells]
    for cell in cells:
        if (cell.n_sample, cell.sample_rate) != (first.n_sample, first.sample_rate):
            refuse(
                f"{cell.name}: {cell.n_sample} samples at {cell.sample_rate:g} Hz, "
                f"{first.n_sample} at {first.sample_rate:g} Hz in {first.name}",
                "channels that were recorded together",
            )
        common = [replace(note, subject=name) for note in cell.notes]
        notes += [note for note in common if note not in notes]
    return replace(
        first, name=name, samples=partial(_read_sum, tuple(cells)), scale=1.0, full_scale=None,
        calibration="; ".join(dict.fromkeys(cell.calibration for cell in cells)),
        # The reference of all calibrations is usually the same.
        calibration_uncertainty=None if None in known else max(value or 0.0 for value in known),
        notes=(*notes, Note("cells_added", name, len(cells))), cells=tuple(cells),
    )  # fmt: skip


def _read_sum(cells: tuple[Signal, ...], start: int, stop: int) -> NDArray[np.float64]:
    return np.asarray(np.sum([cell.read(start, stop) for cell in cells], axis=0))


def find_peaks(signal: Signal) -> tuple[float, float]:
    """Return the largest deviations of a force above and below its background level, N.

    Raise InputError if values are not finite or all equal.
    """
    low, high = np.inf, -np.inf
    stride = max(1, signal.n_sample // SAMPLED)
    thinned = []
    for start in range(0, signal.n_sample, BLOCK):
        block = signal.read(start, min(signal.n_sample, start + BLOCK))
        low, high = min(low, float(block.min())), max(high, float(block.max()))
        thinned.append(block[-start % stride :: stride].copy())
    if low == high:
        refuse(f"{signal.name}: all samples are {low:g}", "a recording of drops")
    thin = np.concatenate(thinned)
    edge = max(1, thin.size // 100)
    # If the pulse fills the record, the background is at one end only; with many drops, overall.
    levels = [float(np.median(section)) for section in (thin[:edge], thin[-edge:], thin)]
    middle = low + (high - low) / 2
    background = max(levels, key=lambda level: abs(level - middle))
    return high - background, background - low


def orient(signal: Signal, polarity: str | None = None) -> Signal:
    """Return a signal whose compression is positive, with notes on its peak and its load cells.

    With a stated polarity it is positive already. A single load cell may be lifted, so that the
    sum decides on the sign. Raise InputError if the sign is not clear, if the peak is impossible,
    or if all samples of the signal or of a load cell are equal.
    """
    notes: list[Note] = []
    up, down = find_peaks(signal)
    if not polarity and max(up, down) < MIN_PEAK_RATIO * min(up, down):
        problem = f"the sign is not clear, the peaks are {up:.4g} N and {-down:.4g} N"
        allowed = "polarity = 'positive' or 'negative', the sign of a compression"
        refuse(f"{signal.name}: {problem}", allowed, subject="polarity")
    if not polarity and down > up:
        notes.append(Note("sign_changed", signal.name, -down, unit="N"))
        cells = tuple(replace(cell, scale=-cell.scale) for cell in signal.cells)
        signal, up, down = replace(signal, scale=-signal.scale, cells=cells), down, up
    name, (low, high) = signal.name, PEAKS
    if not low <= up <= high:
        allowed = f"{low:g} to {high:g} N for heavy/soft sources"
        if any(note.code == "unit_assumed" for note in signal.notes):
            unknown = f"{name}: the values are without a unit and reach {up:.4g}"
            refuse(unknown, f"{allowed}, or unit")
        if low <= down <= high:
            cause = "the polarity is wrong, or the force does not return from its peak"
            refuse(f"{name}: the peaks are {-down:.4g} N and {up:.4g} N; {cause}", allowed)
        if not low / MAX_FACTOR <= up <= high * MAX_FACTOR:
            fitting = [unit for unit, size in WRONG_UNITS.items() if low <= up * size <= high]
            mends = [f"unit = {unit!r}" for unit in fitting] + ["a calibration"]
            problem = f"{name}: the peak is {up:.4g} N; unit or calibration is wrong"
            refuse(problem, f"{allowed}; {', or '.join(mends)}")
        notes.append(Note("peak_unusual", name, up, low, high, "N"))
    if down > MIN_PEAK_RATIO * up:
        others: dict[str, float | str] = {"opposite": -down}
        notes.append(Note("polarity_doubtful", name, up, unit="N", others=others))
    for cell in signal.cells:
        above, below = find_peaks(cell)
        if below > max(MIN_PEAK_RATIO * above, MIN_OPPOSITE * up):
            others = {"part": cell.name, "total": up}
            notes.append(Note("cell_sign", value=-below, unit="N", others=others))
    return replace(signal, notes=(*signal.notes, *notes))


def open_signals(
    path: str | os.PathLike[str] | Signal, config: Config | None = None
) -> list[Signal]:
    """Open a recording; see docs/recordings_reading.md for the formats.

    Parameters
    ----------
    path
        File, whose content determines the format, or a signal, of which peak and sign are checked.
    config
        What is stated on the file by `channel` or `channels`, `unit`, `calibration`, `polarity`
        and `sample_rate`.

    Returns
    -------
    list of Signal
        One for each channel, or the sum of `channels`.

    Raises
    ------
    InputError
        If the file is missing, damaged, too large or of unknown format, if channel, unit, rate,
        calibration or sign are unknown, or if the force is implausible.
    """
    if isinstance(path, Signal):
        return [path if path.path else orient(path, "positive")]
    config = config or Config()
    file = regular_file(path)
    channels = read_channels(file)
    chosen, others = choose_channels(channels, config, shown_text(file))
    stated = config.calibration
    calibrations = stated if isinstance(stated, tuple) else (stated,) * len(chosen)
    if len(calibrations) != len(chosen):
        channel_count = f"{len(chosen)} channel{'s' * (len(chosen) > 1)}"
        problem = f"{shown_text(file)}: {len(calibrations)} calibrations for {channel_count}"
        refuse(problem, "one calibration, or one for each entry of channels")
    name = shown_text(file.name)
    names = [f"{name}, {entry.title}" if len(channels) > 1 else name for entry in chosen]
    try:
        signals = [
            _in_newtons(file, channel, own, calibration, config)
            for channel, own, calibration in zip(chosen, names, calibrations, strict=True)
        ]
        if config.channels is not None:
            titles = " + ".join(channel.title for channel in chosen)
            signals = [add_signals(signals, f"{name}, {titles}")]
        signals = [orient(signal, config.polarity) for signal in signals]
    except InputError as error:
        if len(chosen) == 1 or config.channels is not None:
            raise
        message = f"{error}; if several channels are forces: {HINT}"
        raise InputError(message, error.note) from error
    if others and not any(calibrations):
        signals = [_with_missing(signals[0], file, others)]
    return signals


def choose_channels(
    channels: list[Channel], config: Config, name: str
) -> tuple[list[Channel], list[Channel]]:
    """Return the stated channels, by default those of force, or the only channel.

    If they are forces, the other forces follow. Raise InputError if it is unclear which, or a
    channel is not in the file.
    """
    forces = [channel for channel in channels if size_of(channel.unit)[0] == "N"]
    chosen, stated = forces or channels, config.channels
    if stated is not None and config.channel is not None:
        refuse(f"{name}: both channel and channels are stated", "one of them", subject="channel")
    if config.channel is not None:
        chosen = [_find_channel(channels, config.channel, name)]
    elif isinstance(stated, tuple):
        chosen = [_find_channel(channels, channel, name) for channel in stated]
        if len({cell.number for cell in chosen}) < len(chosen):
            refuse(f"{name}: channels = {shown(stated)} names one channel twice", "each once")
    elif stated is not None:
        _refuse_sum(chosen, channels, name, are_forces=bool(forces))
    elif not forces and len(channels) > 1:
        refuse(
            f"{name}: has {len(channels)} channels, none of them in a unit of force",
            f'channel = one of {channel_choices(channels)}; or channels = "{SUM}" for load '
            "cells of one plate",
        )
    are_forces = all(channel in forces for channel in chosen)
    return chosen, [force for force in forces if are_forces and force not in chosen]


def _refuse_sum(
    cells: list[Channel], channels: list[Channel], name: str, *, are_forces: bool
) -> None:
    """Raise InputError if the sum of all cells is that of none, one or different directions."""
    if len(cells) < 2 or (not are_forces and len({cell.unit for cell in cells}) > 1):  # noqa: PLR2004
        refuse(
            f'{name}: channels = "{SUM}" needs two or more channels of force, or all in one unit',
            f"names of channels, some of {channel_choices(channels)}",
        )
    matches = [AXIS.search(cell.title.rpartition("/")[2].strip().casefold()) for cell in cells]
    if len({match["axis"] for match in matches if match}) > 1:
        listed = ", ".join(cell.title for cell in cells)
        refuse(
            f'{name}: channels = "{SUM}" would add forces of different directions, {listed}',
            "the names of the vertical forces, such as channels = 'z1+z2+z3+z4'",
        )


def channel_choices(channels: list[Channel]) -> str:
    """Return the numbers and names of channels for a message."""
    return ", ".join(
        f"{entry.number}" + (f" {shown_text(entry.name)!r}" if entry.name else "")
        for entry in channels[:20]
    )


def _find_channel(channels: list[Channel], channel: int | str, name: str) -> Channel:
    """Return the channel of a number or name; raise InputError if none or several match."""
    title = str(channel).strip().casefold()
    matching = [entry for entry in channels if channel in {entry.number, entry.name}]
    for entry in channels if not matching else ():
        own = entry.name.casefold()
        if title in {str(entry.number), own, own.rpartition("/")[2]}:
            matching.append(entry)
    if len(matching) != 1:
        problem = f"{name}: channel = {shown(channel)} matches {len(matching)} channels"
        refuse(problem, f"one of {channel_choices(channels)}", subject="channel")
    return matching[0]


def _in_newtons(  # noqa: C901 - each branch is a check
    file: Path, channel: Channel, name: str, calibration: float | Calibration | None, config: Config
) -> Signal:
    """Return a channel in N; raise InputError if its rate or unit is unknown.

    Its sign is that of the file, or with a stated polarity that of a compression.
    """
    if channel.n_sample < MIN_SAMPLES:
        refuse(f"{name}: {channel.n_sample} samples", f"{MIN_SAMPLES} samples or more")
    unit, notes = _unit(channel, config.unit, calibration, name)
    rate = channel.sample_rate if config.sample_rate is None else config.sample_rate
    if rate is None:
        allowed = "sample_rate in Hz, or a column of times in s"
        refuse(f"{name}: the sample rate is not known", allowed, subject="sample_rate")
    low, high = RECORDER_RATES
    if not low <= rate <= high:
        refuse(f"{name}: the sample rate is {rate:.6g} Hz", f"{low:g} to {high:g} Hz")
    if channel.sample_rate not in {None, rate}:
        of_file = {"of_file": channel.sample_rate or 0.0}
        notes.insert(0, Note("rate_replaced", value=rate, unit="Hz", others=of_file))
    notes = [*channel.notes, *notes]
    if channel.unapplied:
        unapplied = shown_text(channel.unapplied)
        if calibration is None:
            refuse(
                f"{name}: the file states {unapplied}, but not whether its values were multiplied "
                "by it",
                "calibration = N per stored value, such as 1 if the values are in N",
                subject="calibration",
            )
        notes.append(Note("factor_not_applied", others={"factor": unapplied}))
    base, scale = size_of(unit)
    description, uncertainty = f"values in {unit}", None
    if calibration is not None:
        scale, description, uncertainty = newtons_per_unit(unit, calibration, channel.counts, name)
    elif base != "N":
        described = "full-scale values" if unit == "FS" else description
        problem = f"{name}: enter a calibration: the file holds {described}"
        refuse(problem, EXAMPLES, subject="calibration")
    # Integers are read as fractions of full scale.
    if channel.counts and unit == "counts":
        scale *= channel.counts
    if config.polarity is not None:
        # It refers to the recorded values, before the calibration.
        scale = POLARITIES[config.polarity] * abs(scale)
        if scale < 0:
            notes.append(Note("sign_stated", others={"polarity": config.polarity}))
    return Signal(
        name, str(file), rate, channel.n_sample, channel.samples, scale,
        abs(scale) if channel.counts else None, shown_text(channel.date), description, uncertainty,
        tuple(replace(note, subject=name) for note in notes),
    )  # fmt: skip


def _unit(
    channel: Channel, stated: str | None, calibration: float | Calibration | None, name: str
) -> tuple[str, list[Note]]:
    """Return the unit of a channel: stated, of the file, or from which the calibration leads."""
    of_file = find_unit(channel.unit)
    if stated is not None:
        if of_file == "FS" and stated not in {"FS", "counts"}:
            refuse(
                f"{name}: the samples are integers, not values in {stated}",
                "calibration per full scale, such as '10 V/FS, 4 mV/N' or '5000 N/FS'",
            )
        replaced = Note("unit_replaced", unit=stated, others={"of_file": of_file})
        return stated, [] if of_file in {"", "FS", stated} else [replaced]
    if of_file in RECORDED:
        return of_file, []
    if channel.unit:
        refuse(
            f"{name}: the values are in {shown_text(channel.unit)!r}", f"unit = one of {ALLOWED}"
        )
    if calibration is None:
        return "N", [Note("unit_assumed", unit="N")]
    if not isinstance(calibration, Calibration):
        return "", []
    # A chain for another file would change a table in N or kN without a trace.
    if not calibration.unit or (calibration.unit == "FS" and not channel.may_be_fractions):
        refuse(f"{name}: the values are without a unit", f"unit = one of {ALLOWED}")
    return calibration.unit, [Note("unit_of_calibration", unit=calibration.unit)]


def _with_missing(signal: Signal, file: Path, others: list[Channel]) -> Signal:
    """Return a signal with a warning if channels of force that were not chosen hold more of it."""
    own, peaks = find_peaks(signal)[0], {}
    for entry in others:
        try:
            force = _in_newtons(file, entry, entry.title, None, Config())
            peaks[entry.title] = max(find_peaks(force))
        except InputError:  # it holds no signal
            continue
    large = [title for title, peak in peaks.items() if peak > MIN_MISSING * own]
    if not large or abs(sum(peaks.values()) / own - 1) < MAX_SUM_DEVIATION:
        return signal
    note = Note("forces_left_out", signal.name, others={"channels": ", ".join(large)})
    return replace(signal, notes=(*signal.notes, note))
