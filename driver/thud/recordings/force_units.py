"""Units of recorded values, and their calibration to newtons."""

from __future__ import annotations

import itertools
import math
import re
from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

from thud.base.checks import refuse, refuse_value, shown
from thud.base.units import UNITS, find_unit, size_of

if TYPE_CHECKING:
    from thud.base.note import Note

# Units of recorded values: of a force, and of what is proportional to it.
RECORDED = [unit for unit, (base, _) in UNITS.items() if base in {"N", "V", "pC", "counts", "FS"}]
ALLOWED = ", ".join(RECORDED)
EXAMPLES = (
    "such as 250 (N per unit), '250 N/V', '4.1 pC/N, 10 mV/pC', '10 V/FS, 4 mV/N', with a decimal "
    "point"
)
FACTOR = re.compile(
    r"(?P<value>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(?P<top>[^\s/]+)\s*/\s*(?P<bottom>.+)"
)
# Maximum number of factors in a chain, and range of N per unit.
MAX_FACTORS = 8
SIZES = (1e-30, 1e30)


class Factor(NamedTuple):
    """A ratio of two base units: value, numerator and denominator."""

    value: float
    top: str
    bottom: str


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
    notes : tuple of Note
        The time constant of the amplifier, if the calibration comes from a record of a known force,
        what was assumed, and possible faults of the record.
    """

    chain: str
    uncertainty: float | None = None
    origin: str = ""
    notes: tuple[Note, ...] = ()

    def __post_init__(self) -> None:
        """Raise InputError if the chain or the uncertainty are not allowed."""
        if not isinstance(self.chain, str) or not 1 <= len(self.factors) <= MAX_FACTORS:
            refuse_value("calibration", self.chain, f"1 to {MAX_FACTORS} factors, {EXAMPLES}")
        value = self.uncertainty
        if value is not None and not (isinstance(value, int | float) and 0 <= value < 1):
            refuse(f"calibration: uncertainty = {value!r}", "0 <= uncertainty < 1")

    @cached_property
    def factors(self) -> list[Factor]:
        """Factors of the chain; raise InputError if it is none.

        >>> Calibration("10 mV/pC").factors
        [Factor(value=0.01, top='V', bottom='pC')]
        """
        factors = []
        for term in filter(None, map(str.strip, re.split(r"[;,]", self.chain[:1000]))):
            label = f"calibration {term[:60]!r}"
            match = FACTOR.fullmatch(term)
            value = float(match["value"]) if match else 0.0
            if not match or not SIZES[0] < abs(value) < SIZES[1]:
                refuse(f"{label} is not a number with units", EXAMPLES, subject="calibration")
            top, top_size = size_of(require_unit(label, match["top"]))
            bottom, bottom_size = size_of(require_unit(label, match["bottom"]))
            factors.append(Factor(value * top_size / bottom_size, top, bottom))
        return factors

    @property
    def unit(self) -> str:
        """Base unit from which the chain converts to newtons; empty if it is not clear.

        >>> Calibration("4.1 pC/N, 10 mV/pC").unit
        'V'
        """
        others = {unit for _, *units in self.factors for unit in units} - {"N"}
        ends = [unit for unit in others if _product(unit, self.factors) is not None]
        return ends[0] if len(ends) == 1 else ""


def require_unit(label: str, text: object) -> str:
    """Return the unit of recorded values that a text names; raise InputError if it names none."""
    unit = find_unit(text) if isinstance(text, str) else ""
    if unit not in RECORDED:
        refuse(f"{label}: unit = {shown(text)} is not known", ALLOWED, subject="unit")
    return unit


def newtons_per_unit(
    unit: str, calibration: float | Calibration, counts: float | None, label: str
) -> tuple[float, str, float | None]:
    """Return N per unit of the values, its description, and its relative uncertainty or None.

    `unit` is the unit of the values; it may be empty if the calibration is a number, N per value.
    `counts` are the counts at full scale if the values are integers, and `label` names file and
    channel in messages.
    """
    base, size = size_of(unit)
    if isinstance(calibration, Calibration):
        product = _product(base, calibration.factors)
        if product is None and counts:
            product = _product(base, [*calibration.factors, Factor(counts, "counts", "FS")])
        if product is None:
            refuse(
                f"{label}: calibration {calibration.chain!r} does not convert {unit} to N with "
                "all of its factors",
                "no calibration of values in N" if base == "N" else EXAMPLES,
            )
        value, uncertainty = product * size, calibration.uncertainty
        origin = f" ({calibration.origin})" if calibration.origin else ""
        description = f"{calibration.chain}: {value:.6g} N per {unit}{origin}"
    else:
        value, uncertainty = float(calibration), None
        description = f"{calibration:.6g} N per {unit or 'recorded value'}"
    if not SIZES[0] < abs(value) < SIZES[1]:
        refuse_value(f"{label}: calibration", calibration, EXAMPLES)
    return value, description, uncertainty


def _product(unit: str, factors: list[Factor]) -> float | None:
    """Return N per unit as the product of all factors or their inverses; None if none is."""
    # Inverses first: a gain, such as 10 V/V, divides.
    for powers in itertools.product((-1, 1), repeat=len(factors)):
        dimension = Counter({unit: 1})
        dimension.subtract(["N"])
        for power, factor in zip(powers, factors, strict=True):
            dimension[factor.top] += power
            dimension[factor.bottom] -= power
        if not any(dimension.values()):
            return math.prod(
                f.value if p > 0 else 1 / f.value for p, f in zip(powers, factors, strict=True)
            )
    return None
