"""Parameters that can be fitted: the real numbers of ball, drop and model, with their ranges."""

from __future__ import annotations

import re
from dataclasses import dataclass, fields, replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from thud._library import door, text
from thud.checks import require_kind
from thud.errors import InputError
from thud.models import LISTS, group_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from thud.case import Case

# How many units of a kind make one of the library's, by the unit of the library.
UNITS = {
    "Pa": {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "N/mm2": 1e6},
    "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
    "kg": {"kg": 1.0, "g": 1e-3},
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6},
    "Hz": {"Hz": 1.0, "kHz": 1e3},
    "": {"1": 1.0, "%": 1e-2},
}
# The ones that tables and figures choose from, ascending.
HANDY = {"Pa": ("Pa", "kPa", "MPa"), "m": ("mm", "m"), "s": ("ms", "s"), "Hz": ("Hz", "kHz")}
# A start that lies on a limit is moved away from it by this part of itself.
INSIDE = 0.01
# A limit of the library that is this much larger than the start does not guide the search.
FAR = 10.0
# Other starts lie within this factor of the first where no limits are given.
SPREAD = 2.0

_GROUP = re.compile(r"(?:! )?&(\w+)")
_RANGE = re.compile(
    r"allowed: (?P<lower>\S+) <=? (?P<name>\w+) <=? (?P<upper>[^\s,]+)(?: (?P<unit>\S+))?$"
)


@dataclass(frozen=True)
class Key:
    """A key of the input that takes real numbers.

    Attributes
    ----------
    lower, upper : float
        Ends of the allowed range.
    unit : str
        Unit, empty where there is none.
    """

    lower: float
    upper: float
    unit: str


@dataclass(frozen=True)
class Parameter:
    """What is known of a parameter before the fit, SI units.

    Attributes
    ----------
    start : float or None
        Where the search starts; by default the value of the base case.
    lower, upper : float or None
        Limits of the search; by default those of the input (``thud --keys``).
    """

    start: float | None = None
    lower: float | None = None
    upper: float | None = None


@dataclass(frozen=True)
class Range:
    """A parameter with everything that the search needs, SI units.

    Attributes
    ----------
    name, unit : str
        Name of the key, with the place in brackets where it takes a list; its unit.
    start, lower, upper : float
        Start and limits of the search.
    scale : float
        What the parameter is measured in: its start, or a tenth of the range where that is 0.
    spread : tuple of float
        Between these lie other starts.
    """

    name: str
    unit: str
    start: float
    lower: float
    upper: float
    scale: float
    spread: tuple[float, float]


@cache
def keys() -> dict[tuple[str, str], Key]:
    """Return every key that takes real numbers, by group and name, as the library tells them."""
    found = {}
    group = ""
    for line in text(door.keys()).splitlines():
        if head := _GROUP.match(line):
            group = head[1]
        elif rule := _RANGE.search(line):
            lower, upper = float(rule["lower"]), float(rule["upper"])
            found[group, rule["name"]] = Key(lower, upper, rule["unit"] or "")
    return found


def known_parameters(case: Case) -> dict[str, tuple[str, Key, float]]:
    """Return attribute of the case, key and value of everything that can be fitted, by name.

    Entries of lists are counted from 1, as in a namelist: ``"frequency(1)"``.
    """
    model = case.model
    if model is None:
        message = "&model is missing; allowed: a base case with a source model"
        raise InputError(message)
    places = [
        *(("ball", "ball", option.name) for option in fields(case.ball)),
        *(("drop", "drop", option.name) for option in fields(case.drop)),
        *(("model", group_of(model.name, option), option.name) for option in fields(model)),
    ]
    found: dict[str, tuple[str, Key, float]] = {}
    for part, group, name in places:
        # A range of whole numbers ends with that word and is no range of real ones.
        key = keys().get((group, name))
        value = getattr(getattr(case, part), name)
        if key is None:
            continue
        if name not in LISTS:
            found[name] = part, key, value
        elif name != "static_families":
            found |= {f"{name}({i})": (part, key, v) for i, v in enumerate(value, start=1)}
    return found


def with_values(case: Case, values: Mapping[str, float]) -> Case:
    """Return a case with other values of some parameters."""
    known = known_parameters(case)
    changes: dict[str, dict[str, object]] = {"ball": {}, "drop": {}, "model": {}}
    for name, value in values.items():
        part = known[name][0]
        base, _, place = name.partition("(")
        if place:
            entries = list(changes[part].get(base, getattr(getattr(case, part), base)))  # type: ignore[call-overload]
            entries[int(place[:-1]) - 1] = float(value)
            changes[part][base] = tuple(entries)
        else:
            changes[part][base] = float(value)
    return replace(
        case,
        ball=replace(case.ball, **changes["ball"]),  # type: ignore[arg-type]
        drop=replace(case.drop, **changes["drop"]),  # type: ignore[arg-type]
        model=replace(case.model, **changes["model"]),  # type: ignore[type-var]
    )


def require_known(case: Case, name: str, where: str) -> Key:
    """Return the key of a parameter or complain with the list of those that are known."""
    known = known_parameters(case)
    if name not in known:
        model = case.model.name if case.model else ""
        message = (
            f"{where}{name} is not a parameter of {model} that can be fitted; "
            f"allowed: {', '.join(known)}"
        )
        raise InputError(message)
    return known[name][1]


def get_ranges(
    case: Case, parameters: Iterable[str] | Mapping[str, Parameter | float | None]
) -> list[Range]:
    """Return start, limits and scale of the parameters of a fit.

    Raises
    ------
    InputError
        Where a parameter is not known, or its start and limits do not fit together.
    """
    if isinstance(parameters, str):
        parameters = [parameters]
    if not hasattr(parameters, "items"):
        parameters = dict.fromkeys(parameters)
    if not parameters:
        message = f"parameters: none is given; allowed: {', '.join(known_parameters(case))}"
        raise InputError(message)
    found = []
    for name, given in parameters.items():
        require_known(case, name, "parameters: ")
        wish = given if isinstance(given, Parameter) else Parameter(given)
        require_kind(name, wish.start, float | int | np.floating | None)
        found.append(_get_range(case, name, wish))
    return found


def _get_range(case: Case, name: str, wish: Parameter) -> Range:
    """Return start, limits and scale of one parameter."""
    _, key, value = known_parameters(case)[name]
    start = float(value if wish.start is None else wish.start)
    scale = abs(start) or ((wish.upper or key.upper) - (wish.lower or key.lower)) / 10
    lower = key.lower if wish.lower is None else float(wish.lower)
    upper = key.upper if wish.upper is None else float(wish.upper)
    if not key.lower <= lower < upper <= key.upper:
        message = (
            f"parameters: {name}: lower = {lower:g} and upper = {upper:g} are not allowed; "
            f"allowed: {key.lower:g} <= lower < upper <= {key.upper:g} {key.unit}".rstrip()
        )
        raise InputError(message)
    if not lower <= start <= upper:
        message = (
            f"parameters: {name}: start = {start:g} is not allowed; "
            f"allowed: {lower:g} <= start <= {upper:g} {key.unit}".rstrip()
        )
        raise InputError(message)
    spread = (
        max(lower, start - scale / SPREAD) if wish.lower is None else lower,
        min(upper, start + scale * (SPREAD - 1)) if wish.upper is None else upper,
    )
    if wish.upper is None and upper > FAR * scale:
        upper = np.inf
    if wish.lower is None and lower < -FAR * scale:
        lower = -np.inf
    room = min(INSIDE * scale, (upper - lower) / 4)
    start = min(max(start, lower + room), upper - room)
    return Range(name, key.unit, start, lower, upper, scale, spread)


def unit_factor(name: str, key_unit: str, unit: object) -> float:
    """Return how many of the library's units are one of another.

    Raises
    ------
    InputError
        Where the unit does not fit the parameter.
    """
    if unit == key_unit:
        return 1.0
    known = UNITS.get(key_unit, {})
    if not isinstance(unit, str) or unit not in known:
        allowed = ", ".join(map(repr, known or [key_unit]))
        message = f"{name}: unit = {unit!r} is not allowed; allowed: {allowed}"
        raise InputError(message)
    return known[unit]


def handy_unit(unit: str, value: float) -> tuple[str, float]:
    """Return a unit in which a value has a digit before its point, and how many SI units it is."""
    known = {name: UNITS.get(unit, {}).get(name) for name in HANDY.get(unit, ())}
    small = [(name, factor) for name, factor in known.items() if factor and factor <= abs(value)]
    return small[-1] if small and value else (unit, 1.0)
