"""Form fields of the page, from the declarations of the keys, and constructions that fill them."""

from __future__ import annotations

import math
import re
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from thud.base._schema import FLOORS, GROUPS, KEYS, MODELS, OPTIONAL_GROUPS, RATINGS, STANDARD_BALL
from thud.base.units import display_unit, power_of, scaled
from thud.case.constructions import constructions
from thud.case.keys import humanize
from thud.explorer.models import is_folded, users_of

if TYPE_CHECKING:
    from thud.base.key import Group, Key

# A slider goes from the default divided by this factor to its multiple, or from 0, and ends before
# a limit by a fraction of the distance.
SLIDER_FACTOR, INSET = 3.0, 0.01
# Number of steps from zero to a value, at least.
STEPS = 15
# Steps of fields whose default is 0, by the unit of the key.
STEPS_OF_UNITS = {"m": 0.1, "dB": 1.0}
_SUPERSCRIPTS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")
# Groups of keys that are not on the page.
OMITTED_GROUPS = ("case", "modes", "compression", "output")


def form() -> list[dict[str, Any]]:
    """Return the groups of fields.

    A group has part (``"model"``, ``"floor"``, ``"room"`` or its name), name, title and fields. A
    field has group and name of its key, label, kind, help, choices, default, the models that use it
    (None: all), whether it is advanced, and a key of its group of fields with the choices with
    which it has an effect (empty: always). A field of a number also has a unit, the power of ten
    that converts it to the unit of the key, limits of the allowed range in its unit (None: open), a
    round step (None: of an unknown size), and a slider.
    """
    return [
        *(
            _group(name, name, kind())
            for name, kind in GROUPS.items()
            if name not in OMITTED_GROUPS
        ),
        *(_group("model", name, kind()) for name, kind in MODELS.items()),
        *(_group("floor", name, kind()) for name, kind in FLOORS.items()),
        _group("room", "room", OPTIONAL_GROUPS["room"]()),
    ]


@lru_cache(maxsize=1)
def fields_by_key() -> dict[tuple[str, str], dict[str, Any]]:
    """Return the fields of the page by group and key."""
    return {(field["group"], field["name"]): field for group in form() for field in group["fields"]}


def construction_form() -> list[dict[str, Any]]:
    """Return the constructions of the library, which fill the fields of floor and ceiling.

    A construction has name, kind, text (its layers and note), floor, and for the stated keys of
    floor and room their values (``"keys"``, ``"room"``) and sources.
    """
    return [
        {
            "name": entry.name,
            "kind": _capitalize(entry.kind),
            "text": f"{entry.section}. {entry.note}".rstrip(),
            "floor": entry.floor.name,
            "keys": {
                key: value for key, value in vars(entry.floor).items() if key in entry.sources
            },
            "room": entry.room,
            "sources": entry.sources,
        }
        for entry in constructions().values()
    ]


def _group(part: str, name: str, values: Group) -> dict[str, Any]:
    """Return a group of fields: those of a group of every case, or of the options of an owner."""
    owner = name if part in {"model", "floor", "room"} else ""
    shown = [
        _field(key, getattr(values, key.name))
        for key in KEYS
        if key.owner == owner and key.group not in OMITTED_GROUPS and hasattr(values, key.name)
        if owner or key.group == name
    ]
    return {"part": part, "name": name, "title": _title(name), "fields": shown}


def _standard(key: Key) -> dict[str, float]:
    """Return the values of the standard ball for a key by model; empty if it has none."""
    return {
        model: STANDARD_BALL[model, key.name]
        for model in MODELS
        if key.owner in {"", model} and (model, key.name) in STANDARD_BALL
    }


def _field(key: Key, value: object) -> dict[str, Any]:
    """Return the field of a key, with its default: of the first model if it is calibrated."""
    meaning, standard = _capitalize(humanize(key.meaning)), _standard(key)
    default = next(iter(standard.values())) if value is None else value
    field: dict[str, Any] = {
        "group": key.group,
        "name": key.name,
        "label": _title(key.name),
        "kind": key.kind,
        "help": meaning,
        "choices": {choice: humanize(choice) for choice in key.choices},
        "default": default,
        "standard": standard,
        "unit": _typeset(key.unit),
        "power": 0,
        "models": users_of(key),
        "advanced": is_folded(key),
        "condition": key.needs,
    }
    if (key.group, key.name) == ("room", "rating"):
        # The bands stand in the help: the column has no room for both.
        standards = {name: text.partition("(")[2].rstrip(")") for name, text in RATINGS.items()}
        field |= {"choices": standards, "help": "; ".join(RATINGS.values())}
    if key.kind in {"real", "whole"} and isinstance(default, int | float):
        field |= _number(key, default, meaning)
    return field


def _number(key: Key, default: float, meaning: str) -> dict[str, Any]:
    """Return what the field of a number has besides."""
    unit = _unit(key, default)
    power = power_of(unit or "1", key.unit, key.name)
    ends = f"{_limit(key.lower, power)} to {_limit(key.upper, power)}"
    allowed = ends if isinstance(key.upper, str) else f"{ends} {_typeset(unit)}".rstrip()
    value, lower, upper = (_converted(x, power) for x in (default, key.lower, key.upper))
    is_whole = key.kind == "whole"
    slider = _slider(value or 0.0, lower, upper, power)
    zero = re.search(r"\b0: ([^;,]+)", meaning)
    size = abs(value or 0.0) or (slider["ends"][1] if slider else 0.0)
    step = 10.0 ** math.floor(math.log10(size / STEPS)) if size else STEPS_OF_UNITS.get(key.unit)
    return {
        "unit": _typeset(unit),
        "power": power,
        "lower": lower,
        "upper": upper,
        "help": f"{'' if meaning == _title(key.name) else meaning + '; '}allowed: {allowed}",
        "step": 1 if is_whole else step,
        "slider": slider,
        # Such a zero, as "none", is an empty field without a slider.
        "zero": zero[1] if zero and not slider else None,
    }


def _title(name: str) -> str:
    return _capitalize(humanize(name))


def _capitalize(words: str) -> str:
    """Return words with a capital first letter."""
    return words[:1].upper() + words[1:]


def _typeset(unit: str) -> str:
    """Return a unit with superscript powers."""
    return re.sub(r"(?<=[a-z])[23]", lambda digit: digit[0].translate(_SUPERSCRIPTS), unit)


def _converted(value: float | str, power: int) -> float | None:
    """Return a number in the unit of its field; None for a limit that is infinite or a formula."""
    return None if isinstance(value, str) or math.isinf(value) else scaled(value, -power)


def _limit(limit: float | str, power: int) -> str:
    """Return the text of a limit in the unit of its field."""
    if isinstance(limit, str):
        return humanize(limit)
    number = f"{scaled(limit, -power):g}"
    return re.sub(r"1e\+0?(\d+)", lambda match: "10" + match[1].translate(_SUPERSCRIPTS), number)


def _unit(key: Key, default: float) -> str:
    """Return the unit of the field of a key."""
    # Times remain in seconds: a reverberation time of 500 ms would be unusual.
    if key.unit == "s":
        return key.unit
    # Lengths that may be 0 have the unit of their maximum.
    if key.unit == "m" and not default and not isinstance(key.upper, str):
        default = key.upper
    return display_unit(key.unit, default)[0]


def _slider(
    value: float, lower: float | None, upper: float | None, power: int
) -> dict[str, Any] | None:
    """Return the ends of a slider around a value; None if there is no range for a slider."""
    if value <= 0:
        # The lowest thickness, loss or fraction.
        is_short = lower == 0 and upper is not None and scaled(upper, power) <= 1
        return {"ends": [0, (1 - INSET) * (upper or 0.0)]} if is_short else None
    low, high = value / SLIDER_FACTOR, value * SLIDER_FACTOR
    if lower is not None:
        low = max(low, lower + INSET * (value - lower))
    if upper is not None:
        high = min(high, upper - INSET * (upper - value))
    return {"ends": [low, high]}
