"""Criteria of the standards, and the verdict on all of them."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from thud.base.display import Displayed

if TYPE_CHECKING:
    from thud.base._schema import LimitsSource

# Header of a table of criteria.
CELLS = ("criterion", "value", "limits", "verdict")


@dataclass(frozen=True, eq=False, repr=False)
class Criterion(Displayed):
    """One quantity and the range that the standards require.

    Attributes
    ----------
    name, unit : str
        Name and unit of the quantity; levels in dB re 1 N.
    value, lower, upper : float
        Value of the source, and the limits, which are allowed values.
    conforms : bool
        Whether the value lies within the limits.
    """

    name: str
    unit: str
    value: float
    lower: float
    upper: float
    conforms: bool

    def __repr__(self) -> str:
        """Return value, limits and verdict."""
        name, value, limits, found = self._row()
        return f"<Criterion, {name}: {f'{value} {found}'.strip()}, allowed {limits}>"

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text."""
        return [CELLS, self._row()]

    def _row(self) -> tuple[str, ...]:
        name = re.sub(r"(\d)_(\d)", r"\1.\2", self.name).replace("_", " ")
        missed = "is too low" if self.value < self.lower else "is too high"
        missed = "is not known" if math.isnan(self.value) else missed
        found = "conforms" if self.conforms else missed
        limits = f"{self.lower:g} to {self.upper:g}"
        value = "" if math.isnan(self.value) else f"{self.value:.4g} {self.unit}".strip()
        return name, value, limits, found


@dataclass(frozen=True, eq=False, repr=False)
class Conformity(Displayed):
    """Verdict on a source.

    Attributes
    ----------
    source : str
        Source whose limits apply.
    criteria : tuple of Criterion
        Octave levels, contact time, restitution, number of peaks, mass, drop height.
    """

    source: LimitsSource
    criteria: tuple[Criterion, ...]

    @property
    def conforms(self) -> bool:
        """Whether all criteria are met."""
        return all(criterion.conforms for criterion in self.criteria)

    @property
    def verdict(self) -> str:
        """``"conforms"``, ``"does not conform"`` or ``"cannot be decided"``.

        The last where all criteria are met but those whose value, NaN, is not known.
        """
        if self.conforms:
            return "conforms"
        missed = [criterion for criterion in self.criteria if not criterion.conforms]
        known = any(not math.isnan(criterion.value) for criterion in missed)
        return "does not conform" if known else "cannot be decided"

    def __repr__(self) -> str:
        """Return the verdict, and which criteria are not met."""
        missed = [one for one in self.criteria if not one.conforms]
        failed = ", ".join(one.name for one in missed if not math.isnan(one.value))
        unknown = ", ".join(one.name for one in missed if math.isnan(one.value))
        words = [self.verdict, failed and f"in {failed};", unknown and f"not known: {unknown}"]
        return f"<Conformity, {self.source}: {' '.join(filter(None, words)).removesuffix(';')}>"

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text."""
        rows = (row for one in self.criteria for row in one.rows()[1:])
        return [CELLS, *rows, ("all criteria", "", "", self.verdict)]

    def __bool__(self) -> bool:
        """Return whether all criteria are met."""
        return self.conforms
