"""Levels as the target of a fit whose search a surrogate predicts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from thud.base.checks import refuse
from thud.base.errors import NumericalError
from thud.case.keys import value_in
from thud.studies.fitting.level_target import LevelMisfit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.case.case import Case
    from thud.impact.impact import Impact
    from thud.studies.fitting.misfit import Misfit
    from thud.studies.fitting.ranges import Range
    from thud.studies.trained_surrogate import Surrogate


@dataclass(frozen=True, eq=False)
class PredictedLevels:
    """Quantities of one drop from a surrogate, in the units of a target, shape (size,)."""

    values: NDArray[np.float64]


class SurrogateLevels(LevelMisfit):
    """Misfit between a target and the levels that a surrogate predicts."""

    def __init__(self, misfit: LevelMisfit, surrogate: Surrogate, case: Case) -> None:
        vars(self).update(vars(misfit))
        self.surrogate = surrogate
        self.name = f"{self.kind or case.levels.force}_{self.bands}"
        if self.name not in surrogate.outputs:
            refuse(f"the surrogate has no {self.name}", f"{', '.join(surrogate.outputs)}")

    def solve(self, case: Case) -> Impact:
        """Return the prediction for a case in place of an impact; only `values` reads it."""
        columns: dict[str, Any] = {
            name: np.array([value_in(case, name)]) for name in self.surrogate.keys
        }
        result = self.surrogate.predict(case, columns)
        if result["status"][0]:
            raise NumericalError(result["reason"][0])
        levels = result[self.name][0][self.indices]
        values = np.concatenate([levels, *(result[name] for name in self.extra)])
        if not np.isfinite(values).all():
            refuse("the surrogate withholds a quantity of the target", "other quantities")
        return cast("Impact", PredictedLevels(values))

    def values(self, impact: Impact) -> NDArray[np.float64]:
        """Return the compared quantities, dB, s and 1, shape (size,)."""
        return impact.values if isinstance(impact, PredictedLevels) else super().values(impact)


def surrogate_misfit(
    misfit: Misfit, surrogate: Surrogate, case: Case, names: list[str]
) -> SurrogateLevels:
    """Return the misfit of a target with the predictions of a surrogate."""
    if not isinstance(misfit, LevelMisfit):
        refuse("surrogate is not allowed for a force", "levels as target")
    surrogate.require(case, names)
    return SurrogateLevels(misfit, surrogate, case)


def within_region(entry: Range, surrogate: Surrogate) -> Range:
    """Return the range of a parameter inside the region of a surrogate."""
    low, high = surrogate.region[surrogate.keys.index(entry.name)].tolist()
    low, high = max(low, entry.low), min(high, entry.high)
    if not low < entry.start < high:
        refuse(
            f"[parameters] {entry.name}: start = {entry.start:g} is outside the region of the "
            "surrogate",
            f"{low:g} < start < {high:g} {entry.unit}".rstrip(),
        )
    spread = max(low, entry.spread[0]), min(high, entry.spread[1])
    return replace(entry, low=low, high=high, spread=spread)
