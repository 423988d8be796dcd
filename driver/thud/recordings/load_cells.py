"""Sum of the channels of load cells under one plate."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse
from thud.base.note import Note
from thud.recordings.config_values import SUM
from thud.recordings.polarity import MIN_PEAK_RATIO, find_peaks
from thud.recordings.signal import common_uncertainty

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from thud.recordings.drops import Section
    from thud.recordings.signal import Signal

HINT = 'channels = "sum" for load cells under one plate, or channel = the force'
# A direction at the end of a name: Fx, Force_Y, z1.
AXIS = re.compile(r"(?:^|[^a-z])f?(?P<axis>[xyz])\d*$")
# Minimum peak of the opposite sign, as a fraction of the peak of the sum, that raises a warning.
MIN_OPPOSITE = 0.05
# Maximum deviation of a channel from the sum of the others, as a fraction, if it is their sum.
MAX_DEVIATION = 0.05
# Minimum magnitude of the impulse of a cell as a fraction of that of the sum: without one of four
# cells, levels are 2.5 dB too low.
MIN_SHARE = 0.005


def refuse_directions(names: Sequence[str], file: str) -> None:
    """Raise InputError if channels to be added have names of different directions."""
    matches = [AXIS.search(name.rpartition("/")[2].strip().casefold()) for name in names]
    if len({match["axis"] for match in matches if match}) > 1:
        listed = ", ".join(names)
        refuse(
            f'{file}: channels = "{SUM}" would add forces of different directions, {listed}',
            "the names of the vertical forces, such as channels = 'z1+z2+z3+z4'",
        )


def add_signals(cells: Sequence[Signal], name: str) -> Signal:
    """Return the sum of signals of equal rate and length."""
    first = cells[0]
    notes: list[Note] = []
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
        first,
        name=name,
        samples=partial(_read_sum, tuple(cells)),
        full_scale=None,
        calibration="; ".join(dict.fromkeys(cell.calibration for cell in cells)),
        # The reference of all calibrations is usually the same.
        calibration_uncertainty=common_uncertainty([c.calibration_uncertainty for c in cells]),
        notes=(*notes, Note("cells_added", name, len(cells))),
        cells=tuple(cells),
    )


def _read_sum(cells: tuple[Signal, ...], start: int, stop: int) -> NDArray[np.float64]:
    total = cells[0].read(start, stop)
    for cell in cells[1:]:
        total += cell.read(start, stop)
    return total


def check_signs(cells: Sequence[Signal], peak: float) -> list[Note]:
    """Return a warning for each cell whose force is mostly negative; the peak is that of the sum.

    Raise InputError if all samples of a cell are equal.
    """
    notes = []
    for cell in cells:
        up, down = find_peaks(cell)
        if down > max(MIN_PEAK_RATIO * up, MIN_OPPOSITE * peak):
            others: dict[str, float | str] = {"part": cell.name, "total": peak}
            notes.append(Note("cell_sign", value=-down, unit="N", others=others))
    return notes


def check_cells(section: Section, forces: Sequence[NDArray[np.float64]]) -> list[Note]:
    """Return a warning for each load cell of a section without a force in the contact.

    `forces` are those of the cells, N. Raise InputError if a channel is the sum of the others,
    which would count twice.
    """
    first, stop = section.contact
    levels = [
        force[first:stop] - np.median(np.delete(force, slice(first, stop))) for force in forces
    ]
    total = np.sum(levels, axis=0)
    shares = [float(level.sum() / total.sum()) for level in levels]
    cells = section.cells
    # Two cells may have equal forces, and a cell of the wrong sign, which `check_signs` names,
    # makes another one the sum of the others.
    if len(cells) > 2 and min(shares) > -MIN_OPPOSITE:  # noqa: PLR2004
        for cell, level in zip(cells, levels, strict=True):
            if np.ptp(total - 2 * level) < MAX_DEVIATION * np.ptp(total - level):
                refuse(
                    f"{cell.name}: is the sum of the other channels, which would count twice",
                    "channels without it, or channel = this one",
                )
    return [
        Note("cell_without_force", value=share, others={"part": cell.name})
        for cell, share in zip(cells, shares, strict=True)
        if abs(share) < MIN_SHARE
    ]
