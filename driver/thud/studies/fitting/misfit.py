"""What the fit needs of a target, and checks of what targets are given."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from thud.checks import refuse_value, require_number
from thud.impact import compute

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from thud.case import Case
    from thud.impact import Impact


class Misfit(ABC):
    """How far an impact is from the target, in standard deviations.

    Attributes
    ----------
    size : int
        Number of residuals.
    known_noise : bool
        The standard deviations were given; else their common factor is estimated.
    free_shift : bool
        The time of first touch is not known.
    unit_deviation : float
        Unit of the residuals: the noise of forces, N; 1 for levels.
    deviation_unit : str
        Unit of an estimated standard deviation.
    """

    size: int
    known_noise: bool
    free_shift: bool = False
    unit_deviation: float = 1.0
    deviation_unit: ClassVar[str]

    @abstractmethod
    def residual(self, impact: Impact, shift: float) -> NDArray[np.float64]:
        """Return model minus target over standard deviation, shape (size,)."""

    @abstractmethod
    def target_vector(self) -> NDArray[np.float64]:
        """Return the target over standard deviation, shape (size,)."""

    @abstractmethod
    def columns(self, impact: Impact, shift: float) -> Mapping[str, Sequence[object]]:
        """Return target and model side by side, SI units, dB: columns by their names."""

    def shift_derivative(self, impact: Impact, shift: float) -> NDArray[np.float64]:
        """Return the derivative of the residual by the time of first touch, 1/s."""
        raise NotImplementedError

    def first_shift(self, impact: Impact) -> float:
        """Return a time of first touch to start from, s."""
        raise NotImplementedError

    def solve(self, case: Case) -> Impact:
        """Return the impact of a case."""
        return compute(case)

    def doubt(self, impact: Impact, shift: float, count: int) -> str:  # noqa: ARG002
        """Return what `count` parameters cannot explain, or nothing."""
        return ""


def numbers(name: str, values: object, count: int) -> NDArray[np.float64]:
    """Return a list of finite numbers of a given length."""
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        array = np.empty(0)
    if array.shape != (count,) or not np.isfinite(array).all():
        refuse_value(f"target: {name}", values, f"{count} real numbers")
    return array


def require_positive(name: str, value: Any, unit: str) -> None:  # noqa: ANN401 - that is the question
    """Raise InputError where a value is not a number above 0."""
    require_number(f"target: {name}", value)
    if not value > 0:
        refuse_value(f"target: {name}", value, f"numbers above 0, {unit}")
