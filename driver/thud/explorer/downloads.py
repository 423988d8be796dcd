"""Files that the page offers: the case, its force, a report, a study over what was moved."""

from __future__ import annotations

import io
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

from thud._schema import GROUPS
from thud.case import check_case
from thud.checks import refuse
from thud.comparison import compare
from thud.explorer.answer import new_case
from thud.impact import compute
from thud.keys import known_keys
from thud.plot.comparison_html import comparison_html

if TYPE_CHECKING:
    from collections.abc import Callable

    from thud.case import Case

    Values = dict[str, dict[str, Any]]

# Points of a grid along one parameter, and sets of a design with more than two.
POINTS = 11
SETS = 256
# Group of a request that is no group of the case: the ends of the moves of sliders, by group.key.
MOVED = "moved"


def namelist(values: Values) -> bytes:
    """Return the case as a namelist file."""
    case = new_case(values)
    check_case(case)
    return f"{case.to_namelist()}\n".encode()


def force(values: Values) -> bytes:
    """Return time and force as comma-separated values."""
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
    return table.getvalue().encode()


def report(values: Values) -> bytes:
    """Return the page of a comparison with the case alone."""
    impact = compute(new_case(values))
    found = compare({impact.case.name: impact})
    source = impact.case.limits.source
    return comparison_html(found.impacts, None, source, found.table()).encode()


def study(values: Values) -> bytes:
    """Return the file of a sweep over the keys that were moved, between the ends of their moves."""
    moved = {name: [float(end) for end in ends] for name, ends in values.pop(MOVED, {}).items()}
    case = new_case(values)
    check_case(case)
    known = known_keys((case.model.name,)) if case.model else {}
    names = {f"{key.group}.{name}": name for name, key in known.items()}
    ranges = {names[key]: (min(ends), max(ends)) for key, ends in moved.items() if key in names}
    ranges = {name: ends for name, ends in ranges.items() if ends[0] < ends[1]}
    if not ranges:
        refuse("no slider of ball, drop or model was moved", "a study of one or more")
    lines = ["# A sweep over what was moved: thud-driver sweep <this file>", "", "[fixed]"]
    lines += [f"{key} = {_toml(value)}" for key, value in _changed(case) if key not in ranges]
    grid = len(ranges) <= 2  # noqa: PLR2004 - more would be many sets
    lines += ["", "[design]"]
    lines += ['kind = "grid"'] if grid else ['kind = "sobol"', f"size = {SETS}", "seed = 1"]
    lines += ["", "[parameters]"]
    count = f", count = {POINTS}" if grid else ""
    lines += [
        f"{name} = {{ low = {low!r}, high = {high!r}{count} }}"
        for name, (low, high) in ranges.items()
    ]
    return ("\n".join(lines) + "\n").encode()


def _changed(case: Case) -> list[tuple[str, object]]:
    """Return the model, and the keys that differ from their defaults."""
    assert case.model is not None  # noqa: S101 - the page has one
    found: list[tuple[str, object]] = [("model", case.model.name)]
    for group in (*(getattr(case, name) for name in GROUPS), case.model):
        default = type(group)()
        for option in fields(group):
            value = getattr(group, option.name)
            if value != getattr(default, option.name):
                found.append((option.name, value))
    return found


def _toml(value: object) -> str:
    """Return a value of a key in TOML."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    return repr(list(value)) if isinstance(value, tuple) else repr(value)


# What makes a file of the values, and its media type, by the name of the request.
DOWNLOADS: dict[str, tuple[Callable[[Values], bytes], str]] = {
    "case.nml": (namelist, "text/plain"),
    "force.csv": (force, "text/csv"),
    "report.html": (report, "text/html"),
    "study.toml": (study, "application/toml"),
}
