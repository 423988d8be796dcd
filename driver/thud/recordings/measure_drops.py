"""Measurement of all drops in signals of one source."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from threadpoolctl import threadpool_limits
from tqdm import tqdm

from thud.base.checks import refuse
from thud.base.note import Note, about
from thud.recordings.assumptions import with_assumptions
from thud.recordings.choice import choose, require_chosen
from thud.recordings.drops import search_drops
from thud.recordings.load_cells import repair_cells
from thud.recordings.measured_drop import measure_drop
from thud.recordings.quantization import find_quantization
from thud.recordings.response import correct_window
from thud.recordings.ringing import find_ringing, is_in_record
from thud.recordings.same_drops import (
    Record,
    refuse_copy,
    refuse_same_drops,
    refuse_simultaneous_channels,
)

if TYPE_CHECKING:
    from collections.abc import Iterable

    from thud.recordings.config import Config
    from thud.recordings.drops import Window
    from thud.recordings.measured_drop import Drop
    from thud.recordings.signal import Signal


@dataclass(frozen=True)
class Origin:
    """Signal from which drops were measured: attributes of `Signal`, and the number of drops.

    Its notes are those of the signal, and on pulses that are not measured.
    """

    name: str
    path: str
    checksum: str
    date: str
    calibration: str
    sample_rate: float
    notes: tuple[Note, ...]
    drops: int

    @classmethod
    def of(cls, signal: Signal, drops: int, notes: Iterable[Note]) -> Origin:
        """Return the origin of a number of drops of a signal, with notes on others."""
        names = ("name", "path", "checksum", "date", "calibration", "sample_rate")
        return cls(
            **{name: getattr(signal, name) for name in names},
            notes=(*signal.notes, *about(signal.name, notes)),
            drops=drops,
        )


def measure_signals(
    signals: Iterable[Signal],
    config: Config,
    *,
    progress: bool = False,
) -> tuple[tuple[Drop, ...], tuple[Origin, ...], float | None]:
    """Return the drops of signals, their origins, and the relative uncertainty of the force.

    The uncertainty is the largest of all signals, None if it is unknown for any of them. The
    arguments are those of `read_recording`. Raise InputError if there are no signals, a drop
    cannot be measured, or two signals record the same drop.
    """
    records: list[Record] = []
    searched: list[tuple[str, list[Window]]] = []
    origins: list[Origin] = []
    uncertainties: list[float | None] = []
    count = 0
    begin, end = config.begin or 0.0, config.end or math.inf
    # BLAS threads slow down the many small matrix products.
    with threadpool_limits(1, "blas"):
        for signal in signals:
            if config.calibration_uncertainty is not None:
                signal = replace(signal, calibration_uncertainty=config.calibration_uncertainty)  # noqa: PLW2901
            refuse_copy(signal, records)
            search = search_drops(signal, begin, end, progress=progress)
            windows, left_out = choose(search.windows, count + 1, config.drops, config.leave_out)
            count += len(search.windows)
            # Small pulses may be what a channel picks up of another one.
            own = [window for window in search.windows if not window.left_out]
            refuse_simultaneous_channels(own, searched)
            searched.append((signal.path, own))
            bar = tqdm(windows, unit="drop", desc=signal.name, disable=not progress, leave=False)
            measured = tuple(measure_window(window, config) for window in bar)
            notes = (*_section(signal, begin, end), *search.ignored, *left_out)
            records.append(Record(signal.name, signal.path, signal.checksum, measured))
            uncertainties.append(signal.calibration_uncertainty)
            origins.append(Origin.of(signal, len(windows), notes))
    if not records:
        refuse("there are no recordings", "one file or more")
    require_chosen(count, sum(len(r.drops) for r in records), config.drops, config.leave_out)
    refuse_same_drops(records)
    known = [uncertainty for uncertainty in uncertainties if uncertainty is not None]
    uncertainty = max(known) if len(known) == len(uncertainties) else None
    drops = tuple(drop for record in records for drop in record.drops)
    return drops, tuple(origins), uncertainty


def _section(signal: Signal, begin: float, end: float) -> tuple[Note, ...]:
    """Return a note if a section of a signal is searched, not all of it."""
    length = signal.n_sample / signal.sample_rate
    if begin == 0 and end >= length:
        return ()
    return (Note("section_searched", low=begin, high=min(end, length), unit="s"),)


def measure_window(window: Window, config: Config) -> Drop:
    """Return the drop in a window, after correction of the responses of the instruments."""
    notes: list[Note] = []
    window = replace(window, quantization=find_quantization(window))
    if window.signal.cells:
        window, faults = repair_cells(window)
        notes += faults
    chain, plate, recorded = config.chain, config.resonance, window
    if chain is not None:
        window, corrected = correct_window(window, chain)
        notes += corrected
    drop = measure_drop(window, config.conditions(window.signal.calibration_uncertainty))
    # A copy without the cached factors of the background, which are no longer needed.
    contact = replace(drop.contact, background=replace(drop.contact.background))
    ringing = find_ringing(contact, chain)
    notes += drop.notes
    if ringing:
        notes.append(ringing.note)
    # A flat top stays flat without tones.
    different = [note for k, note in enumerate(notes) if note not in notes[:k]]
    drop = replace(
        drop,
        contact=contact,
        notes=about(drop.name, different),
        ringing=ringing,
        plate_recorded=None if plate is None else is_in_record(recorded, contact, plate),
    )
    return with_assumptions(drop, config)
