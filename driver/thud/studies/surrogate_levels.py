"""Levels as the target of a fit whose search a surrogate predicts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from thud.base.checks import refuse
from thud.base.errors import NumericalError
from thud.base.immutable import freeze
from thud.case.keys import value_in
from thud.impact.compute import compute
from thud.level.levels import BANDWIDTHS
from thud.studies.fitting.level_target import LevelMisfit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.case.case import Case
    from thud.impact.impact import Impact
    from thud.studies.fitting.fit_result import Fit
    from thud.studies.fitting.misfit import Misfit
    from thud.studies.fitting.ranges import Range
    from thud.studies.trained_surrogate import Surrogate


@dataclass(frozen=True, eq=False)
class PredictedLevels:
    """Quantities of one drop from a surrogate, in the units of a target, shape (size,)."""

    values: NDArray[np.float64]


class SurrogateLevels(LevelMisfit):
    """Misfit between a target and the levels that a surrogate predicts.

    The mean squares of its held-out errors are added to the variances of the target, if known.
    """

    def __init__(self, misfit: LevelMisfit, surrogate: Surrogate, case: Case) -> None:
        vars(self).update(vars(misfit))
        self.surrogate = surrogate
        self.name = f"{self.kind or case.levels.force}_level"
        if self.bands != BANDWIDTHS[0]:
            self.name = self.name.replace("_", f"_{self.bands}_")
        if self.name not in surrogate.outputs:
            refuse(f"the surrogate has no {self.name}", f"{', '.join(surrogate.outputs)}")
        level_errors = np.sqrt(surrogate.mean_square(self.name))[self.indices]
        ratios = [np.sqrt(surrogate.mean_square(n)[0]) * np.log(10) / 20 for n in self.extra]
        other_targets = self.target[len(level_errors) :]
        other_errors = [np.array([r * s]) for r, s in zip(ratios, other_targets, strict=True)]
        for i, quantity in enumerate(self.extra):
            if quantity == "contact_time":
                # Many drops have a contact time rounded to the next sample.
                other_errors[i] = np.hypot(other_errors[i], 1 / case.sampling.sample_rate)
        self.model_error = freeze(np.concatenate([level_errors, *other_errors]))
        if self.known_noise:
            self.deviation = freeze(np.hypot(self.deviation, self.model_error))

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


def recompute(fit: Fit) -> Fit:
    """Return a fit with the impacts of the model, and warnings if the surrogate differs."""
    targets = []
    max_deviation = max_fraction = 0.0
    for target in fit.targets:
        misfit = cast("SurrogateLevels", target.misfit)
        impact = compute(target.case)
        deviation = np.abs(misfit.values(impact) - misfit.values(target.impact))
        # Quantities that are equal in all training drops have no error.
        varies = misfit.model_error > 0
        max_deviation = max(
            max_deviation, float((deviation[varies] / misfit.model_error[varies]).max(initial=0.0))
        )
        if misfit.known_noise:
            max_fraction = max(
                max_fraction, float((misfit.model_error / misfit.deviation).max() ** 2)
            )
        targets.append(replace(target, impact=impact))
    messages = []
    if max_fraction:
        messages.append(
            f"the errors of the surrogate are up to {100 * max_fraction:.2g} % of the variances of "
            "the residuals"
        )
    # Exceeded by 1 in 15 000 normal errors; held-out errors have longer tails.
    if max_deviation > 4:  # noqa: PLR2004
        messages.append(
            f"at the result the model differs from the surrogate by {max_deviation:.2g} standard "
            "deviations of the surrogate's errors"
        )
    return replace(fit, targets=tuple(targets), warnings=(*fit.warnings, *messages))
