"""Files for the page: case, script, force and sound."""

from __future__ import annotations

import io
from base64 import b64encode
from pprint import pformat
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.case.case import check_case
from thud.explorer.answer import new_case
from thud.export.room_sound import listen
from thud.floors.prediction import predict_level
from thud.impact.compute import compute

if TYPE_CHECKING:
    from collections.abc import Callable

    Values = dict[str, dict[str, Any]]


def namelist(values: Values) -> str:
    """Return the case as a namelist file."""
    case = new_case(values)
    check_case(case)
    return f"{case.to_namelist()}\n"


def script(values: Values) -> str:
    """Return a Python script that computes the case."""
    check_case(new_case(values))
    shown = pformat(values, width=90, sort_dicts=False)
    lines = ["import thud", "", f"case = thud.Case.from_namelist({shown})"]
    lines += ["impact = thud.solve(case)", "print(impact.levels().round(2))"]
    lines += ["print(impact.assess())"]
    if {"floor", "room"} <= values.keys():
        lines += ["print(thud.predict_level(impact))"]
    return "\n".join(lines) + "\n"


def force(values: Values) -> str:
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
    return table.getvalue()


def sound(values: Values) -> dict[str, Any]:
    """Return the sound in the room below: a WAV file in base 64, and its full scale, Pa."""
    heard = listen(predict_level(compute(new_case(values))))
    return {"wav": b64encode(heard.wav()).decode(), "full_scale": heard.full_scale}


# Functions that return the content, by the name of the file.
DOWNLOADS: dict[str, Callable[[Values], object]] = {
    "case.nml": namelist,
    "case.py": script,
    "force.csv": force,
    "room.wav": sound,
}
