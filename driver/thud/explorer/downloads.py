"""Files for the page: case, script, force and sound."""

from __future__ import annotations

import io
from pprint import pformat
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from thud.case.case import check_case
from thud.explorer.answer import new_case
from thud.export.room_sound import listen
from thud.floors.prediction import predict_level
from thud.impact.compute import compute

if TYPE_CHECKING:
    from collections.abc import Callable

    Values = dict[str, dict[str, Any]]


class Download(NamedTuple):
    """Content of a file; of a sound also its full scale, Pa."""

    content: bytes
    full_scale: float | None = None


def namelist(values: Values) -> Download:
    """Return the case as a namelist file."""
    case = new_case(values)
    check_case(case)
    return Download(f"{case.to_namelist()}\n".encode())


def script(values: Values) -> Download:
    """Return a Python script that computes the case."""
    check_case(new_case(values))
    shown = pformat(values, width=90, sort_dicts=False)
    lines = ["import thud", "", f"case = thud.Case.from_namelist({shown})"]
    lines += ["impact = thud.solve(case)", "print(impact.levels().round(2))"]
    lines += ["print(impact.assess())"]
    if {"floor", "room"} <= values.keys():
        lines += ["print(thud.predict_level(impact))"]
    return Download(("\n".join(lines) + "\n").encode())


def force(values: Values) -> Download:
    """Return time and assessed force as comma-separated values."""
    impact = compute(new_case(values))
    table = io.StringIO()
    np.savetxt(
        table,
        np.column_stack([impact.time, impact.force()]),
        fmt="%.9g",
        delimiter=",",
        header="time_s,force_N",
        comments="",
    )
    return Download(table.getvalue().encode())


def sound(values: Values) -> Download:
    """Return the sound in the room below as a WAV file."""
    heard = listen(predict_level(compute(new_case(values))))
    return Download(heard.wav(), heard.full_scale)


# Function that returns the file, and media type, by the name of the file.
DOWNLOADS: dict[str, tuple[Callable[[Values], Download], str]] = {
    "case.nml": (namelist, "text/plain"),
    "case.py": (script, "text/x-python"),
    "force.csv": (force, "text/csv"),
    "room.wav": (sound, "audio/wav"),
}
