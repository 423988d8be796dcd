"""Parameters that can be fitted: the real numbers of ball, drop and model, with their ranges."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from thud.checks import require_kind, require_number
from thud.errors import InputError
from thud.keys import key_table, put
from thud.models import LISTS, group_of

if TYPE_CHECKING:
    from thud.case import Case
    from thud.keys import Key

# A start that lies on a limit is moved away from it by this part of itself.
INSIDE = 0.01
# A limit of the library that is this much larger than the start does not guide the search.
FAR = 10.0
# Other starts lie within this factor of the first where no limits are given.
SPREAD = 2.0


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
    real = {(key.group, key.name): key for key in key_table() if key.kind in {"real", "list"}}
    found: dict[str, tuple[str, Key, float]] = {}
    for part, group, name in places:
        key = real.get((group, name))
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
    return put(case, {name: float(value) for name, value in values.items()})


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
    require_kind("parameters", parameters, Iterable)
    if isinstance(parameters, str):
        parameters = [parameters]
    if not isinstance(parameters, Mapping):
        parameters = dict.fromkeys(parameters)
    if not parameters:
        message = f"parameters: none is given; allowed: {', '.join(known_parameters(case))}"
        raise InputError(message)
    found = []
    for name, given in parameters.items():
        require_known(case, name, "parameters: ")
        wish = given if isinstance(given, Parameter) else Parameter(given)
        for word, value in vars(wish).items():
            if value is not None:
                require_number(f"{name}: {word}", value)
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
