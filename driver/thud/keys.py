"""Keys that studies vary and fits search for, read from the library's own table of them."""

from __future__ import annotations

import dataclasses
import math
import re
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Literal

from thud._api import api, text
from thud.errors import InputError
from thud.models import LISTS, MODELS, group_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from thud.case import Case

Kind = Literal["real", "whole", "choice", "flag", "list"]
Value = float | int | str | bool

# What every model shares; and what says which files a run writes, which does nothing for a set.
SHARED = ("ball", "drop", "sampling", "levels", "limits")
_OF_FILES = {"snapshot_interval"}

_LINE = re.compile(
    r"^(?:! )?&(?P<group>\w+)$"
    r"|^!? +! (?P<meaning>.*); allowed: (?P<allowed>.*)$"
    r"|^!? +(?P<key>\w+) =",
    re.MULTILINE,
)
_RANGE = re.compile(
    r"(?P<lower>\S+) <=? \w+ <=? (?P<upper>[^\s,]+)(?: (?P<unit>[^\s,]+))?(?P<whole>, whole)?$"
)


# Keys whose upper end is another key.
_DEPENDENT = {"wall_thickness": "outer_radius"}


@dataclass(frozen=True)
class Key:
    """One key of the input.

    Attributes
    ----------
    group, name : str
        Namelist group and name; studies have two more, `density` and `temperature`.
    meaning, unit : str
        What it means, and its unit; the unit is empty for a pure number.
    kind : str
        ``"real"``, ``"whole"``, ``"choice"``, ``"flag"`` or ``"list"`` (of numbers).
    choices : tuple of str
        What a choice may be.
    lower, upper : float or str
        Ends of the allowed range of numbers; a text names the key that is the end.
    """

    group: str
    name: str
    meaning: str
    unit: str = ""
    kind: Kind = "real"
    choices: tuple[str, ...] = ()
    lower: float | str = -math.inf
    upper: float | str = math.inf


# Keys of studies alone: they act on the mass and on the modulus of elasticity of the ball.
DENSITY = Key("ball", "density", "density of the wall", "kg/m3")
TEMPERATURE = Key("ball", "temperature", "temperature of the ball", "degC")


@cache
def key_table() -> tuple[Key, ...]:
    """Return every key of the library."""
    found = []
    group = meaning = allowed = ""
    for line in _LINE.finditer(text(api.keys())):
        if line["group"]:
            group = line["group"]
        elif line["key"]:
            found.append(_key(group, line["key"], meaning, allowed))
        else:
            meaning, allowed = line["meaning"], line["allowed"]
    return tuple(found)


def _key(group: str, name: str, meaning: str, allowed: str) -> Key:
    """Return a key by what the library says of it."""
    limits = _RANGE.match(allowed)
    unit = (limits["unit"] or "") if limits else ""
    kind: Kind = "real"
    if name in LISTS:
        kind = "list"
    elif allowed.startswith("'"):
        kind = "choice"
    elif allowed.startswith("."):
        kind = "flag"
    elif limits and limits["whole"]:
        kind = "whole"
    ends: tuple[float | str, ...] = ()
    if limits:
        upper = _DEPENDENT.get(name)
        ends = (float(limits["lower"]), upper or float(limits["upper"]))
    return Key(group, name, meaning, unit, kind, tuple(re.findall(r"'(\w+)'", allowed)), *ends)


def limits(key: Key, case: Case) -> tuple[float, float]:
    """Return the range of a number; ends that are other keys have their values in a case."""
    lower, upper = (
        getattr(case.ball, end) if isinstance(end, str) else end for end in (key.lower, key.upper)
    )
    return lower, upper


@cache
def known_keys(model: str) -> Mapping[str, Key]:
    """Return the keys that sets of a model may differ in, by their names."""
    groups = {*SHARED, *(group_of(model, option) for option in dataclasses.fields(MODELS[model]))}
    known = {
        key.name: key for key in key_table() if key.group in groups and key.name not in _OF_FILES
    }
    return MappingProxyType(known | {key.name: key for key in (DENSITY, TEMPERATURE)})


def find_key(name: str, model: str) -> tuple[Key, int | None]:
    """Return a key by its name, and which entry of a list is meant: ``"frequency(2)"``.

    Raises
    ------
    InputError
        Where the model has no such key; lists those that it has.
    """
    known = known_keys(model)
    match = re.fullmatch(r"(\w+)(?:\(([1-9]\d{0,3})\))?", name)
    key = known.get(match[1]) if match else None
    if match is None or key is None or (match[2] and key.kind != "list"):
        message = f"{name!r} is not a key of {model}; allowed: {', '.join(known)}"
        raise InputError(message)
    return key, int(match[2]) if match[2] else None


def put(case: Case, values: Mapping[str, object]) -> Case:
    """Return a case with other values of some keys.

    Parameters
    ----------
    case
        The case.
    values
        Values by the names of keys, entries of lists as ``"frequency(2)"``.

    Returns
    -------
    Case
        The case with these values.
    """
    assert case.model is not None  # noqa: S101 - studies have a model, see `read_study`
    groups: dict[str, dict[str, object]] = {}
    for name, value in values.items():
        key, entry = find_key(name, case.model.name)
        group = key.group if key.group in SHARED else "model"
        place = groups.setdefault(group, {})
        if entry is None:
            place[key.name] = value
        else:
            entries = list(place.get(key.name, getattr(case.model, key.name)))  # type: ignore[call-overload]
            if entry > len(entries):
                message = (
                    f"{name} does not exist; allowed: an entry of the {len(entries)} "
                    f"that the case has"
                )
                raise InputError(message)
            entries[entry - 1] = value
            place[key.name] = tuple(entries)
    changed = {
        group: dataclasses.replace(getattr(case, group), **found) for group, found in groups.items()
    }
    return dataclasses.replace(case, **changed)


def plain_words(name: str) -> str:
    """Return the name of a key in words.

    >>> plain_words("youngs_modulus")
    "Young's modulus"
    """
    persons = {"youngs": "Young's", "poisson": "Poisson's"}
    return " ".join(persons.get(word, word) for word in name.split("_"))
