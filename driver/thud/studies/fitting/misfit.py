"""What the fit needs of a target, and checks of what targets are given."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from thud.checks import require_number, shown
from thud.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.impact import Impact


class Misfit(Protocol):
    """How far an impact is from the target, in standard deviations."""

    @property
    def size(self) -> int:
        """Number of residuals."""

    @property
    def known_noise(self) -> bool:
        """The standard deviations were given; else their common factor is estimated."""

    @property
    def free_shift(self) -> bool:
        """The time of first touch is not known."""

    @property
    def unit_deviation(self) -> float:
        """What residuals are measured in: the noise of forces, N; 1 for levels."""

    @property
    def deviation_unit(self) -> str:
        """Unit of a standard deviation that is estimated."""

    def residual(self, impact: Impact, shift: float) -> NDArray[np.float64]:
        """Return model minus target over standard deviation, shape (size,)."""

    def shift_derivative(self, impact: Impact, shift: float) -> NDArray[np.float64]:
        """Return the derivative of the residual with the time of first touch, 1/s."""

    def first_shift(self, impact: Impact) -> float:
        """Return a time of first touch to start from, s."""

    def target_vector(self) -> NDArray[np.float64]:
        """Return the target over standard deviation, shape (size,)."""

    def columns(self, impact: Impact, shift: float) -> dict[str, list[object]]:
        """Return target and model side by side, SI units, dB: columns by their names."""

    def doubt(self, impact: Impact, shift: float, count: int) -> str:
        """Return what speaks against the model with so many parameters, or nothing."""


def numbers(name: str, values: object, count: int) -> NDArray[np.float64]:
    """Return a list of finite numbers of a given length."""
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        array = np.empty(0)
    if array.shape != (count,) or not np.isfinite(array).all():
        message = f"target: {name} = {shown(values)} is not allowed; allowed: {count} real numbers"
        raise InputError(message)
    return array


def require_choice(name: str, value: object, allowed: tuple[str, ...]) -> None:
    """Raise InputError where a word is not one of those that are allowed."""
    if value not in allowed:
        listed = ", ".join(map(repr, allowed))
        message = f"target: {name} = {value!r} is not known; allowed: {listed}"
        raise InputError(message)


def require_positive(name: str, value: Any, unit: str) -> None:  # noqa: ANN401 - that is the question
    """Raise InputError where a value is no number above 0."""
    require_number(f"target: {name}", value)
    if not value > 0:
        message = f"target: {name} = {value!r} is not allowed; allowed: numbers above 0, {unit}"
        raise InputError(message)
