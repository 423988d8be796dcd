"""Parameters that can be fitted: the real numbers of ball, drop and model, with their ranges."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from thud.base._schema import KEYS
from thud.base.checks import refuse, require_kind, suggestion
from thud.case.keys import limits, with_values
from thud.studies.parameter import read_fitted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from thud.base.key import Key
    from thud.case.case import Case
    from thud.studies.parameter import Parameter

# A start at a limit is moved away from it by this fraction of itself.
INSIDE = 0.01
# Limits of the library that exceed the start by this factor are ignored.
FAR = 10.0
# Other starts lie within this factor of the first where no limits are given.
SPREAD = 2.0


@dataclass(frozen=True)
class Range:
    """Start and limits of a parameter of a fit, SI units.

    The search divides it by `scale`: its start, or a tenth of the range if that is 0. Other starts
    lie within `spread`.
    """

    name: str
    unit: str
    start: float
    low: float
    high: float
    scale: float
    spread: tuple[float, float]


def known_parameters(case: Case) -> dict[str, tuple[Key, float]]:
    """Return key and value of all parameters that can be fitted, by name.

    Entries of lists are counted from 1, as in a namelist: ``"frequency(1)"``.
    """
    case = case.resolved()
    model = case.model
    if model is None:
        refuse("&model is missing", "a case with a source model")
    result: dict[str, tuple[Key, float]] = {}
    for key in KEYS:
        if key.group not in {"ball", "drop"} and key.owner != model.name:
            continue
        value = getattr(model if key.owner else getattr(case, key.group), key.name)
        if key.kind == "real":
            result[key.name] = key, value
        elif key.kind == "list" and not key.whole:
            result |= {f"{key.name}({i})": (key, v) for i, v in enumerate(value, start=1)}
    return result


def fitted_parameter(name: str, entry: object, case: Case) -> Parameter:
    """Return a parameter of a fit; raise InputError if it cannot be fitted."""
    known = known_parameters(case)
    if name not in known:
        model = case.model.name if case.model else ""
        refuse(
            f"[parameters] {name} is not a parameter of {model} that can be fitted"
            f"{suggestion(name, known)}",
            ", ".join(known),
        )
    return read_fitted(name, entry, case)


def bound_parameters(
    case: Case, parameters: Iterable[str] | Mapping[str, Parameter | float | None]
) -> tuple[Parameter, ...]:
    """Return the parameters of a call of `thud.fit`."""
    require_kind("parameters", parameters, Iterable)
    if isinstance(parameters, str):
        parameters = [parameters]
    if not isinstance(parameters, Mapping):
        parameters = dict.fromkeys(map(str, parameters))
    if not parameters:
        refuse("parameters is empty", ", ".join(known_parameters(case)))
    return tuple(fitted_parameter(name, entry, case) for name, entry in parameters.items())


def get_ranges(case: Case, parameters: Sequence[Parameter]) -> list[Range]:
    """Return ranges of parameters; raise InputError if a start is outside its limits."""
    # Limits that are other keys take their values at the start.
    begin = with_values(case, {p.name: p.start for p in parameters if p.start is not None})
    starts = known_parameters(begin)
    return [_get_range(begin, p, float(starts[p.name][1])) for p in parameters]


def _get_range(case: Case, parameter: Parameter, start: float) -> Range:
    name, key = parameter.name, parameter.key
    lower, upper = limits(key, case)
    scale = abs(start) or ((parameter.high or upper) - (parameter.low or lower)) / 10
    low = lower if parameter.low is None else parameter.low
    high = upper if parameter.high is None else parameter.high
    if not lower <= low < high <= upper:
        refuse(
            f"[parameters] {name}: low = {low:g} and high = {high:g} are not allowed",
            f"{lower:g} <= low < high <= {upper:g} {key.unit}".rstrip(),
        )
    if not low <= start <= high:
        refuse(
            f"[parameters] {name}: start = {start:g} is not allowed",
            f"{low:g} <= start <= {high:g} {key.unit}".rstrip(),
        )
    spread = (
        max(low, start - scale / SPREAD) if parameter.low is None else low,
        min(high, start + scale * (SPREAD - 1)) if parameter.high is None else high,
    )
    if parameter.high is None and high > FAR * scale:
        high = np.inf
    if parameter.low is None and low < -FAR * scale:
        low = -np.inf
    margin = min(INSIDE * scale, (high - low) / 4)
    start = min(max(start, low + margin), high - margin)
    return Range(name, key.unit, start, low, high, scale, spread)
