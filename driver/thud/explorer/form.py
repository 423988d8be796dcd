"""Form fields of the page, from the declarations of the keys, and constructions that fill them."""

from __future__ import annotations

import math
import re
from dataclasses import fields
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from thud.base._schema import FLOORS, GROUPS, KEYS, MODELS, OPTIONAL_GROUPS, RATINGS, STANDARD_BALL
from thud.base.units import display_unit, power_of, scaled
from thud.case.constructions import constructions
from thud.case.keys import find_key, humanize
from thud.explorer.models import condition_of, is_folded, users_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from thud.base.key import Group, Key
    from thud.case.case import Case

# The range of a logarithmic slider is the initial value divided and multiplied by this factor.
SLIDER_FACTOR = 3.0
# The range of a linear slider is the allowed range, if that is positive, at most MAX_LENGTH long,
# and the initial value is not in its lowest fraction MIN_FRACTION.
MAX_LENGTH, MIN_FRACTION = 3.0, 0.1
# Fraction of the allowed range that a linear slider omits at both ends.
INSET = 0.01
# Number of steps from zero to a value, at least.
STEPS = 15
# Steps of fields whose default is 0, by the unit of the key.
STEPS_OF_UNITS = {
    "m": 0.1, "m3": 1.0, "dB": 1.0, "kg/m2": 1.0, "s": 0.001, "s/m": 0.01, "Pa": 1000.0,
    "Hz": 100.0,
}  # fmt: skip
_SUPERSCRIPTS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")
# Groups of keys that are not on the page.
OMITTED_GROUPS = ("case", "modes", "compression", "output")


def form() -> list[dict[str, Any]]:
    """Return the groups of fields.

    A group has part (``"model"``, ``"floor"``, ``"room"`` or its name), name, title and fields. A
    field has group and name of its key, label, kind, help, choices, default, the models that use it
    (None: all), whether it is advanced, and the choice with which it has an effect (None: always).
    A field of a number also has a unit, the power of ten that converts it to the unit of the key,
    limits of the allowed range in its unit (None: open), a round step, and a slider.
    """
    groups = [
        _group(name, name, kind(), [key for key in KEYS if key.group == name and not key.owner])
        for name, kind in GROUPS.items()
        if name not in OMITTED_GROUPS
    ]
    models = [_options("model", name, kind) for name, kind in MODELS.items()]
    floors = [_options("floor", name, kind) for name, kind in FLOORS.items()]
    room = _options("room", "room", OPTIONAL_GROUPS["room"])
    return [*groups, *models, *floors, room]


@lru_cache(maxsize=1)
def fields_by_key() -> dict[tuple[str, str], dict[str, Any]]:
    """Return the fields of the page by group and key."""
    return {(field["group"], field["name"]): field for group in form() for field in group["fields"]}


def field_of(case: Case, name: str) -> dict[str, Any]:
    """Return the field of a key of a case."""
    key, _ = find_key(name, case)
    return fields_by_key()[key.group, key.name]


def shown(field: Mapping[str, Any], value: float, *, unit: bool = True) -> str:
    """Return a value of a key in the unit of its field: four digits, and the unit."""
    return f"{scaled(float(value), -field['power']):.4g} {field['unit'] if unit else ''}".rstrip()


def lower(label: str) -> str:
    """Return a label for the middle of a sentence."""
    is_name = label.startswith(("Young", "Poisson"))
    return label if is_name else label[:1].lower() + label[1:]


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
                key: list(value) if isinstance(value, tuple) else value
                for key, value in vars(entry.floor).items()
                if key in entry.sources
            },
            "room": entry.room,
            "sources": entry.sources,
        }
        for entry in constructions().values()
    ]


def _options(part: str, name: str, kind: type[Group]) -> dict[str, Any]:
    """Return the fields of the options of a model, a floor or the room."""
    names = [option.name for option in fields(kind)]  # type: ignore[arg-type]
    keys = [key for key in KEYS if key.owner == name and key.name in names]
    return _group(part, name, kind(), keys)


def _group(part: str, name: str, values: Group, keys: Iterable[Key]) -> dict[str, Any]:
    """Return a group of fields."""
    used = [key for key in keys if key.group not in OMITTED_GROUPS]
    shown = [_field(key, _default(key, values)) for key in used]
    return {"part": part, "name": name, "title": _title(name), "fields": shown}


def _default(key: Key, values: Group) -> object:
    """Return the default of a key: of a calibrated one that of the first model that has it."""
    value = getattr(values, key.name)
    return next(iter(_standard(key).values())) if value is None else value


def _standard(key: Key) -> dict[str, float]:
    """Return the values of the standard ball for a key by model; empty if it has none."""
    return {
        model: STANDARD_BALL[model, key.name]
        for model in MODELS
        if key.owner in {"", model} and (model, key.name) in STANDARD_BALL
    }


def _field(key: Key, default: object) -> dict[str, Any]:
    """Return the field of a key."""
    label, meaning = _title(key.name), _capitalize(humanize(key.meaning))
    field = {
        "group": key.group,
        "name": key.name,
        "label": label,
        "kind": key.kind,
        "help": meaning,
        "choices": {choice: humanize(choice) for choice in key.choices},
        "default": list(default) if isinstance(default, tuple) else default,
        "standard": _standard(key),
        "unit": _typeset(key.unit),
        "si_unit": key.unit,
        "power": 0,
        "models": users_of(key),
        "advanced": is_folded(key),
        "condition": condition_of(key),
    }
    if (key.group, key.name) == ("room", "rating"):
        # The bands stand in the help: the column has no room for both.
        standards = {name: text.partition("(")[2].rstrip(")") for name, text in RATINGS.items()}
        field |= {"choices": standards, "help": "; ".join(RATINGS.values())}
    if key.kind in {"real", "whole"} and isinstance(default, int | float):
        unit = _unit(key, default)
        power = power_of(unit or "1", key.unit, key.name)
        suffix = "" if isinstance(key.upper, str) else f" {_typeset(unit)}"
        allowed = f"allowed: {_limit(key.lower, power)} to {_limit(key.upper, power)}{suffix}"
        value, lower, upper = (_converted(x, power) for x in (default, key.lower, key.upper))
        ends = lower, upper, MAX_LENGTH if default else scaled(MAX_LENGTH, -power)
        is_whole = key.kind == "whole"
        field |= {
            "unit": _typeset(unit),
            "power": power,
            "lower": lower,
            "upper": upper,
            "help": f"{'' if meaning == label else meaning + '; '}{allowed.rstrip()}",
            "step": 1 if is_whole else _step(key.unit, value or 0.0, *ends),
            "slider": _slider(value or 0.0, *ends, whole=is_whole),
        }
        if zero := re.search(r"\b0: ([^;,]+)", meaning):
            # Such a zero, as "none", is an empty field without a slider.
            field["zero"] = None if field["slider"] else zero[1]
    return field


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
    size = (
        key.upper if key.unit == "m" and not default and not isinstance(key.upper, str) else default
    )
    return display_unit(key.unit, size)[0]


def _step(
    unit: str, value: float, lower: float | None, upper: float | None, max_length: float
) -> float | None:
    """Return a power of ten by which arrow keys change a value; None if no size is known."""
    size = abs(value)
    if not size and lower is not None and upper is not None and upper - lower <= max_length:
        size = upper - lower
    return 10.0 ** math.floor(math.log10(size / STEPS)) if size else STEPS_OF_UNITS.get(unit)


def _slider(
    value: float, lower: float | None, upper: float | None, max_length: float, *, whole: bool
) -> dict[str, Any] | None:
    """Return ends and scale of a slider around a value; None if there is no range for a slider."""
    if lower is not None and upper is not None and lower >= 0:
        length = upper - lower
        if length <= max_length and (value <= 0 or value >= lower + MIN_FRACTION * length):
            # The limits may not be allowed values, but the default is.
            inner = lower + INSET * length, upper - INSET * length
            return {"ends": [min(value, inner[0]), max(value, inner[1])], "log": False}
    if value <= 0:
        return None
    low = max(value / SLIDER_FACTOR, -math.inf if lower is None else lower)
    high = min(value * SLIDER_FACTOR, math.inf if upper is None else upper)
    return {"ends": [math.ceil(low), math.floor(high)] if whole else [low, high], "log": not whole}
