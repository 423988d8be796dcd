"""What the calls of `measurement.toml` use."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from refusals.core import write
from synthetic import half_sines, only_section, recording_of, uncertain_contact

import thud
from thud.recordings.config import Config
from thud.recordings.drops import find_drops
from thud.recordings.filters import band_filters, filter_levels
from thud.recordings.formats.text import read_table
from thud.recordings.measured_drop import measure_drop
from thud.recordings.repair import repair
from thud.recordings.signal import Signal
from thud.studies.fitting.record import read_record, time_and_force

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

# What is only imported for the table.
__all__ = [
    "Config", "Signal", "band_filters", "filter_levels", "find_drops", "half_sines",
    "measure_drop", "only_section", "recording_of", "repair", "uncertain_contact",
]  # fmt: skip

TIMES = 0.2 + np.arange(500) / 44100
SHELL = thud.solve(duration=0.03)
NOISE = np.random.default_rng(1).normal(size=1323)


def lost(count: int) -> NDArray[np.float64]:
    """Return the force of a drop of which some samples at 8 ms are zero."""
    force = half_sines(48e3, 60)
    force[5200 : 5200 + count] = 0.0
    return force


def read_force(source: str | list[ArrayLike]) -> object:
    """Return a record of times and forces, or of the text of a file."""
    if isinstance(source, list):
        return read_record(np.column_stack(source))
    return read_record(time_and_force(read_table(write("plate.csv", source))), "plate.csv")


def number_table(last: str, form: str = "{};{}") -> object:
    """Read eight rows of integers, which decide no decimal mark, and a last one."""
    rows = [form.format(i, i % 3) for i in range(8)]
    return read_table(write("plate.csv", "\n".join([*rows, last]) + "\n"))


def named(*names: str) -> str:
    """Write cases of these names; return their files."""
    case = "&case name = '{}' /\n&ball /\n&drop /\n&model name = 'hollow_sphere' /\n"
    return " ".join(str(write(f"{i}.nml", case.format(name))) for i, name in enumerate(names))
