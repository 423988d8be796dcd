"""Parameters of a study: which key varies, and how its values are spread."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from scipy.special import ndtri

from thud.checks import LARGEST, require_whole, shown
from thud.errors import InputError
from thud.keys import Key, Value, find_key
from thud.units import power_of, scaled

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray


@dataclass(frozen=True)
class Listed:
    """Values as they stand in the study; where they are drawn, each is as likely."""

    values: tuple[Value, ...]

    @property
    def size(self) -> int:
        """Number of values in a grid."""
        return len(self.values)

    def grid(self) -> NDArray[Any]:
        """Return the values of a grid."""
        return np.array(self.values)

    def quantile(self, share: NDArray[np.float64]) -> NDArray[Any]:
        """Return the values below which a share of all lies."""
        values = self.grid()
        return np.take(values, (share * len(values)).astype(int))


@dataclass(frozen=True)
class Uniform:
    """Values between two ends, evenly or evenly in their logarithms; `count` of them in a grid."""

    low: float
    high: float
    count: int = 0
    logarithmic: bool = False
    whole: bool = False

    @property
    def size(self) -> int:
        """Number of values in a grid; very many are not made for it, whole numbers are few."""
        return len(self.grid()) if self.whole and self.count else self.count

    def grid(self) -> NDArray[Any]:
        """Return the values of a grid."""
        ends = (self.low, self.high, self.count)
        values: NDArray[Any] = np.geomspace(*ends) if self.logarithmic else np.linspace(*ends)
        return np.unique(np.rint(values).astype(int)) if self.whole else values

    def quantile(self, share: NDArray[np.float64]) -> NDArray[Any]:
        """Return the values below which a share of all lies."""
        # Every whole number has the share between itself and the next.
        high = self.high + 1 if self.whole else self.high
        if self.logarithmic:
            found = self.low * (high / self.low) ** share
        else:
            found = self.low + share * (high - self.low)
        return np.minimum(np.floor(found), self.high).astype(int) if self.whole else found


@dataclass(frozen=True)
class Normal:
    """Values of a normal distribution."""

    mean: float
    deviation: float
    size: ClassVar = 0

    def grid(self) -> NDArray[Any]:
        """Return no values: a normal distribution has no grid."""
        return np.empty(0)

    def quantile(self, share: NDArray[np.float64]) -> NDArray[Any]:
        """Return the values below which a share of all lies."""
        # A share of exactly 0 would be infinitely far out.
        values: NDArray[Any] = self.mean + self.deviation * ndtri(np.maximum(share, 2.0**-54))
        return values


@dataclass(frozen=True)
class Parameter:
    """One parameter of a study.

    Attributes
    ----------
    name : str
        Its name in the study: that of the key, entries of lists as ``"frequency(2)"``.
    key : Key
        The key that varies.
    spread : Listed, Uniform or Normal
        How its values are spread, in the unit of the key.
    unit : str
        The unit in which the study gives them, for figures.
    """

    name: str
    key: Key
    spread: Listed | Uniform | Normal
    unit: str

    @property
    def numeric(self) -> bool:
        """The values are numbers."""
        return self.key.kind in {"real", "whole", "list"}


# More values of a parameter, or base samples, than this do not fit into memory.
MAX_VALUES = 2**30
# What a parameter may be given by; `unit` may stand with each of them.
_FORMS = {
    "values": {"values"},
    "low": {"low", "high", "count", "scale"},
    "std": {"mean", "std"},
}


def new_parameter(name: str, given: object, model: str, centre: Value | None) -> Parameter:
    """Return a parameter from what the study says of it.

    Parameters
    ----------
    name
        Its name.
    given
        A table of the study.
    model
        The source model.
    centre
        Value of the key in the base case: the mean where none is given.

    Raises
    ------
    InputError
        Where there is no such key, or no such spread of it.
    """
    place = f"[parameters] {name}"
    key, entry = find_key(name, model)
    if key.kind == "list" and entry is None:
        message = f"{place} is a list; allowed: one entry of it, such as {name + '(1)'!r}"
        raise InputError(message)
    form = next((form for form in _FORMS if isinstance(given, dict) and form in given), None)
    if form is None or not isinstance(given, dict):
        message = (
            f"{place} = {given!r} has no values; allowed: a table with values = [...], or low and "
            f"high, or std, and unit"
        )
        raise InputError(message)
    for word in given:
        if word not in _FORMS[form] | {"unit"}:
            allowed = ", ".join(sorted(_FORMS[form] | {"unit"}))
            message = f"{place}: {word} is not known beside {form}; allowed: {allowed}"
            raise InputError(message)
    unit = given.get("unit", key.unit or "1")
    power = power_of(unit, key.unit, place)
    if form == "values":
        return Parameter(name, key, _listed(place, key, given["values"], power), unit)
    if key.kind not in {"real", "whole", "list"}:
        allowed = ", ".join(map(repr, key.choices)) or "true, false"
        message = f"{place} is not a number; allowed: values = [...] of {allowed}"
        raise InputError(message)
    if form == "low":
        return Parameter(name, key, _uniform(place, key, given, power), unit)
    return Parameter(name, key, _normal(place, key, given, power, centre), unit)


def checked(place: str, key: Key, value: object, power: int) -> Value:
    """Return one value in the unit of its key.

    Raises
    ------
    InputError
        Where the key takes no such value.
    """
    if key.kind == "choice" and value in key.choices:
        return str(value)
    if key.kind == "flag" and isinstance(value, bool):
        return value
    if key.kind in {"real", "whole", "list"} and _is_number(value):
        number = scaled(value, power)  # type: ignore[arg-type]
        if key.kind != "whole" and math.isfinite(number):
            return number
        if number.is_integer():
            return int(number)
    allowed = {
        "choice": ", ".join(map(repr, key.choices)),
        "flag": "true, false",
        "whole": "whole numbers",
    }.get(key.kind, "finite numbers")
    message = f"{place} = {shown(value)} is not allowed; allowed: {allowed}"
    raise InputError(message)


def within(place: str, key: Key, value: object, power: int) -> Value:
    """Return one value in the unit of its key, in the range that the library takes at most.

    Raises
    ------
    InputError
        Where the key takes no such value.
    """
    found = checked(place, key, value, power)
    if isinstance(found, int | float) and not key.lower <= found <= key.upper:
        unit = f" {key.unit}" if key.unit else ""
        message = (
            f"{place} = {shown(value)} is not allowed; "
            f"allowed: {key.lower:g} to {key.upper:g}{unit}"
        )
        raise InputError(message)
    return found


def _is_number(value: object) -> bool:
    """Return whether a value is a finite number that a float holds."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return -LARGEST < value < LARGEST


def _listed(place: str, key: Key, values: object, power: int) -> Listed:
    """Return a list of values."""
    if not isinstance(values, list | tuple) or not values:
        message = f"{place}: values = {values!r} is empty or no list; allowed: [one, or, more]"
        raise InputError(message)
    return Listed(tuple(checked(f"{place}: values", key, value, power) for value in values))


def _uniform(place: str, key: Key, given: Mapping[str, Any], power: int) -> Uniform:
    """Return values between two ends."""
    if "high" not in given:
        message = f"{place} has no high end; allowed: high beside low"
        raise InputError(message)
    low, high = (float(checked(f"{place}: {end}", key, given[end], power)) for end in _ENDS)
    whole = key.kind == "whole"
    if whole and not key.lower <= low <= high <= key.upper:
        message = (
            f"{place}: low = {low:g} and high = {high:g} are not allowed; "
            f"allowed: {key.lower:g} <= low < high <= {key.upper:g}"
        )
        raise InputError(message)
    count, scale = given.get("count", 0), given.get("scale", "linear")
    if scale not in _SCALES:
        message = f"{place}: scale = {scale!r} is not known; allowed: {', '.join(_SCALES)}"
        raise InputError(message)
    if not low < high or (scale == "log" and low <= 0):
        message = f"{place}: low = {given['low']!r} is not allowed; allowed: low < high"
        raise InputError(message + (", 0 < low" if scale == "log" else ""))
    if "count" in given:
        require_whole(f"{place}: count", count, 2, int(high - low) + 1 if whole else MAX_VALUES)
    return Uniform(low, high, count, scale == "log", whole)


_ENDS = ("low", "high")
_SCALES = ("linear", "log")


def _normal(
    place: str, key: Key, given: Mapping[str, Any], power: int, centre: Value | None
) -> Normal:
    """Return a normal distribution, by default around the value of the base case."""
    if key.kind == "whole":
        message = f"{place} is a whole number; allowed: values = [...], or low and high"
        raise InputError(message)
    deviation = float(checked(f"{place}: std", key, given["std"], power))
    if not deviation > 0:
        message = f"{place}: std = {given['std']!r} is not allowed; allowed: 0 < std"
        raise InputError(message)
    if "mean" in given:
        centre = checked(f"{place}: mean", key, given["mean"], power)
    if centre is None or not math.isfinite(float(centre)):
        message = f"{place} has no mean; allowed: mean beside std"
        raise InputError(message)
    return Normal(float(centre), deviation)
