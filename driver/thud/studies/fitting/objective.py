"""The objective of a fit: weighted residuals of all targets and their derivatives at a point x."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from thud.base.errors import NumericalError, ThudError
from thud.base.note import Note
from thud.case.keys import with_values
from thud.studies.fitting.alternatives import alternatives

if TYPE_CHECKING:
    from collections.abc import Collection

    from numpy.typing import NDArray
    from tqdm import tqdm

    from thud.case.case import Case
    from thud.impact.impact import Impact
    from thud.studies.fitting.misfit import Misfit
    from thud.studies.fitting.ranges import Range

    Array = NDArray[np.float64]


class Term(NamedTuple):
    """One target of a fit: its case, its misfit, and the indices of its own parameters in x."""

    case: Case
    misfit: Misfit
    own: slice


def new_terms(targets: list[tuple[Case, Misfit]], count: int) -> list[Term]:
    """Return the terms of a fit of `count` common parameters."""
    terms = []
    for case, misfit in targets:
        stop = count + len(misfit.own)
        terms.append(Term(case, misfit, slice(count, stop)))
        count = stop
    return terms


class Effects(NamedTuple):
    """What the alternatives to a case change, as effects with a standard deviation of 1.

    Attributes
    ----------
    labels : tuple of (str, str)
        Unknown and alternative.
    columns : ndarray, shape (n_residual, n)
        Changes of the residuals; divided by the root of the number of alternatives to an unknown,
        so that the variance of an unknown is their mean square.
    failures : tuple of Note
        Alternatives that cannot be computed.
    """

    labels: tuple[tuple[str, str], ...]
    columns: Array
    failures: tuple[Note, ...]


class Objective:
    """Residuals of all targets and their derivatives; parameters are divided by their scales."""

    def __init__(self, terms: list[Term], ranges: list[Range], bar: tqdm[Any]) -> None:
        self.terms, self.ranges, self.bar = terms, ranges, bar
        self.count = len(ranges)
        own = [scale for term in terms for _, scale in term.misfit.own.values()]
        unlimited = np.full(len(own), np.inf)
        self.scale = np.array([entry.scale for entry in ranges] + own)
        self.low = np.append([entry.low for entry in ranges], -unlimited) / self.scale
        self.high = np.append([entry.high for entry in ranges], unlimited) / self.scale
        self.evaluations = self.failures = 0
        self.error: ThudError | None = None
        self._last: tuple[bytes, list[Impact]] | None = None

    def case_at(self, term: Term, x: Array) -> Case:
        """Return the case of a term at a point x."""
        values = x[: self.count] * self.scale[: self.count]
        names = (entry.name for entry in self.ranges)
        return with_values(term.case, dict(zip(names, values.tolist(), strict=True)))

    def impacts(self, x: Array) -> list[Impact]:
        """Return the impacts of a point, one for each term; an empty list if one fails."""
        key = x[: self.count].tobytes()
        if self._last and self._last[0] == key:
            return self._last[1]
        impacts: list[Impact] = []
        for term in self.terms:
            self.evaluations += 1
            self.bar.update()
            try:
                impacts.append(term.misfit.solve(self.case_at(term, x)))
            except ThudError as error:
                self.failures += 1
                self.error = error
                return []
        self._last = key, impacts
        return impacts

    def own_values(self, term: Term, x: Array) -> Array:
        """Return the own parameters of a term at a point x."""
        values: Array = x[term.own] * self.scale[term.own]
        return values

    def residual(self, x: Array) -> Array:
        """Return the residuals of a point; infinite if an impact fails."""
        impacts = self.impacts(x)
        if not impacts:
            return np.full(sum(term.misfit.size for term in self.terms), np.inf)
        pairs = zip(self.terms, impacts, strict=True)
        return np.concatenate([p.misfit.residual(i, self.own_values(p, x)) for p, i in pairs])

    def jacobian(self, x: Array, fraction: float = 1.0) -> Array:
        """Return the derivatives of the residuals with a fraction of the step, (n_residual, n)."""
        step = fraction * max(term.misfit.step for term in self.terms)
        here = self.residual(x)
        jacobian = np.zeros((len(here), len(x)))
        first = 0
        # First these, because the other columns compute other impacts.
        for term, impact in zip(self.terms, self.impacts(x), strict=False):
            rows = slice(first, first + term.misfit.size)
            slopes = term.misfit.own_derivatives(impact, self.own_values(term, x))
            jacobian[rows, term.own] = slopes * self.scale[term.own]
            first = rows.stop
        for i in range(self.count):
            jacobian[:, i] = self._column(x, i, step, here)
        return jacobian

    def effects(self, x: Array, unknowns: Collection[str]) -> Effects:
        """Return the changes of the residuals by the alternatives to a case."""
        impacts = self.impacts(x)
        fitted = [entry.name for entry in self.ranges]
        columns: dict[tuple[str, str], Array] = {}
        failures: list[Note] = []
        first, size = 0, sum(term.misfit.size for term in self.terms)
        for term, impact in zip(self.terms, impacts, strict=True):
            rows = slice(first, first + term.misfit.size)
            first = rows.stop
            if not term.misfit.has_unknowns:
                continue
            for unknown, label, case in alternatives(self.case_at(term, x), unknowns, fitted):
                column = columns.setdefault((unknown, label), np.zeros(size))
                self.evaluations += 1
                self.bar.update()
                try:
                    other = term.misfit.solve(case)
                except ThudError as error:
                    others = {"alternative": label, "unknown": unknown, "reason": str(error)}
                    failures.append(Note("alternative_failed", others=others))
                    continue
                column[rows] = term.misfit.effect(impact, other, self.own_values(term, x))
        count = Counter(unknown for unknown, _ in columns)
        weighted = [column / np.sqrt(count[key[0]]) for key, column in columns.items()]
        return Effects(
            tuple(columns), np.column_stack([np.empty((size, 0)), *weighted]), tuple(failures)
        )

    def _column(self, x: Array, i: int, step: float, here: Array) -> Array:
        """Return the derivative by one parameter; one-sided if the other side fails."""
        ends = []
        for position in (min(x[i] + step, self.high[i]), max(x[i] - step, self.low[i])):
            beside = x.copy()
            beside[i] = position
            value = self.residual(beside)
            possible = np.isfinite(value).all()
            ends.append((position, value) if possible else (x[i], here))
        (above, high), (below, low) = ends
        if above == below:
            message = (
                f"{self.ranges[i].name}: the model cannot be computed around "
                f"{x[i] * self.scale[i]:g} ({self.error})"
            )
            raise NumericalError(message)
        column: Array = (high - low) / (above - below)
        return column
