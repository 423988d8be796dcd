"""Recorded drops of one source: from files to levels, stage by stage."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from threadpoolctl import threadpool_limits
from tqdm import tqdm

from thud.base.checks import refuse, require_kind
from thud.base.note import Note
from thud.recordings.background import remove_background
from thud.recordings.checks import copies
from thud.recordings.config import Config, parse_numbers, read_config
from thud.recordings.contact import find_contact
from thud.recordings.drops import Pulse, Section, Stage, cut_section, find_drops
from thud.recordings.measured_drop import Drop, measure_drop
from thud.recordings.recording import Origin, Recording
from thud.recordings.repair import repair
from thud.recordings.response import correct
from thud.recordings.signal import Signal
from thud.recordings.signal_files import open_signals

if TYPE_CHECKING:
    from collections.abc import Sequence

    from thud.recordings.force_units import Calibration

    Source = str | os.PathLike[str] | Signal


@dataclass(frozen=True, eq=False, repr=False)
class Stages(Stage):
    """One drop after each stage of its measurement.

    Attributes
    ----------
    section : Section
        As recorded.
    repaired : Section
        With spikes filled.
    corrected : Section
        After the correction of the instruments.
    drop : Drop
        Without background, measured.
    """

    section: Section
    repaired: Section
    corrected: Section
    drop: Drop


def measure_stages(section: Section, config: Config, calibration: float | None = None) -> Stages:
    """Measure the drop in a section; `calibration` is the relative uncertainty of the force.

    The levels of drops are `thud.recordings.recorded_levels.measure_levels`, their budget is
    `Recording.level_estimates`. Raise InputError if the drop cannot be measured.
    """
    repaired = repair(section)
    corrected = correct(repaired, config.chain)
    try:
        contact = find_contact(corrected, *remove_background(corrected))
    except np.linalg.LinAlgError as error:
        allowed = "a background of noise, drift and hum"
        refuse(f"{section.name}: the background is not noise", allowed, error)
    drop = measure_drop(corrected, contact, config, calibration, repaired)
    # A copy without the cached factors of the background, which are no longer needed.
    contact = replace(contact, background=replace(contact.background))
    return Stages(section, repaired, corrected, replace(drop, contact=contact))


def read_recording(  # noqa: PLR0913 - what everybody states has a keyword
    paths: Source | Iterable[Source],
    *,
    height: float | None = None,
    mass: float | None = None,
    calibration: Calibration | float | str | Sequence[Calibration | float | str] | None = None,
    config: Config | str | os.PathLike[str] | None = None,
    progress: bool = False,
) -> Recording:
    """Measure recorded drops of one source, from files with one or more drops each.

    Parameters
    ----------
    paths
        Files (docs/recordings_reading.md states the formats), or signals.
    height
        Drop height, m.
    mass
        Mass of the source, kg. Mass and height give the restitution by the impulse.
    calibration
        N per unit of the file, a chain of factors such as ``"4.1 pC/N, 10 mV/pC"``, or one for each
        load cell.
    config
        What else the laboratory states, or its file; other arguments override it.
    progress
        Show progress bars.

    Returns
    -------
    Recording

    Raises
    ------
    InputError
        If a file cannot be read or a drop cannot be measured.
    """
    if not isinstance(config, Config):
        config = Config() if config is None else read_config(config)
    config = config.updated(height=height, mass=mass, calibration=calibration)
    items = [paths] if isinstance(paths, str | os.PathLike | Signal) else paths
    require_kind("paths", items, Iterable)
    begin, end = config.begin or 0.0, math.inf if config.end is None else config.end
    origins: list[Origin] = []
    measured: list[list[Drop]] = []
    uncertainties: list[float | None] = []
    stages: Stages | None = None
    count = 0
    # BLAS threads slow down the many small matrix products.
    with threadpool_limits(1, "blas"):
        for signal in chain.from_iterable(open_signals(item, config) for item in items):
            pulses, ignored = find_drops(signal, begin, end, progress=progress)
            chosen, left_out = _choose(pulses, count + 1, signal.sample_rate, config)
            count += len(pulses)
            stated = config.calibration_uncertainty
            uncertainties.append(signal.calibration_uncertainty if stated is None else stated)
            measured.append([])
            for pulse in tqdm(
                chosen, unit="drop", desc=signal.name, disable=not progress, leave=False
            ):
                shown = measure_stages(cut_section(signal, pulse), config, uncertainties[-1])
                stages = stages or shown
                measured[-1].append(shown.drop)
            notes = [*signal.notes]
            length = signal.n_sample / signal.sample_rate
            if begin > 0 or end < length:
                last = min(end, length)
                notes.append(Note("section_searched", signal.name, low=begin, high=last, unit="s"))
            notes += (replace(note, subject=signal.name) for note in (*ignored, *left_out))
            origins.append(Origin(
                signal.name, signal.path, signal.checksum, signal.date, signal.calibration,
                signal.sample_rate, tuple(notes), len(measured[-1]),
            ))  # fmt: skip
    if not origins:
        refuse("there are no recordings", "one file or more")
    drops = tuple(chain.from_iterable(measured))
    for key, text in (("leave_out", ",".join(config.leave_out)), ("drops", config.drops)):
        highest = max(numbers.stop - 1 for numbers in parse_numbers(text, key)) if text else 0
        if highest > count:
            refuse(f"{key}: there is no drop {highest}", f"numbers from 1 to {count}", subject=key)
    if not drops:
        refuse("every drop is left out", "at least one drop")
    if len(origins) > 1:
        copies.check(origins, measured)
    name = Path(origins[0].path or origins[0].name).stem
    uncertainty = None if None in uncertainties else max(value or 0.0 for value in uncertainties)
    return Recording(name, drops, tuple(origins), config, uncertainty, stages)


def _choose(
    drops: Sequence[Pulse], first: int, rate: float, config: Config
) -> tuple[list[Pulse], list[Note]]:
    """Return the drops to be measured, and notes on those that are left out.

    The drops of a signal of a sample rate, Hz, have the numbers from `first` on. Without chosen
    numbers all are measured but those that say why not.
    """
    chosen: list[Pulse] = []
    notes: list[Note] = []
    for number, drop in enumerate(drops, start=first):
        reason = next((why for key, why in config.leave_out.items() if _holds(key, number)), None)
        if reason is not None:
            note = Note("drop_left_out", others={"reason": reason})
        elif config.drops and not _holds(config.drops, number):
            note = Note("drop_not_chosen", others={"chosen": config.drops})
        elif drop.left_out and not config.drops:
            note = drop.left_out
        else:
            chosen.append(drop)
            continue
        others = {**note.others, "time": drop.contact[0] / rate}
        notes.append(replace(note, value=number, others=others))
    return chosen, notes


def _holds(text: str, number: int) -> bool:
    return any(number in numbers for numbers in parse_numbers(text, "drops"))
