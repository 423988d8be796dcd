"""The fields of the page, made from the declarations of the keys."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from thud._schema import FLOORS, GROUPS, KEYS, MODELS
from thud.case import OPTIONAL

if TYPE_CHECKING:
    from collections.abc import Iterable

    from thud.key import Group, Key

# A slider spans this part to this multiple of the value that it starts with.
SPAN = 3.0
# Models that take too long to be computed while a slider moves.
SLOW = ("finite_element",)
# Groups that the page leaves out: name, free modes, slow compression, files.
LEFT_OUT = ("case", "modes", "compression", "output")


def form() -> list[dict[str, Any]]:
    """Return the groups of fields: name, title, what they belong to, and the fields.

    A field has the group and the name of its key, kind, unit, meaning, choices, default and, where
    it is a number, limits of the allowed range (None: open) and those of a slider.
    """
    groups = [
        _group(name, name, kind(), [key for key in KEYS if key.group == name and not key.owner])
        for name, kind in GROUPS.items()
        if name not in LEFT_OUT
    ]
    models = [_options("model", name, kind) for name, kind in MODELS.items()]
    floors = [_options("floor", name, kind) for name, kind in FLOORS.items()]
    room = _options("room", "room", OPTIONAL["room"])
    return [*groups, *models, *floors, room]


def _options(part: str, name: str, kind: type[Group]) -> dict[str, Any]:
    """Return the fields of the options of a model, a floor or the room."""
    names = [option.name for option in fields(kind)]  # type: ignore[arg-type]
    keys = [key for key in KEYS if key.owner == name and key.name in names]
    return _group(part, name, kind(), keys)


def _group(part: str, name: str, values: Group, keys: Iterable[Key]) -> dict[str, Any]:
    """Return a group of fields."""
    found = [_field(key, getattr(values, key.name)) for key in keys if key.group not in LEFT_OUT]
    return {"part": part, "name": name, "fields": found}


def _field(key: Key, default: object) -> dict[str, Any]:
    """Return the field of a key."""
    field = {
        "group": key.group,
        "name": key.name,
        "kind": key.kind,
        "unit": key.unit,
        "meaning": key.meaning,
        "choices": list(key.choices),
        "default": list(default) if isinstance(default, tuple) else default,
    }
    if key.kind in {"real", "whole"} and isinstance(default, int | float):
        lower, upper = (_number(end) for end in (key.lower, key.upper))
        field |= {"lower": lower, "upper": upper, "slider": _slider(default, lower, upper)}
    return field


def _number(end: float | str) -> float | None:
    """Return a limit; None where there is none, or where it depends on other keys."""
    return None if isinstance(end, str) or math.isinf(end) else end


def _slider(value: float, lower: float | None, upper: float | None) -> list[float] | None:
    """Return the ends of a slider around a value; None where the value says no scale."""
    if value <= 0:
        small = lower is not None and upper is not None and upper - lower <= SPAN
        return [lower, upper] if small and lower is not None and upper is not None else None
    ends = [value / SPAN, value * SPAN]
    if lower is not None:
        ends[0] = max(ends[0], lower)
    if upper is not None:
        ends[1] = min(ends[1], upper)
    return ends
