"""Keys that studies vary and fits search for."""

from __future__ import annotations

import dataclasses
import re
from typing import TYPE_CHECKING

from thud.base._schema import GROUPS, KEYS
from thud.base.checks import refuse, shown, suggestion
from thud.base.key import Key
from thud.case.case import attribute_of

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from thud.case.case import Case

Value = float | int | str | bool

# Spelling of names of persons and abbreviations by their form in keys.
_PROPER = {
    "youngs": "Young's",
    "poisson": "Poisson's",
    "hunt_crossley": "Hunt–Crossley",
    "kelvin_voigt": "Kelvin–Voigt",
    "mooney_rivlin": "Mooney–Rivlin",
    "mooney": "Mooney",
    "neo_hookean": "neo-Hookean",
    "prony": "Prony",
    "fft": "FFT",
}

# Parameters of studies only, which determine the mass and the elastic modulus of the ball.
DENSITY = Key("", "ball", "density", "real", "kg/m3", "density of the wall")
TEMPERATURE = Key("", "ball", "temperature", "real", "degC", "temperature of the ball")


def known_keys(case: Case) -> dict[str, Key]:
    """Return the keys in which samples of a case may differ, by name.

    Names of floor and room keys begin with the group, such as ``"plate.thickness"``; the group may
    be omitted if no other key has the name.
    """
    model = case.model.name if case.model else ""
    keys = {
        key.name: key
        for key in (*KEYS, DENSITY, TEMPERATURE)
        if key.owner == model or (not key.owner and key.group in GROUPS)
    }
    below = {case.floor.name if case.floor else "", "room" if case.room else ""}
    for key in KEYS:
        if key.owner and key.owner in below:
            keys.setdefault(key.name, key)
            keys[f"{key.group}.{key.name}"] = key
    return keys


def find_key(name: str, case: Case) -> tuple[Key, int | None]:
    """Return a key by its name, and the number of a list entry: 2 for ``"frequency(2)"``.

    Raise InputError, with the groups of the allowed keys, if the case has no such key.
    """
    keys = known_keys(case)
    match = re.fullmatch(r"(\w+(?:\.\w+)?)(?:\(([1-9]\d{0,3})\))?", str(name))
    key = keys.get(match[1]) if match else None
    if match is None or key is None or (match[2] and key.kind != "list"):
        hint = suggestion(str(name).partition("(")[0], keys)
        groups = ", ".join(dict.fromkeys(f"&{entry.group}" for entry in keys.values()))
        refuse(
            f"{shown(name)} is not a key of this case{hint}",
            f"keys of {groups}, density and temperature (`thud --keys` lists them)",
        )
    return key, int(match[2]) if match[2] else None


def with_values(case: Case, values: Mapping[str, object]) -> Case:
    """Return a copy of a case with new values of some keys, named as in `find_key`."""
    assert case.model is not None  # noqa: S101 - studies have a model, see `read_study`
    groups: dict[str, dict[str, Any]] = {}
    for name, value in values.items():
        key, entry = find_key(name, case)
        changes = groups.setdefault(attribute_of(key), {})
        if entry:
            before: Any = getattr(getattr(case, attribute_of(key)), key.name)
            entries = [*(changes.get(key.name) or before)]
            if entry > len(entries):
                refuse(f"{name} does not exist", f"entries 1 to {len(entries)} of the case")
            entries[entry - 1] = value
        changes[key.name] = tuple(entries) if entry else value
    changed = {group: dataclasses.replace(getattr(case, group), **c) for group, c in groups.items()}
    return dataclasses.replace(case, **changed)


def value_in(case: Case, name: str) -> Any:  # noqa: ANN401 - of the type of the key
    """Return the value of a key in a case or of the standard ball; None if there is none."""
    key, entry = find_key(name, case)
    value = getattr(getattr(case.resolved(), attribute_of(key)), key.name, None)
    if isinstance(value, tuple) and entry:
        value = next(iter(value[entry - 1 :]), None)
    return value if isinstance(value, Value) else None


def humanize(name: str) -> str:
    """Return the name of a key, a model or a choice with blanks and proper spelling.

    >>> humanize("youngs_modulus")
    "Young's modulus"
    """
    for key, proper in _PROPER.items():
        name = re.sub(rf"(?<![^\W_]){key}(?![^\W_])", proper, name)
    return name.replace("_", " ")


def limits(key: Key, case: Case) -> tuple[float, float]:
    """Return the limits of a key, evaluated with the values of the other keys of a case."""
    group = getattr(case, attribute_of(key))
    low, high = (getattr(group, e) if isinstance(e, str) else e for e in (key.lower, key.upper))
    return float(low), float(high)
