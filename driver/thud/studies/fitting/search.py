"""The search for the parameters of a model that fit all targets best."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from thud.base.checks import MAX_SEED, refuse, require_whole
from thud.base.errors import NumericalError, ThudError
from thud.base.note import Note
from thud.case.keys import with_values
from thud.studies.fitting.alternatives import UNKNOWNS, alternatives, require_unknowns
from thud.studies.fitting.inference import require_confidence
from thud.studies.sampling import unit_samples

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

    from tqdm import tqdm

    from thud.case.case import Case
    from thud.studies.arrays import Array
    from thud.studies.fitting.comparison import Comparison, Own
    from thud.studies.fitting.ranges import Range


# Relative steps and gains at which the search ends.
TOLERANCE = 1e-8


# Maximum number of starts, and of steps of a search.
_MAXIMUM = 100_000


class SearchOptions(NamedTuple):
    """Options of a search, see `thud.fit`."""

    confidence: float = 0.95
    starts: int = 1
    seed: int = 0
    max_steps: int = 100
    unknowns: Sequence[str] = UNKNOWNS

    def require(self) -> None:
        """Raise InputError if an option is not allowed."""
        require_confidence(self.confidence)
        require_whole("starts", self.starts, 1, _MAXIMUM)
        require_whole("max_steps", self.max_steps, 1, _MAXIMUM)
        require_whole("seed", self.seed, 0, MAX_SEED)
        require_unknowns(self.unknowns, UNKNOWNS)


class Term(NamedTuple):
    """One target of a fit.

    Attributes
    ----------
    case : Case
        The case, with what is fixed for this target.
    comparison : Comparison
        Its residuals.
    own : slice
        Indices of its own parameters in x.
    rows : slice
        Indices of its residuals.
    """

    case: Case
    comparison: Comparison[Any]
    own: slice
    rows: slice


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

    def __init__(self, terms: Sequence[Term], ranges: Sequence[Range], bar: tqdm[Any]) -> None:
        self.terms, self.ranges, self.bar = terms, ranges, bar
        self.count, self.size = len(ranges), terms[-1].rows.stop
        own = (entry for term in terms for entry in term.comparison.own.values())
        self.parameters: list[Range | Own] = [*ranges, *own]
        self.scale = np.array([entry.scale for entry in self.parameters])
        self.low = np.array([entry.low for entry in self.parameters]) / self.scale
        self.high = np.array([entry.high for entry in self.parameters]) / self.scale
        self.evaluations = self.failures = 0
        self.error: ThudError | None = None
        self._results: dict[bytes, list[Any]] = {}

    def case_at(self, term: Term, x: Array) -> Case:
        """Return the case of a term at a point x."""
        values = (x[: self.count] * self.scale[: self.count]).tolist()
        names = (entry.name for entry in self.ranges)
        return with_values(term.case, dict(zip(names, values, strict=True)))

    def _solve(self, term: Term, case: Case) -> Any:  # noqa: ANN401 - what the target compares
        """Return what the model of a case computes, and count it."""
        self.evaluations += 1
        self.bar.update()
        return term.comparison.solve(case)

    def results(self, x: Array) -> list[Any]:
        """Return what the model computes at a point for each term; an empty list if one fails."""
        key = x[: self.count].tobytes()
        if key in self._results:
            return self._results[key]
        try:
            results = [self._solve(term, self.case_at(term, x)) for term in self.terms]
        except ThudError as error:
            self.failures += 1
            self.error = error
            return []
        # The point, those beside it, and the next one.
        if len(self._results) > 2 * self.count + 1:
            del self._results[next(iter(self._results))]
        self._results[key] = results
        return results

    def residual(self, x: Array) -> Array:
        """Return the residuals of a point; infinite if a model fails."""
        results = self.results(x)
        if not results:
            return np.full(self.size, np.inf)
        own = x * self.scale
        pairs = zip(self.terms, results, strict=True)
        return np.concatenate([p.comparison.residual(i, own[p.own]) for p, i in pairs])

    def jacobian(self, x: Array, fraction: float = 1.0) -> Array:
        """Return the derivatives of the residuals with a fraction of the step, (n_residual, n)."""
        step = fraction * max(term.comparison.step for term in self.terms)
        here = self.residual(x)
        jacobian = np.zeros((self.size, len(x)))
        # Own parameters first: they need no other results.
        for i in reversed(range(len(x))):
            jacobian[:, i] = self._column(x, i, step, here)
        return jacobian

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

    def effects(self, x: Array, unknowns: Collection[str]) -> Effects:
        """Return the changes of the residuals of forces by the alternatives to a case."""
        fitted = [entry.name for entry in self.ranges]
        columns: dict[tuple[str, str], Array] = {}
        failures: list[Note] = []
        for term, result in zip(self.terms, self.results(x), strict=True):
            comparison, own = term.comparison, (x * self.scale)[term.own]
            if not comparison.has_alternatives:
                continue
            here = comparison.residual(result, own)
            for unknown, label, case in alternatives(self.case_at(term, x), unknowns, fitted):
                column = columns.setdefault((unknown, label), np.zeros(self.size))
                try:
                    other = self._solve(term, case)
                except ThudError as error:
                    others = {"alternative": label, "unknown": unknown, "reason": str(error)}
                    failures.append(Note("alternative_failed", others=others))
                    continue
                # On a mobile floor by its force.
                column[term.rows] = comparison.residual(other.on_floor or other, own) - here
        count = Counter(unknown for unknown, _ in columns)
        weighted = [column / np.sqrt(count[key[0]]) for key, column in columns.items()]
        shapes = np.column_stack([np.empty((self.size, 0)), *weighted])
        return Effects(tuple(columns), shapes, tuple(failures))


def require_data(terms: Sequence[Term], count: int) -> None:
    """Raise InputError if targets determine fewer than `count` parameters of a model."""
    comparisons = [term.comparison for term in terms]
    known = all(comparison.known_noise for comparison in comparisons)
    if len(terms) > 1 and not known:
        number = [comparison.known_noise for comparison in comparisons].index(False)
        is_level = comparisons[number].unit == "dB"
        source = "uncertainty" if is_level else "noise, or 50 independent values of background,"
        refuse(
            f"target {number + 1}: the weight of its residuals is not known",
            f"{source} where there are several targets",
        )
    count += sum(len(comparison.own) for comparison in comparisons)
    size = sum(comparison.size - comparison.absorbed for comparison in comparisons)
    minimum = count if known else count + 1
    if size < minimum:
        refuse(
            f"target: {size} data for {count} parameters are too few",
            f"{minimum} or more" + ("" if known else " where no noise is given"),
        )


def find_best(objective: Objective, options: SearchOptions) -> OptimizeResult:
    """Return the best of the least-squares solutions from all starts.

    Raises the error of the first start if there is none.
    """
    best: OptimizeResult | None = None
    failures: list[ThudError] = []
    for start in starts_of(objective.ranges, int(options.starts), int(options.seed)):
        try:
            result = minimize(objective, _with_own(objective, start), int(options.max_steps))
        except ThudError as error:
            failures.append(error)
            continue
        if best is None or result.cost < best.cost:
            best = result
    if best is None:
        raise failures[0]
    return best


def starts_of(ranges: Sequence[Range], count: int, seed: int) -> Iterator[Array]:
    """Yield starts over their scales: the given one, then a Latin hypercube."""
    yield np.array([entry.start / entry.scale for entry in ranges])
    if count == 1:
        return
    low, high = np.array([np.array(entry.spread) / entry.scale for entry in ranges]).T
    shape = len(ranges), count - 1
    for x in unit_samples("latin_hypercube", *shape, seed):
        yield low + x * (high - low)


def _with_own(objective: Objective, start: Array) -> Array:
    """Return a start with the own parameters of the targets."""
    first = objective.results(start)
    if not first:
        message = f"the start cannot be computed: {objective.error}"
        raise type(objective.error or NumericalError())(message)
    own = [
        term.comparison.start(result) / objective.scale[term.own]
        for term, result in zip(objective.terms, first, strict=True)
    ]
    return np.concatenate([start, *own])


def minimize(objective: Objective, start: Array, max_steps: int) -> OptimizeResult:
    """Return the least-squares solution from a start."""
    return least_squares(
        objective.residual,
        start,
        objective.jacobian,
        bounds=(objective.low, objective.high),
        ftol=TOLERANCE,
        xtol=TOLERANCE,
        gtol=np.finfo(float).eps,  # ends a search that starts at a perfect fit
        # LSMR is regularized: parameters without effect do not stop the others. It searches
        # a plane, for which a single parameter is not enough.
        tr_solver="lsmr" if len(start) > 1 else "exact",
        max_nfev=max_steps,
    )
