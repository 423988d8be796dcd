"""Targets of fits as functions: weighted residuals of an impact, and checks of targets."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from thud.base.checks import refuse_value, require_number
from thud.base.immutable import Immutable

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from thud.impact.impact import Impact
    from thud.studies.arrays import Array


# Relative step of the central differences. Forces are smooth to 1e-13, but have kinks where an
# instant enters or leaves the contact: steps of 1e-3 would cross these, steps of 1e-5 rarely do.
# Derivatives are accurate to 1e-7 (3e-3 for intermittent contact with a rising loss factor).
STEP = 2e-5


@dataclass(frozen=True, eq=False, kw_only=True)
class Comparison(Immutable, ABC):
    """How far an impact is from a target, in standard deviations.

    Attributes
    ----------
    unit : str
        Unit of an estimated standard deviation.
    weighted_target : ndarray, shape (size,)
        The target over its standard deviation.
    known_noise : bool
        The standard deviations are known; else their common factor is estimated.
    noise_freedom : int or None
        Degrees of freedom of the data that determine the noise; None: the noise is stated.
    unit_deviation : float
        Unit of the residuals: noise of forces, N; 1 for levels.
    absorbed : int
        Number of nuisance parameters that were projected out of the residuals.
    own : dict of str to tuple
        Unit and scale of each parameter of this target alone, such as the time of first touch.
    step : float
        Relative step of the differences that are the derivatives of the residuals.
    """

    unit: ClassVar[str]
    weighted_target: Array
    known_noise: bool
    noise_freedom: int | None = None
    unit_deviation: float = 1.0
    absorbed: int = 0
    own: dict[str, tuple[str, float]] = field(default_factory=dict)
    step: float = STEP

    @property
    def size(self) -> int:
        """Number of residuals."""
        return len(self.weighted_target)

    @abstractmethod
    def residual(self, impact: Impact, own: Array) -> Array:
        """Return model minus target over standard deviation, shape (size,)."""

    def excess(self, impact: Impact, own: Array, residual: Array) -> float:  # noqa: ARG002
        """Return by how much residuals exceed noise of unit variance; at least 1."""
        return max(1.0, float(np.sqrt(np.mean(residual**2))))

    @abstractmethod
    def columns(self, impact: Impact, own: Array) -> Mapping[str, Sequence[object] | Array]:
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
