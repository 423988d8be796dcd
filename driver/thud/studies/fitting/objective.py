"""The objective of a fit: weighted residuals and their derivatives at a place."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from thud.errors import NumericalError, ThudError
from thud.studies.fitting.ranges import with_values

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from tqdm import tqdm

    from thud.case import Case
    from thud.impact import Impact
    from thud.studies.fitting.misfit import Misfit
    from thud.studies.fitting.ranges import Range

# Relative step of the central differences. The forces are smooth to 1e-13, but have kinks where a
# sample enters or leaves the contact: 1e-3 would step over these, 1e-5 rarely does, and derivatives
# are accurate to 1e-7 (with a rising loss factor, where contact is intermittent, to 3e-3).
STEP = 2e-5
# Scale of a shift in time, s.
SHIFT_SCALE = 1e-3


class Objective:
    """Residuals and derivatives of a case; parameters are divided by their scales."""

    def __init__(self, case: Case, ranges: list[Range], misfit: Misfit, bar: tqdm[Any]) -> None:
        self.case, self.ranges, self.misfit, self.bar = case, ranges, misfit, bar
        self.count = len(ranges)
        self.scale = np.array([entry.scale for entry in ranges] + [SHIFT_SCALE] * misfit.free_shift)
        shift = [np.inf] * misfit.free_shift
        self.low = np.array([entry.low for entry in ranges] + [-x for x in shift]) / self.scale
        self.high = np.array([entry.high for entry in ranges] + shift) / self.scale
        self.evaluations = self.failures = 0
        self.error: ThudError | None = None
        self._last: tuple[bytes, Impact] | None = None

    def case_at(self, place: NDArray[np.float64]) -> Case:
        """Return the case of a place."""
        values = place[: self.count] * self.scale[: self.count]
        names = (entry.name for entry in self.ranges)
        return with_values(self.case, dict(zip(names, values, strict=True)))

    def impact(self, place: NDArray[np.float64]) -> Impact | None:
        """Return the impact of a place, or None where there is none."""
        key = place[: self.count].tobytes()
        if self._last and self._last[0] == key:
            return self._last[1]
        self.evaluations += 1
        self.bar.update()
        try:
            impact = self.misfit.solve(self.case_at(place))
        except ThudError as error:
            self.failures += 1
            self.error = error
            return None
        self._last = key, impact
        return impact

    def shift(self, place: NDArray[np.float64]) -> float:
        """Return the time of first touch of a place, s."""
        return float(place[-1] * SHIFT_SCALE) if self.misfit.free_shift else 0.0

    def residual(self, place: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the residuals of a place; infinite where there is no impact."""
        impact = self.impact(place)
        if impact is None:
            return np.full(self.misfit.size, np.inf)
        return self.misfit.residual(impact, self.shift(place))

    def jacobian(self, place: NDArray[np.float64], step: float = STEP) -> NDArray[np.float64]:
        """Return the derivatives of the residuals, shape (n_residual, n)."""
        here = self.residual(place)
        columns = [self._column(place, i, step, here) for i in range(self.count)]
        if self.misfit.free_shift and (impact := self.impact(place)):
            slope = self.misfit.shift_derivative(impact, self.shift(place))
            columns.append(SHIFT_SCALE * slope)
        return np.column_stack(columns)

    def _column(
        self, place: NDArray[np.float64], i: int, step: float, here: NDArray[np.float64]
    ) -> NDArray[np.float64]:
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
        column: NDArray[np.float64] = (high - low) / (above - below)
        return column
