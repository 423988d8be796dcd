"""Units of recorded values, and their calibration to newtons."""

from __future__ import annotations

import itertools
import math
import re
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np

from thud.base import units
from thud.base.checks import refuse, refuse_value, shown

if TYPE_CHECKING:
    from thud.base.note import Note

# By unit: base unit, and base units per unit.
UNITS = {
    unit: entry
    for unit, entry in units.UNITS.items()
    if entry[0] in {"N", "V", "pC", "counts", "FS"}
}
# Unit of values that are assumed to be in N, because none is stated.
ASSUMED = "N?"
ALLOWED = ", ".join(UNITS)
EXAMPLES = "such as 250 (N per unit), '250 N/V', '4.1 pC/N, 10 mV/pC', '10 V/FS, 4 mV/N'"
FACTOR = re.compile(
    r"(?P<value>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(?P<top>[^\s/]+)\s*/\s*(?P<bottom>.+)"
)
T = TypeVar("T")
# Maximum number of factors in a chain, and range of N per unit.
MAX_FACTORS = 8
SIZES = (1e-30, 1e30)


class Factor(NamedTuple):
    """A ratio of two base units: value, numerator and denominator."""

    value: float
    top: str
    bottom: str


class TimeConstant(NamedTuple):
    """Time constant of an amplifier, s, from a record of a known force.

    Attributes
    ----------
    value : float
        Time constant, s; infinite if the record shows no droop.
    uncertainty : float
        Its relative standard uncertainty.
    minimum : float
        Value, s, above which it lies with a probability of 95 %.
    """

    value: float
    uncertainty: float
    minimum: float

    def __str__(self) -> str:
        """Return a sentence for reports."""
        if math.isinf(self.value):
            return f"no droop: a time constant above {self.minimum:.2g} s"
        return (
            f"droop with a time constant of {self.value:.4g} s, standard uncertainty "
            f"{100 * self.uncertainty:.2g} %, taken off"
        )


@dataclass(frozen=True)
class Calibration:
    """Conversion of recorded values to newtons.

    Attributes
    ----------
    chain : str
        Factors from the recorded unit to newtons, in any order: ``"250 N/V"``, or with a charge
        amplifier ``"4.1 pC/N, 10 mV/pC"``.
    uncertainty : float or None
        Relative standard uncertainty; None if unknown.
    origin : str
        Where the calibration comes from, for reports.
    time_constant : TimeConstant or None
        Time constant of the amplifier, if the calibration comes from a record of a known force.
    notes : tuple of Note
        What was assumed, and possible faults of the record.
    """

    chain: str
    uncertainty: float | None = None
    origin: str = ""
    time_constant: TimeConstant | None = None
    notes: tuple[Note, ...] = ()

    def __post_init__(self) -> None:
        """Raise InputError if the chain or the uncertainty are not allowed."""
        read_chain(self.chain)
        value = self.uncertainty
        if value is not None and not (isinstance(value, int | float) and 0 <= value < 1):
            refuse(f"calibration: uncertainty = {value!r}", "0 <= uncertainty < 1")


def find_unit(text: str) -> str:
    """Return the unit of a recorded value that a text names, or an empty string.

    >>> find_unit("Newtons"), find_unit("mmHg")
    ('N', '')
    """
    unit = units.find_unit(text)
    return unit if unit in UNITS else ""


def require_unit(text: object, label: str) -> str:
    """Return the unit that a text names; raise InputError if it names none."""
    unit = find_unit(text) if isinstance(text, str) else ""
    if not unit:
        refuse(f"{label}: unit = {shown(text)} is not known", ALLOWED, subject="unit")
    return unit


def read_chain(text: object) -> list[Factor]:
    """Return the factors of a chain; raise InputError if the text is not a chain.

    >>> read_chain("10 mV/pC")
    [Factor(value=0.01, top='V', bottom='pC')]
    """
    if not isinstance(text, str):
        refuse_value("calibration", text, EXAMPLES)
    terms = [term.strip() for term in re.split(r"[;,]", text[:1000]) if term.strip()]
    factors = []
    for term in terms:
        match = FACTOR.fullmatch(term)
        value = float(match["value"]) if match else 0.0
        if term.lstrip("+-").isdecimal() and "," in text:
            refuse(
                f"calibration: {text[:60]!r} has a decimal comma",
                f"a point, {EXAMPLES}",
                subject="calibration",
            )
        if not match or not SIZES[0] < abs(value) < SIZES[1]:
            refuse(
                f"calibration: {term[:60]!r} is not a number with units",
                EXAMPLES,
                subject="calibration",
            )
        (top, top_factor), (bottom, bottom_factor) = (
            UNITS[require_unit(match[side], f"calibration {term[:60]!r}")]
            for side in ("top", "bottom")
        )
        factors.append(Factor(value * top_factor / bottom_factor, top, bottom))
    if not 1 <= len(factors) <= MAX_FACTORS:
        refuse(f"calibration: {len(factors)} factors", f"1 to {MAX_FACTORS}, {EXAMPLES}")
    return factors


def plain_number(calibration: T) -> T | float:
    """Return a calibration, as a number if it is the text of one."""
    try:
        return float(calibration) if isinstance(calibration, str) else calibration
    except ValueError:
        return calibration


def unit_of_chain(calibration: str | Calibration) -> str:
    """Return the base unit from which a chain converts to newtons; empty if it is not clear.

    >>> unit_of_chain("4.1 pC/N, 10 mV/pC")
    'V'
    """
    chain = calibration.chain if isinstance(calibration, Calibration) else calibration
    factors = read_chain(chain)
    others = {unit for factor in factors for unit in (factor.top, factor.bottom)} - {"N"}
    ends = [unit for unit in others if _product(unit, factors) is not None]
    return ends[0] if len(ends) == 1 else ""


def newtons_per_unit(
    unit: str, calibration: float | str | Calibration | None, counts: float | None, label: str
) -> tuple[float, str, float | None]:
    """Return N per unit of the values, its description, and its relative uncertainty or None.

    `unit` is the unit of the values, or `ASSUMED`; it may be empty if the calibration is a number,
    N per value. The calibration is None if the values are forces. `counts` are the counts at full
    scale if the values are integers, and `label` names file and channel in messages.
    """
    if unit == ASSUMED:
        return 1.0, "values assumed to be in N", None
    base, multiple = units.size_of(unit)
    if calibration is None:
        if base != "N":
            description = "full-scale values" if unit == "FS" else f"values in {unit}"
            refuse(
                f"{label}: enter a calibration: the file holds {description}",
                EXAMPLES,
                subject="calibration",
            )
        return multiple, f"values in {unit}", None
    if isinstance(calibration, int | float | np.number) and not isinstance(calibration, bool):
        if not SIZES[0] < abs(calibration) < SIZES[1]:
            refuse_value(f"{label}: calibration", calibration, EXAMPLES)
        return float(calibration), f"{calibration:.6g} N per {unit or 'recorded value'}", None
    stated = calibration if isinstance(calibration, Calibration) else Calibration(str(calibration))
    factors = read_chain(stated.chain)
    size = _product(base, factors)
    if size is None and counts:
        size = _product(base, [*factors, Factor(counts, "counts", "FS")])
    if size is None:
        refuse(
            f"{label}: calibration {stated.chain!r} does not convert {unit} to N with all of "
            "its factors",
            EXAMPLES,
        )
    value = size * multiple
    if not SIZES[0] < abs(value) < SIZES[1]:
        refuse(f"{label}: calibration {stated.chain!r} gives {value:g} N per {unit}", EXAMPLES)
    origin = f" ({stated.origin})" if stated.origin else ""
    return value, f"{stated.chain}: {value:.6g} N per {unit}{origin}", stated.uncertainty


def _product(unit: str, factors: list[Factor]) -> float | None:
    """Return N per unit as the product of all factors or their inverses; None if none is."""
    # Inverses first: a gain, such as 10 V/V, divides.
    for powers in itertools.product((-1, 1), repeat=len(factors)):
        dimension = Counter({"N": -1})
        dimension[unit] += 1
        for power, factor in zip(powers, factors, strict=True):
            dimension[factor.top] += power
            dimension[factor.bottom] -= power
        if not any(dimension.values()):
            sizes = (
                f.value if p > 0 else 1 / f.value for p, f in zip(powers, factors, strict=True)
            )
            return math.prod(sizes)
    return None
