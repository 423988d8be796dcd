"""Targets of fits as functions: weighted residuals of a computed result, and checks of targets."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Generic, NamedTuple, TypeVar

import numpy as np

from thud.base.checks import refuse_value, require_number
from thud.base.immutable import Immutable
from thud.studies.fitting.residual_tests import size_warning

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from thud.base.note import Note
    from thud.case.case import Case
    from thud.studies.arrays import Array


# What a model computes.
Result = TypeVar("Result")
# Relative step of the central differences. Forces are smooth to 1e-13, but have kinks where an
# instant enters or leaves the contact: steps of 1e-3 would cross these, steps of 1e-5 rarely do.
# Derivatives are accurate to 1e-7 (3e-3 for intermittent contact with a rising loss factor).
STEP = 2e-5


class Own(NamedTuple):
    """A parameter of one target alone, such as the time of first touch; SI units.

    The search begins at `start` and divides it by `scale`. With a finite `deviation` it is known to
    be normal about `start`.
    """

    unit: str
    scale: float
    start: float = 0.0
    deviation: float = np.inf
    low: float = -np.inf
    high: float = np.inf


@dataclass(frozen=True, eq=False, kw_only=True)
class Comparison(Immutable, ABC, Generic[Result]):
    """How far what a model computes is from a target, in standard deviations.

    Attributes
    ----------
    unit : str
        Unit of an estimated standard deviation.
    has_own_noise : bool
        The noise follows from the residuals of a search: see `reweighted`.
    has_alternatives : bool
        The target may show alternatives to the case.
    weighted_target : ndarray, shape (n,)
        The target over its standard deviation.
    known_noise : bool
        The standard deviations are known; else their common factor is estimated.
    noise_freedom : int or None
        Degrees of freedom of the data that determine the noise; None: the noise is stated.
    unit_deviation : float
        Unit of the residuals: noise of forces, N; 1 for levels.
    absorbed : int
        Number of nuisance parameters in the covariance of the noise.
    own : dict of str to Own
        Parameters of this target alone.
    step : float
        Relative step of the differences that are the derivatives of the residuals.
    """

    unit: ClassVar[str]
    has_own_noise: ClassVar[bool] = False
    has_alternatives: ClassVar[bool] = False
    weighted_target: Array
    known_noise: bool
    noise_freedom: int | None = None
    unit_deviation: float = 1.0
    absorbed: int = 0
    own: dict[str, Own] = field(default_factory=dict)
    step: float = STEP

    @property
    def size(self) -> int:
        """Number of residuals: data, and own parameters that are known to an extent."""
        known = sum(np.isfinite(entry.deviation) for entry in self.own.values())
        return len(self.weighted_target) + int(known)

    @abstractmethod
    def solve(self, case: Case) -> Result:
        """Return what the model of a case computes."""

    def start(self, result: Result) -> Array:  # noqa: ARG002
        """Return the values of the own parameters from which the search begins."""
        return np.array([entry.start for entry in self.own.values()])

    @abstractmethod
    def misfit(self, result: Result, own: Array) -> Array:
        """Return model minus target over standard deviation, shape (n,)."""

    def residual(self, result: Result, own: Array) -> Array:
        """Return `misfit`, and own parameters minus what is known of them, shape (size,)."""
        known = [
            (value - entry.start) / entry.deviation
            for value, entry in zip(own, self.own.values(), strict=True)
            if np.isfinite(entry.deviation)
        ]
        return np.concatenate([self.misfit(result, own), known])

    def reweighted(
        self,
        result: Result,  # noqa: ARG002
        own: Array,  # noqa: ARG002
        jacobian: Array,  # noqa: ARG002
    ) -> Comparison[Result]:
        """Return the comparison with the noise that the best residuals show, or itself."""
        return self

    def is_exact(self, result: Result, own: Array) -> bool:  # noqa: ARG002
        """Return whether residuals are too small to be tested: numerical errors."""
        return False

    def warnings(
        self,
        result: Result,  # noqa: ARG002
        own: Array,  # noqa: ARG002
        residual: Array,
        freedom: float,
        unit: float,  # noqa: ARG002
    ) -> list[Note]:
        """Return warnings where residuals of unit variance are not noise.

        `freedom` is the number of residuals less that of parameters, `unit` the standard deviation
        of a residual.
        """
        if not self.known_noise or freedom <= 0:
            return []
        return size_warning(residual, freedom, self.noise_freedom)

    def excess(self, result: Result, own: Array, residual: Array) -> float:  # noqa: ARG002
        """Return by how much residuals exceed noise of unit variance; at least 1."""
        return max(1.0, float(np.sqrt(np.mean(residual**2))))

    @abstractmethod
    def columns(self, result: Result, own: Array) -> Mapping[str, Sequence[object] | Array]:
        """Return target and model side by side, SI units, dB: columns by their names."""


def numbers(name: str, values: object, count: int) -> Array:
    """Return a list of finite numbers of a given length."""
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        array = np.empty(0)
    if array.shape != (count,) or not np.isfinite(array).all():
        refuse_value(f"target: {name}", values, f"{count} real numbers")
    return array


def require_positive(name: str, value: Any, unit: str) -> None:  # noqa: ANN401 - checked here
    """Raise InputError if a value is not a number above 0."""
    require_number(f"target: {name}", value)
    if not value > 0:
        refuse_value(f"target: {name}", value, f"numbers above 0, {unit}")
