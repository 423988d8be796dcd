"""Parameters of a study: which key varies or is fitted, and its values."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import ndtri

from thud.base._schema import KEYS
from thud.base.checks import (
    MAX_NUMBER,
    refuse,
    refuse_unknown,
    refuse_value,
    require_choice,
    require_number,
    require_whole,
    shown,
    suggestion,
)
from thud.base.immutable import Plain
from thud.base.key import Key
from thud.base.units import power_of, scaled
from thud.case.keys import Value, find_key, limits, with_values
from thud.impact.datasets import coordinate_name

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from thud.case.case import Case

# Maximum number of samples, of values of a parameter, and of base samples: their results fill
# some GB of memory.
MAX_VALUES = 2**24
# Entries of the table of a varying parameter besides `unit`, by the entry that selects the form
# (list, range or normal distribution), and entries of the table of a fitted parameter.
ENTRIES_BY_FORM = {
    "values": ("values",),
    "low": ("low", "high", "count", "scale"),
    "std": ("mean", "std"),
}
FIT_ENTRIES = ("start", "low", "high")
# A start at a limit is moved away from it by this fraction of itself.
INSIDE = 0.01
# Limits of the library that exceed the start by this factor are ignored.
FAR = 10.0
# Other starts lie within this factor of the first where no limits are given.
SPREAD = 2.0
# Kinds of keys whose values are numbers.
NUMERIC_KINDS = ("real", "whole", "list")
_SCALES = ("linear", "log")


@dataclass(frozen=True, eq=False)
class Parameter(Plain):
    """A parameter of a study, as stated by its table in ``[parameters]``.

    Attributes
    ----------
    start : float or None
        Start of a fit; by default the value of the case.
    low, high : float or None
        Range of the values, or limits of a fit, by default those of the key.
    values : sequence or None
        The values; a random design draws each with equal probability.
    count : int
        Number of values from `low` to `high` in a grid.
    scale : str
        ``"linear"`` or ``"log"``: spacing of the values.
    mean, std : float or None
        Mean and standard deviation of a normal distribution; the mean is by default the value of
        the case.
    unit : str or None
        Unit in which a user states these numbers; by default that of the key. A study converts the
        numbers to the unit of the key and keeps `unit` for tables and figures.
    name : str
        Name of the key, or of an entry of a list, such as ``"frequency(2)"``; set by the study.
    key : Key
        The key; set by the study.
    """

    start: float | None = None
    low: float | None = None
    high: float | None = None
    values: Sequence[Value] | None = None
    count: int = 0
    scale: str = _SCALES[0]
    mean: float | None = None
    std: float | None = None
    unit: str | None = None
    name: str = ""
    key: Key = field(default=Key("", "", ""), repr=False)

    @property
    def coordinate_name(self) -> str:
        """Name of its coordinate in datasets."""
        return coordinate_name(self.name, self.key)

    @property
    def table(self) -> dict[str, object]:
        """Its table in a study, without defaults."""
        words = (word for word in vars(self) if word not in {"name", "key"})
        return {w: vars(self)[w] for w in words if vars(self)[w] != getattr(Parameter, w)}

    @property
    def shown_unit(self) -> tuple[str, int]:
        """Unit for tables and figures, and the exponent of ten that converts it to `key.unit`."""
        if not self.unit:
            return self.key.unit or "1", 0
        return self.unit, power_of(self.unit, self.key.unit, self.name)

    @property
    def size(self) -> int:
        """Number of values in a grid."""
        whole = self.key.kind == "whole" and self.count
        return len(self.grid()) if whole or self.values is not None else self.count

    def grid(self) -> NDArray[np.generic]:
        """Return the values of a grid."""
        if self.values is not None:
            return np.array(self.values)
        if self.low is None or self.high is None:
            return np.empty(0)
        spaced: Any = np.geomspace if self.scale == "log" else np.linspace
        values: NDArray[Any] = spaced(self.low, self.high, self.count)
        return np.unique(np.rint(values).astype(int)) if self.key.kind == "whole" else values

    def quantiles(self, fraction: NDArray[np.float64]) -> NDArray[np.generic]:
        """Return the values below which fractions of all values lie."""
        if self.values is not None:
            return np.take(self.grid(), (fraction * len(self.values)).astype(int))
        if self.std is not None and self.mean is not None:
            # The quantile of 0 is infinite.
            return np.asarray(self.mean + self.std * ndtri(np.maximum(fraction, 2.0**-54)))
        assert self.low is not None  # noqa: S101 - see `read_varied`
        assert self.high is not None  # noqa: S101
        whole = self.key.kind == "whole"
        # A whole number has the probability of the interval up to the next one.
        high = self.high + 1 if whole else self.high
        if self.scale == "log":
            result = self.low * (high / self.low) ** fraction
        else:
            result = self.low + fraction * (high - self.low)
        return np.minimum(np.floor(result), self.high).astype(int) if whole else result

    def __str__(self) -> str:
        """Return the numbers in the unit of the key."""
        entries = {word: value for word, value in self.table.items() if word != "unit"}
        return f"{entries} {self.key.unit} (stated in {self.shown_unit[0]})"


def read_varied(name: str, table: object, case: Case, default_mean: Value | None) -> Parameter:
    """Return a parameter that varies; `default_mean` is its value in the case."""
    words = [word for form in ENTRIES_BY_FORM.values() for word in form]
    label, key, entries, power = _read_table(name, table, case, words)
    form = next((form for form in ENTRIES_BY_FORM if form in entries), None)
    if form is None:
        refuse(
            f"{label} = {shown(table)} has no values",
            "a table with values = [...], with low and high, or with std; each may have a unit",
        )
    refuse_unknown(f"{label} with {form}", entries, (*ENTRIES_BY_FORM[form], "unit"))
    if form != "values" and key.kind not in NUMERIC_KINDS:
        allowed = ", ".join(map(repr, key.choices)) or "true, false"
        refuse(f"{label}: its values are not numbers", f"values = [...] of {allowed}")
    values = entries.get("values", ())
    if form == "values" and values in ([], ()):
        refuse_value(f"{label}: values", values, "at least one value")
    numbers: dict[str, Any] = {
        word: float(read_value(f"{label}: {word}", key, entries[word], power))
        for word in ("low", "high", "mean", "std")
        if word in entries
    }
    result = {word: value for word, value in entries.items() if word not in numbers}
    result |= numbers
    if form == "values":
        listed = values if isinstance(values, list | tuple) else [values]
        result["values"] = tuple(read_value(f"{label}: values", key, v, power) for v in listed)
    elif form == "low":
        _check_range(label, key, result, entries)
    else:
        _check_normal(label, key, result, default_mean)
    return Parameter(**result, name=name, key=key)


def _check_range(label: str, key: Key, table: Mapping[str, Any], stated: Mapping[str, Any]) -> None:
    """Raise InputError for a range that is not allowed; `table` has numbers in the key's unit."""
    if "high" not in table:
        refuse(f"{label} has low but not high", "both low and high")
    low, high, scale = table["low"], table["high"], table.get("scale", _SCALES[0])
    require_choice(f"{label}: scale", scale, _SCALES)
    if not low < high or (scale == "log" and low <= 0):
        allowed = "0 < low < high" if scale == "log" else "low < high"
        refuse_value(f"{label}: low", stated["low"], allowed)
    if "count" in table:
        most = min(int(high - low) + 1, MAX_VALUES) if key.kind == "whole" else MAX_VALUES
        require_whole(f"{label}: count", table["count"], 2, most)


def _check_normal(label: str, key: Key, table: dict[str, Any], default_mean: Value | None) -> None:
    """Raise InputError for a normal distribution that is not allowed; add its mean."""
    if key.kind == "whole":
        refuse(f"{label}: std is not allowed for a whole number", "values = [...], or low and high")
    if not table["std"] > 0:
        refuse_value(f"{label}: std", table["std"], f"0 {key.unit} < std")
    mean = table.setdefault("mean", default_mean)
    if mean is None or not math.isfinite(float(mean)):
        refuse(f"{label} has no mean", "both mean and std")
    table["mean"] = float(mean)


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
    """Return a parameter of a fit; raise InputError if it cannot be fitted.

    The entry is its table, a `Parameter`, its start, or None.
    """
    known = known_parameters(case)
    if name not in known:
        model = case.model.name if case.model else ""
        refuse(
            f"[parameters] {name} is not a parameter of {model} that can be fitted"
            f"{suggestion(name, known)}",
            ", ".join(known),
        )
    if isinstance(entry, Parameter):
        entry = entry.table
    elif not isinstance(entry, Mapping):
        entry = {} if entry is None else {"start": entry}
    label, key, table, power = _read_table(name, entry, case, FIT_ENTRIES)
    numbers: dict[str, Any] = {}
    for word, value in table.items():
        if word != "unit" and value is not None:
            require_number(f"{label}: {word}", value)
            numbers[word] = scaled(value, power) if power else float(value)
    return Parameter(**numbers, unit=table.get("unit"), name=name, key=key)


def get_ranges(case: Case, parameters: Sequence[Parameter]) -> list[Range]:
    """Return ranges of parameters; raise InputError if a start is outside its limits."""
    # Limits that are other keys take their values at the start.
    begin = with_values(case, {p.name: p.start for p in parameters if p.start is not None})
    starts = known_parameters(begin)
    result = []
    for parameter in parameters:
        name, key = parameter.name, parameter.key
        start, (lower, upper) = float(starts[name][1]), limits(key, begin)
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
        result.append(Range(name, key.unit, start, low, high, scale, spread))
    return result


def _read_table(
    name: str, table: object, case: Case, allowed: Sequence[str]
) -> tuple[str, Key, Mapping[str, Any], int]:
    """Return label, key and table of a parameter, and the exponent of ten of its unit."""
    label = f"[parameters] {name}"
    key, index = find_key(name, case)
    if key.kind == "list" and index is None:
        refuse(f"{label} is a list", f"one of its entries, such as {name + '(1)'!r}")
    if not isinstance(table, Mapping):
        refuse(f"{label} = {shown(table)} is not a table", f"{', '.join(allowed)}, unit")
    refuse_unknown(label, table, (*allowed, "unit"))
    unit = table.get("unit")
    return label, key, table, 0 if unit is None else power_of(unit, key.unit, label)


def read_value(label: str, key: Key, value: object, power: int) -> Value:
    """Return a value in the unit of its key; raise InputError if it is of another kind."""
    number = math.nan
    if isinstance(value, int | float) and not isinstance(value, bool):
        number = float(value) if -MAX_NUMBER < value < MAX_NUMBER else math.inf
        number = scaled(number, power) if power else number
    valid, allowed, result = {
        "choice": (value in key.choices, ", ".join(map(repr, key.choices)), value),
        "flag": (isinstance(value, bool), "true, false", value),
        "whole": (number.is_integer(), "whole numbers", number),
    }.get(key.kind, (math.isfinite(number), "finite numbers", number))
    if not valid:
        refuse_value(label, value, allowed)
    return int(number) if key.kind == "whole" else result  # type: ignore[return-value]


def read_quantity(label: str, entry: object, unit: str) -> Any:  # noqa: ANN401 - a value of any kind
    """Return a value or a list, converted to a unit if it is a table of ``value`` and ``unit``."""
    if not isinstance(entry, Mapping):
        return entry
    refuse_unknown(label, entry, ("value", "unit"))
    power = power_of(entry.get("unit", unit or "1"), unit, label)
    if "value" not in entry:
        refuse(f"{label} has no value", "value, and its unit")
    value: Any = entry["value"]
    numbers = value if isinstance(value, list) else [value]
    if "unit" in entry:
        for number in numbers:
            require_number(label, number)
        numbers = [scaled(number, power) for number in numbers]
    return numbers if isinstance(value, list) else numbers[0]
