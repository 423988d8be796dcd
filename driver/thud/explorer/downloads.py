"""Files for the page: case, script, force, sound, and a study of changed keys."""

from __future__ import annotations

import io
import json
from dataclasses import fields
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from thud.base.checks import refuse, require_number, shown
from thud.base.key import Group
from thud.case.case import check_case
from thud.case.keys import find_key, known_keys
from thud.explorer.answer import new_case
from thud.export.room_sound import listen
from thud.floors.prediction import predict_level
from thud.impact.compute import compute

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from thud.base.key import Key

    Values = dict[str, dict[str, Any]]

# Number of values of each parameter in a grid of up to two parameters, and number of samples of a
# study with more parameters.
POINTS = 11
SAMPLES = 256
# Group of a request with the ranges in which sliders were moved, by group.key.
MOVED = "moved"


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
    case = new_case(values)
    check_case(case)
    arguments = [f"name={case.name!r}"]
    for field in fields(case):
        group = getattr(case, field.name)
        # A case without a model, or with the default one, has no argument.
        if not isinstance(group, Group):
            continue
        stated = _stated(group)
        if stated or field.name in {"model", "floor", "room"}:
            listed = ", ".join(f"{name}={value!r}" for name, value in stated.items())
            arguments.append(f"{field.name}=thud.{type(group).__name__}({listed})")
    lines = ["import thud", "", "case = thud.Case(", *(f"    {text}," for text in arguments), ")"]
    lines += ["impact = thud.solve(case)", "print(impact.levels().round(2))"]
    lines += ["print(impact.assess())"]
    if case.floor and case.room:
        lines += ["print(thud.predict_level(impact))"]
    return Download(("\n".join(lines) + "\n").encode())


def _stated(group: Group) -> dict[str, object]:
    """Return the values of a group that differ from their defaults."""
    defaults = type(group)()
    return {name: value for name, value in vars(group).items() if value != getattr(defaults, name)}


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


def study(values: Values) -> Download:
    """Return the file of a sweep over the ranges in which sliders were moved."""
    moved = _moved_ranges(values.pop(MOVED, {}))
    case = new_case(values)
    check_case(case)
    names = {f"{key.group}.{key.name}": name for name, key in known_keys(case).items()}
    ranges = {names[key]: ends for key, ends in moved.items() if key in names and ends[0] < ends[1]}
    if not ranges:
        refuse("move a slider first", "a study of one or more parameters")
    lines = ["# A sweep over the moved keys: thud-driver sweep <this file>"]
    for group, keys in case.to_namelist().items():
        if group in values:
            stated = [f"{key} = {_toml(keys[key])}" for key in keys if key in values[group]]
            lines += ["", f"[case.{group}]", *stated]
    grid = len(ranges) <= 2  # noqa: PLR2004 - a grid of more parameters has too many samples
    lines += ["", "[design]"]
    lines += ['kind = "grid"'] if grid else ['kind = "sobol"', f"size = {SAMPLES}", "seed = 1"]
    lines += ["", "[parameters]"]
    for name, (low, high) in ranges.items():
        key = find_key(name, case)[0]
        count = f", count = {_count(key, low, high)}" if grid else ""
        ends = [round(low), round(high)] if key.kind == "whole" else [low, high]
        lines.append(f'"{name}" = {{ low = {ends[0]!r}, high = {ends[1]!r}{count} }}')
    return Download(("\n".join(lines) + "\n").encode())


def _moved_ranges(moved: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    """Return the minimum and maximum of each key whose slider was moved."""
    for key, ends in moved.items():
        if not isinstance(ends, list) or len(ends) != 2:  # noqa: PLR2004
            refuse(f"{MOVED}: {key} = {shown(ends)} is not a pair", "two numbers")
        for end in ends:
            require_number(f"{MOVED}: {key}", end)
    return {key: (float(min(ends)), float(max(ends))) for key, ends in moved.items()}


def _count(key: Key, low: float, high: float) -> int:
    """Return the number of values of a key in a grid."""
    return min(POINTS, round(high - low) + 1) if key.kind == "whole" else POINTS


def _toml(value: object) -> str:
    """Return the text of a value in TOML."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value)
    return repr(value)


# Function that returns the file, and media type, by the name of the file.
DOWNLOADS: dict[str, tuple[Callable[[Values], Download], str]] = {
    "case.nml": (namelist, "text/plain"),
    "case.py": (script, "text/x-python"),
    "force.csv": (force, "text/csv"),
    "room.wav": (sound, "audio/wav"),
    "study.toml": (study, "application/toml"),
}
