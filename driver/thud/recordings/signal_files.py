"""Recorded files as signals in newtons."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

from thud.base.checks import refuse, shown, shown_text
from thud.base.errors import InputError
from thud.base.files import regular_file
from thud.base.note import Note
from thud.base.units import find_unit, size_of
from thud.recordings.config import SUM, Config
from thud.recordings.force_units import ALLOWED, EXAMPLES, RECORDED, Calibration, newtons_per_unit
from thud.recordings.formats import MIN_SAMPLES, read_channels
from thud.recordings.signal import HINT, POLARITIES, Signal, add_signals, find_peaks, orient

if TYPE_CHECKING:
    import os
    from pathlib import Path

    from thud.recordings.formats import Channel

# Minimum and maximum sample rate, Hz: the octave of 500 Hz needs 1.42 kHz and room for a filter.
RATES = (2500.0, 1e8)
# Minimum peak of a channel of force that was not chosen, as a fraction of the chosen peak, that
# raises a warning: without one of four load cells, levels are 2.5 dB too low. If the sum of the
# peaks deviates by less from the chosen peak, this is their sum.
MIN_MISSING = 0.2
MAX_SUM_DEVIATION = 0.1
# A direction at the end of a name: Fx, Force_Y, z1.
AXIS = re.compile(r"(?:^|[^a-z])f?(?P<axis>[xyz])\d*$")


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
    chosen = choose_channels(channels, config, shown_text(file))
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
    others = [channel for channel in channels if channel.is_force and channel not in chosen]
    if others and not any(calibrations) and all(channel.is_force for channel in chosen):
        signals = [_with_missing(signals[0], file, others)]
    return signals


def choose_channels(channels: list[Channel], config: Config, name: str) -> list[Channel]:
    """Return the stated channels, by default those of force, or the only channel.

    Raise InputError if it is unclear which, or a channel is not in the file.
    """
    forces = [channel for channel in channels if channel.is_force]
    stated = config.channels
    if stated is not None and config.channel is not None:
        refuse(f"{name}: both channel and channels are stated", "one of them", subject="channel")
    if config.channel is not None:
        return [_find_channel(channels, config.channel, name)]
    if stated is None:
        if not forces and len(channels) > 1:
            refuse(
                f"{name}: has {len(channels)} channels, none of them in a unit of force",
                f'channel = one of {channel_choices(channels)}; or channels = "{SUM}" for load '
                "cells of one plate",
            )
        return forces or channels
    if isinstance(stated, tuple):
        cells = [_find_channel(channels, channel, name) for channel in stated]
        if len({cell.number for cell in cells}) < len(cells):
            refuse(f"{name}: channels = {shown(stated)} names one channel twice", "each once")
        return cells
    cells = forces or channels
    if len(cells) < 2 or (not forces and len({cell.unit for cell in cells}) > 1):  # noqa: PLR2004
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
    return cells


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


def _in_newtons(
    file: Path,
    channel: Channel,
    name: str,
    calibration: float | Calibration | None,
    config: Config,
) -> Signal:
    """Return a channel in N; raise InputError if its rate or unit is unknown.

    Its sign is that of the file, or with a stated polarity that of a compression.
    """
    if channel.n_sample < MIN_SAMPLES:
        refuse(f"{name}: {channel.n_sample} samples", f"{MIN_SAMPLES} samples or more")
    rate, rate_notes = _rate(channel, config.sample_rate, name)
    unit, unit_notes = _unit(channel, config.unit, calibration, name)
    notes = [*channel.notes, *rate_notes, *unit_notes]
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


def _rate(channel: Channel, stated: float | None, name: str) -> tuple[float, list[Note]]:
    """Return the sample rate of a channel, Hz: stated, or of the file."""
    rate = channel.sample_rate if stated is None else stated
    if rate is None:
        allowed = "sample_rate in Hz, or a column of times in s"
        refuse(f"{name}: the sample rate is not known", allowed, subject="sample_rate")
    if not RATES[0] <= rate <= RATES[1]:
        refuse(f"{name}: the sample rate is {rate:.6g} Hz", f"{RATES[0]:g} to {RATES[1]:g} Hz")
    if channel.sample_rate in {None, rate}:
        return rate, []
    of_file = {"of_file": channel.sample_rate or 0.0}
    return rate, [Note("rate_replaced", value=rate, unit="Hz", others=of_file)]


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
