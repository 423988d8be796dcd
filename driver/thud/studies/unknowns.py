"""What is not known of a source: keys of its case, and the distributions of their values."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from thud.base._schema import KEYS, FiniteElement
from thud.base.checks import refuse
from thud.base.note import Note
from thud.base.units import display_unit
from thud.case.case import impact_only

if TYPE_CHECKING:
    from thud.case.case import Case
    from thud.studies.arrays import Array

# Minimum and maximum order of the damping laws of rubber; 1: Kelvin–Voigt.
ORDER_RANGE = (0.2, 1.0)
# Standard deviation over the range from which a normal distribution is uniform within 1e-6.
_MAX_RATIO = 1e3


@dataclass(frozen=True)
class Unknown:
    """A key of a case whose value is not known.

    Attributes
    ----------
    key : str
        Name of the key.
    low, high : float
        Minimum and maximum, in the unit of the key.
    standard_deviation : float
        Of a normal distribution around the value of the case, truncated at minimum and maximum;
        0: uniform.
    reason : str
        Reason of the range, with its source.
    """

    key: str
    low: float
    high: float
    standard_deviation: float
    reason: str

    @property
    def note(self) -> Note:
        """Range and reason."""
        unit = next((key.unit for key in KEYS if key.name == self.key), "")
        unit, size = display_unit(unit, max(abs(self.low), abs(self.high)))
        low, high = self.low / size, self.high / size
        return Note("unknown_range", self.key, math.nan, low, high, unit, {"reason": self.reason})

    def quantiles(self, fraction: Array, value: float) -> Array:
        """Return the values below which fractions of all values lie; `value` is of the case."""
        if not 0 < self.standard_deviation < _MAX_RATIO * (self.high - self.low):
            return self.low + fraction * (self.high - self.low)
        # SciPy is slow to import.
        from scipy.special import ndtr, ndtri

        ends = (np.array([self.low, self.high]) - value) / self.standard_deviation
        low, high = ndtr(ends)
        result: Array = value + self.standard_deviation * ndtri(low + fraction * (high - low))
        return np.clip(result, self.low, self.high)


def stated_unknowns(case: Case) -> tuple[Unknown, ...]:
    """Return the unknowns that a case states."""
    stated = case.unknowns
    if not stated:
        return ()
    deviations = stated.standard_deviation or (0.0,) * len(stated.key)
    columns = (stated.key, stated.low, stated.high, deviations, stated.reason)
    if len({len(column) for column in columns}) > 1:
        lengths = ", ".join(str(len(column)) for column in columns)
        refuse(
            f"&unknowns: key, low, high, standard_deviation and reason have {lengths} entries",
            "one entry for each key",
        )
    return tuple(Unknown(*entries) for entries in zip(*columns, strict=True))


def blocked_case(case: Case, unknowns: tuple[Unknown, ...]) -> Case:
    """Return the drop of a case on a rigid floor alone, with a damping law of any order.

    The Kelvin–Voigt law is the fractional law of order 1.
    """
    model = case.model
    is_viscous = isinstance(model, FiniteElement) and model.viscosity == "kelvin_voigt"
    if is_viscous and any(entry.key == "fractional_order" for entry in unknowns):
        model = replace(model, viscosity="fractional", fractional_order=ORDER_RANGE[1])  # type: ignore[type-var]
    return replace(impact_only(case), model=model, floor=None, room=None)
