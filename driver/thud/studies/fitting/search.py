"""The search for the parameters of a model that fit all targets best."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from thud.base._schema import FiniteElement, InfinitePlate, ModalBall
from thud.base.checks import MAX_SEED, refuse, require_whole
from thud.base.errors import NumericalError, ThudError
from thud.base.note import Note
from thud.case.keys import with_values
from thud.studies.fitting.comparison import require_confidence, require_unknowns
from thud.studies.sampling import unit_samples
from thud.studies.unknowns import ORDER_RANGE

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator, Sequence

    from tqdm import tqdm

    from thud.case.case import Case
    from thud.studies.arrays import Array
    from thud.studies.fitting.comparison import Comparison, Own
    from thud.studies.parameter import Range


# Orders of the damping laws of rubber, and one between them.
ORDERS = (ORDER_RANGE[0], sum(ORDER_RANGE) / 2, ORDER_RANGE[1])
_FRACTIONAL = [{"fractional_order": order} for order in ORDERS]
# Driving-point resistance of a slab, N s/m: concrete of 75 mm. A force plate stands on more.
RESISTANCE = 1e5


_OTHER_FRICTION = {"none": "stick", "stick": "none"}
# Laws of viscosity that may be another one: prony states its relaxation times.
_LAWS = ("kelvin_voigt", "fractional", "constant_loss")
# Values of keys that a case may have instead of its own, by model and unknown. Shell and lumped
# models have none: they are farther from a force than these alternatives are from each other.
_ALTERNATIVES: dict[type, dict[str, Callable[[Any], list[dict[str, object]]]]] = {
    ModalBall: {
        "damping law": lambda _: [{"damping_law": "fractional", **e} for e in _FRACTIONAL],
        "friction": lambda m: [{"floor_friction": _OTHER_FRICTION[m.floor_friction]}],
        "gravity": lambda m: [{"contact_gravity": not m.contact_gravity}],
        "floor": lambda _: [{"resistance": RESISTANCE}],
    },
    FiniteElement: {
        "damping law": lambda m: [
            {"viscosity": "fractional", **e} for e in _FRACTIONAL if m.viscosity in _LAWS
        ],
        "friction": lambda m: [{"friction": 0.0 if m.friction else 1.0}],
        "floor": lambda _: [{"resistance": RESISTANCE}],
    },
}
UNKNOWNS = tuple(_ALTERNATIVES[ModalBall])
# Keys that, if they are fitted, take the place of an unknown.
_FITTED = {"fractional_order": "damping law", "friction": "friction"}
# Relative steps and gains at which the search ends.
TOLERANCE = 1e-8
# Maximum number of searches with the noise of the residuals of the one before.
MAX_SEARCHES = 8
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


def alternatives(
    case: Case, unknowns: Collection[str], fitted: Collection[str]
) -> list[tuple[str, str, Case]]:
    """Return unknown, label and case of each alternative to a case, if some keys are fitted."""
    known = {_FITTED[name] for name in fitted if name in _FITTED}
    rigid = replace(case, floor=None, room=None)
    on_plate = replace(rigid, floor=InfinitePlate())
    return [
        (
            name,
            " and ".join(f"{key} {value!r}" for key, value in values.items()),
            with_values(on_plate if name == "floor" else rigid, values),
        )
        for name, values_of in _ALTERNATIVES.get(type(case.model), {}).items()
        if name in unknowns and name not in known
        for values in values_of(case.model)
    ]


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
            ends = []
            for position in (min(x[i] + step, self.high[i]), max(x[i] - step, self.low[i])):
                beside = x.copy()
                beside[i] = position
                value = self.residual(beside)
                # The derivative is one-sided if the other side fails.
                possible = np.isfinite(value).all()
                ends.append((position, value) if possible else (x[i], here))
            (above, high), (below, low) = ends
            if above == below:
                message = (
                    f"{self.ranges[i].name}: the model cannot be computed around "
                    f"{x[i] * self.scale[i]:g} ({self.error})"
                )
                raise NumericalError(message)
            jacobian[:, i] = (high - low) / (above - below)
        return jacobian

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

    The targets then have the noise that the residuals show, if it is not known before. Raises the
    error of the first start if there is none.
    """
    best: OptimizeResult | None = None
    failures: list[ThudError] = []
    for start in starts_of(objective.ranges, int(options.starts), int(options.seed)):
        try:
            result = minimize(objective, start, int(options.max_steps))
        except ThudError as error:
            failures.append(error)
            continue
        if best is None or result.cost < best.cost:
            best = result
    if best is None:
        raise failures[0]
    for _ in range(MAX_SEARCHES if any(t.comparison.has_own_noise for t in objective.terms) else 0):
        jacobian, own = objective.jacobian(best.x), best.x * objective.scale
        pairs = zip(objective.terms, objective.results(best.x), strict=True)
        reweighted = [
            term.comparison.reweighted(result, own[term.own], jacobian[term.rows])
            for term, result in pairs
        ]
        if all(n is t.comparison for n, t in zip(reweighted, objective.terms, strict=True)):
            break
        objective.terms = [
            term._replace(comparison=comparison)
            for term, comparison in zip(objective.terms, reweighted, strict=True)
        ]
        best = minimize(objective, best.x, int(options.max_steps))
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


def minimize(objective: Objective, start: Array, max_steps: int) -> OptimizeResult:
    """Return the least-squares solution from a start; the targets find missing own parameters."""
    if len(start) == objective.count:
        first = objective.results(start)
        if not first:
            message = f"the start cannot be computed: {objective.error}"
            raise type(objective.error or NumericalError())(message)
        own = [
            term.comparison.start(result) / objective.scale[term.own]
            for term, result in zip(objective.terms, first, strict=True)
        ]
        start = np.concatenate([start, *own])
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
