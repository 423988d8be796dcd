"""The misfit of an impact to a target, and checks of targets."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from thud.base.checks import refuse_value, require_number
from thud.impact.compute import compute

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from thud.base.note import Note
    from thud.case.case import Case
    from thud.impact.impact import Impact

    Array = NDArray[np.float64]

# Relative step of the central differences. Forces are smooth to 1e-13, but have kinks where an
# instant enters or leaves the contact: steps of 1e-3 would cross these, steps of 1e-5 rarely do.
# Derivatives are accurate to 1e-7 (3e-3 for intermittent contact with a rising loss factor).
STEP = 2e-5
# Names of parameters that records may have of their own.
SHIFT, GAIN = "time_shift", "gain"


class Misfit(ABC):
    """How far an impact is from the target, in standard deviations.

    A target may have parameters of its own, such as the time of first touch in a record.

    Attributes
    ----------
    size : int
        Number of residuals.
    known_noise : bool
        The standard deviations are known; else their common factor is estimated.
    noise_freedom : int or None
        Degrees of freedom of the data that determine the noise; None: the noise is stated.
    deviation_unit : str
        Unit of an estimated standard deviation.
    deviation_source : str
        What states the standard deviations, for messages.
    own : dict of str to tuple
        Unit and scale of each parameter of its own, by name.
    step : float
        Relative step of the differences that are the derivatives of the residuals.
    has_unknowns : bool
        The unknowns of a source count; else the standard deviations include them.
    """

    size: int
    known_noise: bool
    noise_freedom: int | None = None
    deviation_unit: ClassVar[str]
    deviation_source: ClassVar[str]
    own: Mapping[str, tuple[str, float]]
    step: float = STEP
    has_unknowns: ClassVar[bool] = False

    @property
    def unit_deviation(self) -> float:
        """Unit of the residuals: noise of forces, N; 1 for levels."""
        return 1.0

    @property
    def band_fraction(self) -> float:
        """Fraction of the deviation of white noise that lies in the compared band."""
        return 1.0

    @property
    def absorbed(self) -> int:
        """Number of nuisance parameters that were projected out of the residuals."""
        return 0

    @abstractmethod
    def residual(self, impact: Impact, own: Array) -> Array:
        """Return model minus target over standard deviation, shape (size,)."""

    @abstractmethod
    def target_vector(self) -> Array:
        """Return the target over standard deviation, shape (size,)."""

    @abstractmethod
    def data(self) -> Array:
        """Return the numbers of the target."""

    @abstractmethod
    def columns(self, impact: Impact, own: Array) -> Mapping[str, Sequence[object] | Array]:
        """Return target and model side by side, SI units, dB: columns by their names."""

    def own_derivatives(self, impact: Impact, own: Array) -> Array:  # noqa: ARG002
        """Return the derivatives of the residual by its own parameters, shape (size, n_own)."""
        return np.empty((self.size, 0))

    def own_start(self, impact: Impact) -> Array:  # noqa: ARG002
        """Return its own parameters to start from."""
        return np.empty(0)

    def effect(self, impact: Impact, other: Impact, own: Array) -> Array:
        """Return the change of the residual if the impact was another one, shape (size,)."""
        return self.residual(other, own) - self.residual(impact, own)

    def assumed(self, impact: Impact, own: Array) -> dict[str, Array]:  # noqa: ARG002
        """Return the changes of the residual by errors that no data can show, by their names."""
        return {}

    def is_exact(self, impact: Impact, own: Array) -> bool:  # noqa: ARG002
        """Return whether residuals are too small to be tested: numerical errors."""
        return False

    def excess(self, impact: Impact, own: Array, residual: Array) -> float:  # noqa: ARG002
        """Return by how much residuals exceed noise of unit variance; at least 1."""
        return max(1.0, float(np.sqrt(np.mean(residual**2))))

    def nuisances(self, impact: Impact, own: Array) -> dict[str, tuple[float, float]]:  # noqa: ARG002
        """Return nuisance parameters and their standard errors, N, by name."""
        return {}

    def solve(self, case: Case) -> Impact:
        """Return the impact of a case."""
        return compute(case)

    def warnings(
        self,
        impact: Impact,  # noqa: ARG002
        own: Array,  # noqa: ARG002
        deviation: float,  # noqa: ARG002
        count: int,  # noqa: ARG002
    ) -> list[Note]:
        """Return warnings if residuals are not noise of a deviation, after `count` parameters."""
        return []


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
