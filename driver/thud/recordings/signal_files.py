"""Recorded files as signals in newtons."""

from __future__ import annotations

import errno
import math
import os
import stat
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse, require_choice, require_kind, require_number, shown
from thud.base.errors import InputError
from thud.base.note import Note
from thud.recordings.channel import MIB, MIN_SAMPLES, Channel, shown_path, shown_text
from thud.recordings.force_units import (
    ALLOWED,
    ASSUMED,
    UNITS,
    Calibration,
    find_unit,
    newtons_per_unit,
    plain_number,
    require_unit,
    unit_of_chain,
)
from thud.recordings.formats import read_channels
from thud.recordings.load_cells import (
    HINT,
    SUM,
    add_signals,
    check_signs,
    refuse_directions,
    require_channels,
)
from thud.recordings.polarity import BLOCK, POLARITIES, check_peak, find_sign, scan
from thud.recordings.signal import Signal

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    AnyCalibration = float | str | Calibration

# Minimum and maximum sample rate, Hz: the octave of 500 Hz needs 1.42 kHz and room for a filter.
RATES = (2500.0, 1e8)
# Minimum stored fraction of a file, below which it is sparse, and maximum number of pieces counted.
MIN_STORED = 0.01
MAX_PIECES = 1000
# Minimum correlation with the sum of a channel in another unit that raises a warning.
MIN_SIMILAR = 0.9
# Minimum peak of a channel of force that was not chosen, as a fraction of the chosen peak, that
# raises a warning, and maximum deviation of the sum of such peaks from the chosen peak if it is
# their sum.
MIN_MISSING = 0.2
MAX_SUM_DEVIATION = 0.1


def open_signals(  # noqa: PLR0913 - the keys of the configuration
    path: str | os.PathLike[str],
    *,
    channel: int | str | None = None,
    channels: str | Sequence[int | str] | None = None,
    unit: str | None = None,
    calibration: AnyCalibration | Sequence[AnyCalibration] | None = None,
    polarity: str | None = None,
    sample_rate: float | None = None,
) -> list[Signal]:
    """Open a recording; see docs/recordings_reading.md for the formats.

    Parameters
    ----------
    path
        File; its content determines the format.
    channel
        Number, from 1 (in tables that of the column), or name; by default all channels in units of
        force, or the only channel.
    channels
        Channels of load cells under one plate, whose forces are added: ``"sum"`` for all channels
        in units of force (all channels, if none is), ``"F1+F2+F3+F4"``, or a list.
    unit
        Unit of the recorded values, if the file does not state it or is wrong.
    calibration
        N per unit, a chain of factors such as ``"4.1 pC/N, 10 mV/pC"``, or a `Calibration`; with
        `channels` also a list with one for each of them.
    polarity
        Sign of a compression in the file, ``"positive"`` or ``"negative"``; by default that of
        the larger peak.
    sample_rate
        Samples per second, Hz, if the file does not state it or is wrong.

    Returns
    -------
    list of Signal

    Raises
    ------
    InputError
        If the file is missing, damaged, too large or of unknown format, if channel, unit, rate,
        calibration or sign are unknown, or if the force is implausible.
    """
    if polarity is not None:
        require_choice("polarity", polarity, POLARITIES)
    stated_unit = None if unit is None else require_unit(unit, "recording")
    if sample_rate is not None:
        require_number("sample_rate", sample_rate)
    if channel is not None and channels is not None:
        refuse("recording: both channel and channels are stated", "one of them")
    file = regular_file(path)
    name = shown_path(file)
    entries = read_channels(file)
    if channels is not None:
        cells = _choose_cells(entries, require_channels(channels), name)
        each = _calibrations(calibration, len(cells), name)
        stated = [_Stated(stated_unit, entry, polarity, sample_rate) for entry in each]
        signal = _with_others(_sum(file, cells, stated), cells, entries)
        return [signal if any(each) else _with_missing(signal, cells, entries)]
    chosen = choose_channels(entries, channel, name)
    each = _calibrations(calibration, 1, name)
    result = _Stated(stated_unit, each[0], polarity, sample_rate)
    try:
        signals = [_signal(file, entry, result, several=len(entries) > 1) for entry in chosen]
        if channel is None or result.calibration:
            return signals
        return [_with_missing(signals[0], chosen, entries)]
    except InputError as error:
        if len(chosen) == 1:
            raise
        message = f"{error}; if several channels are forces: {HINT}"
        raise InputError(message) from error


def _calibrations(
    calibration: AnyCalibration | Sequence[AnyCalibration] | None, count: int, name: str
) -> Sequence[AnyCalibration | None]:
    """Return a calibration for each of a number of channels."""
    if isinstance(calibration, str) or not isinstance(calibration, Sequence):
        return [plain_number(calibration)] * count
    if len(calibration) != count:
        refuse(
            f"{name}: {len(calibration)} calibrations for {count} channel{'s' * (count > 1)}",
            "one calibration, or one for each entry of channels",
        )
    return [plain_number(entry) for entry in calibration]


def _choose_cells(
    entries: list[Channel], channels: str | tuple[int | str, ...], name: str
) -> list[Channel]:
    """Return the channels of load cells; raise InputError if the selection is ambiguous."""
    if isinstance(channels, tuple):
        cells = [choose_channels(entries, channel, name)[0] for channel in channels]
        if len({cell.number for cell in cells}) < len(cells):
            refuse(f"{name}: channels = {shown(channels)} names one channel twice", "each once")
        return cells
    forces = [entry for entry in entries if _is_force(entry)]
    cells = forces or entries
    if len({cell.unit for cell in cells}) > 1 and not forces:
        listed = ", ".join(f"{shown_text(cell.name)!r}" for cell in cells[:20])
        refuse(
            f'{name}: channels = "{SUM}" would add channels in different units',
            f"names of channels, some of {listed}",
        )
    if len(cells) < 2:  # noqa: PLR2004 - a sum
        refuse(f'{name}: channels = "{SUM}" finds {len(cells)} channel of force', "two or more")
    refuse_directions([shown_text(cell.name) for cell in cells], name)
    return cells


def _with_missing(signal: Signal, chosen: list[Channel], entries: list[Channel]) -> Signal:
    """Return a signal with a warning if channels that were not chosen hold more of the force."""
    numbers = {entry.number for entry in chosen}
    others = [entry for entry in entries if entry.number not in numbers and _is_force(entry)]
    if not others or not all(map(_is_force, chosen)):
        return signal
    own = scan(signal.read, signal.n_sample, signal.name).peak(1.0)
    peaks = {}
    for entry in others:
        scale = UNITS[find_unit(entry.unit)][1]
        try:
            extremes = scan(entry.samples, entry.n_sample, signal.name)
        except InputError:  # it holds no signal
            continue
        peaks[shown_text(entry.name) or str(entry.number)] = max(
            extremes.peak(scale), extremes.peak(-scale)
        )
    large = [name for name, peak in peaks.items() if peak > MIN_MISSING * own]
    # The chosen channel may be the sum of the others.
    if not large or abs(sum(peaks.values()) / own - 1) < MAX_SUM_DEVIATION:
        return signal
    note = Note("forces_left_out", signal.name, others={"channels": ", ".join(large)})
    return replace(signal, notes=(*signal.notes, note))


def _with_others(signal: Signal, chosen: list[Channel], entries: list[Channel]) -> Signal:
    """Return a sum with a warning if a channel in another unit has the same shape."""
    numbers = {entry.number for entry in chosen}
    others = [
        entry
        for entry in entries
        if entry.number not in numbers and find_unit(entry.unit) and not _is_force(entry)
    ]
    similar = [
        f"{shown_text(entry.name) or entry.number} [{shown_text(entry.unit)}]"
        for entry in others
        if entry.n_sample == signal.n_sample and _correlation(signal, entry) > MIN_SIMILAR
    ]
    if not similar:
        return signal
    note = Note("channels_similar", signal.name, others={"channels": ", ".join(similar)})
    return replace(signal, notes=(*signal.notes, note))


def _correlation(signal: Signal, channel: Channel) -> float:
    """Return the magnitude of the correlation coefficient of a force and a channel."""
    sums = np.zeros((3, 3))
    for start in range(0, signal.n_sample, BLOCK):
        stop = min(start + BLOCK, signal.n_sample)
        rows = np.stack(
            [np.ones(stop - start), signal.read(start, stop), channel.samples(start, stop)]
        )
        sums += rows @ rows.T
    covariance = sums[1:, 1:] - np.outer(sums[0, 1:], sums[0, 1:]) / signal.n_sample
    variance = float(covariance[0, 0] * covariance[1, 1])
    # A channel may be constant or not finite.
    return abs(float(covariance[0, 1])) / math.sqrt(variance) if variance > 0 else 0.0


def _is_force(channel: Channel) -> bool:
    return UNITS.get(find_unit(channel.unit), ("",))[0] == "N"


def regular_file(path: str | os.PathLike[str]) -> Path:
    """Return a path; raise InputError if it is not a readable, completely stored regular file.

    Opening a pipe could block, and reading a sparse file of gigabytes would take minutes.
    """
    require_kind("recording", path, str | os.PathLike)
    file = Path(path)
    name = shown_path(file)
    try:
        status = file.stat()
        if stat.S_ISREG(status.st_mode):
            with file.open("rb") as opened:
                stored = _stored(opened.fileno(), status.st_size)
    except OSError as error:
        reason = os.strerror(error.errno or errno.EIO)
        refuse(f"{name}: cannot be read ({reason})", "a file that can be read", error)
    except ValueError as error:  # a zero byte
        refuse(f"{shown(name)}: cannot be read", "the path of a file", error)
    if not stat.S_ISREG(status.st_mode):
        kind = "a directory" if stat.S_ISDIR(status.st_mode) else "no regular file"
        refuse(f"{name}: is {kind}", "a file")
    if status.st_size > MIB and stored < MIN_STORED * status.st_size:
        refuse(
            f"{name}: {status.st_size / MIB:.0f} MiB of which {stored / MIB:.1f} MiB are stored",
            "a complete file",
        )
    return file


def _stored(descriptor: int, size: int) -> int:
    """Return the number of stored bytes of a file; its size if it has too many pieces."""
    position = stored = 0
    for _ in range(MAX_PIECES):
        try:
            begin = os.lseek(descriptor, position, os.SEEK_DATA)
            position = os.lseek(descriptor, begin, os.SEEK_HOLE)
        except OSError as error:
            # ENXIO: no more data; else the file system does not know.
            return stored if error.errno == errno.ENXIO else size
        stored += position - begin
        if position >= size:
            return stored
    return size


def channel_choices(channels: list[Channel]) -> str:
    """Return the numbers and names of channels for a message."""
    return ", ".join(
        f"{entry.number}" + (f" {shown_text(entry.name)!r}" if entry.name else "")
        for entry in channels[:20]
    )


def choose_channels(channels: list[Channel], channel: int | str | None, name: str) -> list[Channel]:
    """Return the selected channels; raise InputError if the selection is ambiguous."""
    choices = channel_choices(channels)
    if channel is None:
        forces = [entry for entry in channels if _is_force(entry)]
        if not forces and len(channels) > 1:
            refuse(
                f"{name}: has {len(channels)} channels, none of them in a unit of force",
                f'channel = one of {choices}; or channels = "{SUM}" for load cells of one plate',
            )
        return forces or channels
    matching = [entry for entry in channels if channel in {entry.number, entry.name}]
    if not matching and isinstance(channel, str):
        title = channel.strip().casefold()
        matching = [
            entry
            for entry in channels
            if title
            in {str(entry.number), entry.name.casefold(), entry.name.rpartition("/")[2].casefold()}
        ]
    if len(matching) != 1:
        refuse(
            f"{name}: channel = {shown(channel)} matches {len(matching)} channels",
            f"one of {choices}",
        )
    return matching


@dataclass(frozen=True)
class _Stated:
    """What the user states about the values in a file."""

    unit: str | None
    calibration: AnyCalibration | None
    polarity: str | None
    sample_rate: float | None


def _signal(path: Path, channel: Channel, stated: _Stated, *, several: bool) -> Signal:
    """Return the signal of a channel with the sign of a compression."""
    signal, scale, assumed = _scaled(path, channel, stated, several=several)
    extremes = scan(channel.samples, channel.n_sample, signal.name)
    sign, changed = find_sign(extremes, scale, stated.polarity, signal.name)
    return replace(
        signal,
        samples=partial(_read_scaled, channel.samples, sign * scale),
        notes=(
            *signal.notes,
            *changed,
            *check_peak(extremes, sign * scale, signal.name, assumed=assumed),
        ),
    )


def _sum(path: Path, channels: list[Channel], stated: list[_Stated]) -> Signal:
    """Return the sum of load cells with the sign of a compression.

    A single load cell may be lifted, so that the sum decides on the sign.
    """
    scaled = [
        _scaled(path, channel, entry, several=True)
        for channel, entry in zip(channels, stated, strict=True)
    ]
    polarity = stated[0].polarity
    signs = [POLARITIES[polarity] * float(np.sign(s)) if polarity else 1.0 for _, s, _ in scaled]
    readers = [
        partial(_read_scaled, channel.samples, sign * scale)
        for channel, sign, (_, scale, _) in zip(channels, signs, scaled, strict=True)
    ]
    cells = [
        replace(cell, samples=reader) for reader, (cell, _, _) in zip(readers, scaled, strict=True)
    ]
    titles = [shown_text(channel.name) or str(channel.number) for channel in channels]
    name = f"{shown_path(Path(path.name))}, {' + '.join(titles)}"
    total = add_signals(cells, name)
    extremes = scan(total.read, total.n_sample, name)
    sign, changed = find_sign(extremes, 1.0, None, name) if polarity is None else (1.0, ())
    if sign < 0:
        cells = [replace(cell, samples=partial(_read_scaled, cell.samples, sign)) for cell in cells]
        total = add_signals(cells, name)
    assumed = any(entry for _, _, entry in scaled)
    added = Note("cells_added", name, len(cells))
    warnings = check_peak(extremes, sign, name, assumed=assumed)
    warnings += check_signs(total, extremes.peak(sign))
    return replace(total, notes=(*total.notes, *changed, added, *warnings))


def _scaled(
    path: Path, channel: Channel, stated: _Stated, *, several: bool
) -> tuple[Signal, float, bool]:
    """Return a channel in N, its N per value, and whether its unit is assumed.

    Raise InputError if its rate or unit is unknown.
    """
    name = shown_path(Path(path.name))
    if several:
        name += f", {shown_text(channel.name) or f'channel {channel.number}'}"
    if channel.n_sample < MIN_SAMPLES:
        refuse(f"{name}: {channel.n_sample} samples", f"{MIN_SAMPLES} samples or more")
    rate, rate_notes = _rate(channel, stated, name)
    unit, unit_notes = _unit(channel, stated, name)
    if channel.unapplied:
        unapplied = shown_text(channel.unapplied)
        if stated.calibration is None:
            refuse(
                f"{name}: the file states {unapplied}, but not whether its values were multiplied "
                "by it",
                "calibration = N per stored value, such as 1 if the values are in N",
            )
        unit_notes += (Note("factor_not_applied", name, others={"factor": unapplied}),)
    factor, description, uncertainty = newtons_per_unit(
        unit, stated.calibration, channel.counts, name
    )
    # Integers are read as fractions of full scale.
    scale = factor * channel.counts if channel.counts and unit == "counts" else factor
    signal = Signal(
        name=name,
        path=str(path),
        sample_rate=rate,
        n_sample=channel.n_sample,
        samples=partial(_read_scaled, channel.samples, scale),
        full_scale=abs(scale) if channel.counts else None,
        date=shown_text(channel.date),
        calibration=description,
        calibration_uncertainty=uncertainty,
        notes=(
            *(replace(note, subject=name) for note in channel.notes),
            *rate_notes,
            *unit_notes,
        ),
    )
    return signal, scale, unit == ASSUMED


def _rate(channel: Channel, stated: _Stated, name: str) -> tuple[float, tuple[Note, ...]]:
    rate = channel.sample_rate if stated.sample_rate is None else float(stated.sample_rate)
    if rate is None:
        coarse = [note for note in channel.notes if note.code == "date_times_coarse"]
        reason = "".join(f" ({note})" for note in coarse)
        refuse(
            f"{name}: the sample rate is not known{reason}",
            "sample_rate in Hz, or a column of times",
        )
    if not RATES[0] <= rate <= RATES[1]:
        refuse(f"{name}: the sample rate is {rate:.6g} Hz", f"{RATES[0]:g} to {RATES[1]:g} Hz")
    if channel.sample_rate in {None, rate}:
        return rate, ()
    of_file = {"of_file": channel.sample_rate or 0.0}
    return rate, (Note("rate_replaced", name, rate, unit="Hz", others=of_file),)


def _unit(channel: Channel, stated: _Stated, name: str) -> tuple[str, tuple[Note, ...]]:
    file_unit = find_unit(channel.unit)
    if stated.unit is not None:
        if file_unit == "FS" and stated.unit not in {"FS", "counts"}:
            refuse(
                f"{name}: the samples are integers, not values in {stated.unit}",
                "calibration per full scale, such as '10 V/FS, 4 mV/N' or '5000 N/FS'",
            )
        if file_unit in {"", "FS", stated.unit}:
            return stated.unit, ()
        of_file = {"of_file": file_unit}
        return stated.unit, (Note("unit_replaced", name, unit=stated.unit, others=of_file),)
    if file_unit:
        return file_unit, ()
    if not channel.unit and stated.calibration is None:
        return ASSUMED, (Note("unit_assumed", name, unit="N"),)
    if channel.unit or isinstance(stated.calibration, str | Calibration):
        calibration = stated.calibration
        chain = calibration.chain if isinstance(calibration, Calibration) else str(calibration)
        unit = "" if channel.unit else unit_of_chain(chain)
        if unit and (unit != "FS" or channel.may_be_fractions):
            return unit, (Note("unit_of_calibration", name, unit=unit),)
        description = f"in {shown_text(channel.unit)!r}" if channel.unit else "without a unit"
        refuse(f"{name}: the values are {description}", f"unit = one of {ALLOWED}")
    return "", ()


def _read_scaled(
    samples: Callable[[int, int], NDArray[np.float64]], factor: float, start: int, stop: int
) -> NDArray[np.float64]:
    values = samples(start, stop)
    return values if factor == 1.0 else values * factor
