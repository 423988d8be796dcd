"""The objective of a fit: weighted residuals of all targets and their derivatives at a place."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base.errors import NumericalError, ThudError
from thud.studies.fitting.ranges import with_values

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from tqdm import tqdm

    from thud.case.case import Case
    from thud.impact.impact import Impact
    from thud.studies.fitting.misfit import Misfit
    from thud.studies.fitting.ranges import Range

    Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Part:
    """One target of a fit.

    Attributes
    ----------
    case : Case
        The case with what is fixed for this target.
    misfit : Misfit
        Its comparison with an impact.
    place : slice
        Its own parameters in a place.
    """

    case: Case
    misfit: Misfit
    place: slice


def new_parts(targets: list[tuple[Case, Misfit]], count: int) -> list[Part]:
    """Return the parts of a fit of `count` common parameters."""
    found = []
    for case, misfit in targets:
        behind = count + len(misfit.own)
        found.append(Part(case, misfit, slice(count, behind)))
        count = behind
    return found


class Objective:
    """Residuals and derivatives of cases; parameters are divided by their scales."""

    def __init__(self, parts: list[Part], ranges: list[Range], bar: tqdm[Any]) -> None:
        self.parts, self.ranges, self.bar = parts, ranges, bar
        self.count = len(ranges)
        own = [scale for part in parts for _, scale in part.misfit.own.values()]
        unlimited = np.full(len(own), np.inf)
        self.scale = np.array([entry.scale for entry in ranges] + own)
        self.low = np.append([entry.low for entry in ranges], -unlimited) / self.scale
        self.high = np.append([entry.high for entry in ranges], unlimited) / self.scale
        self.evaluations = self.failures = 0
        self.error: ThudError | None = None
        self._last: tuple[bytes, list[Impact]] | None = None

    def case_at(self, part: Part, place: Array) -> Case:
        """Return the case of a part at a place."""
        values = place[: self.count] * self.scale[: self.count]
        names = (entry.name for entry in self.ranges)
        return with_values(part.case, dict(zip(names, values, strict=True)))

    def impacts(self, place: Array) -> list[Impact]:
        """Return the impacts of a place, one for each part; none where one is impossible."""
        key = place[: self.count].tobytes()
        if self._last and self._last[0] == key:
            return self._last[1]
        found: list[Impact] = []
        for part in self.parts:
            self.evaluations += 1
            self.bar.update()
            try:
                found.append(part.misfit.solve(self.case_at(part, place)))
            except ThudError as error:
                self.failures += 1
                self.error = error
                return []
        self._last = key, found
        return found

    def own(self, part: Part, place: Array) -> Array:
        """Return the own parameters of a part at a place."""
        values: Array = place[part.place] * self.scale[part.place]
        return values

    def residual(self, place: Array) -> Array:
        """Return the residuals of a place; infinite where there is no impact."""
        impacts = self.impacts(place)
        if not impacts:
            return np.full(sum(part.misfit.size for part in self.parts), np.inf)
        pairs = zip(self.parts, impacts, strict=True)
        return np.concatenate([p.misfit.residual(i, self.own(p, place)) for p, i in pairs])

    def jacobian(self, place: Array, share: float = 1.0) -> Array:
        """Return the derivatives of the residuals by a share of the step, (n_residual, n)."""
        step = share * max(part.misfit.step for part in self.parts)
        here = self.residual(place)
        jacobian = np.zeros((len(here), len(place)))
        first = 0
        # Before the columns, which compute other impacts.
        for part, impact in zip(self.parts, self.impacts(place), strict=False):
            rows = slice(first, first + part.misfit.size)
            slopes = part.misfit.own_derivatives(impact, self.own(part, place))
            jacobian[rows, part.place] = slopes * self.scale[part.place]
            first = rows.stop
        for i in range(self.count):
            jacobian[:, i] = self._column(place, i, step, here)
        return jacobian

    def _column(self, place: Array, i: int, step: float, here: Array) -> Array:
        """Return the derivative by one parameter; one-sided where the other side is impossible."""
        ends = []
        for beside in (min(place[i] + step, self.high[i]), max(place[i] - step, self.low[i])):
            other = place.copy()
            other[i] = beside
            value = self.residual(other)
            possible = np.isfinite(value).all()
            ends.append((beside, value) if possible else (place[i], here))
        (above, high), (below, low) = ends
        if above == below:
            message = (
                f"{self.ranges[i].name}: the model cannot be computed around "
                f"{place[i] * self.scale[i]:g} ({self.error})"
            )
            raise NumericalError(message)
        column: Array = (high - low) / (above - below)
        return column
