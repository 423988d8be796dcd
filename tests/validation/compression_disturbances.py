"""Fits to curves of a press with disturbances: the modulus of the modal ball.

    python tests/validation/compression_disturbances.py [CURVES]

Curves have 41 points from first touch to 30 mm, to which noise and one disturbance are added.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from fit_tally import print_tallies, quiet_fit, random_of

import thud

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    # What is added to the force, N, at relative positions.
    Disturbance = Callable[[Array, Array, np.random.Generator], Array]

TRUE = thud.Ball(youngs_modulus=1.83e6)
# Coarse, and its own truth.
MODEL = thud.ModalBall(rings=20)
CASE = thud.Case(ball=thud.Ball(youngs_modulus=3e6), model=MODEL)
TOUCH = 1.2e-3
TRUTH = {"youngs_modulus": TRUE.youngs_modulus}


def coloured(position: Array, _: Array, random: np.random.Generator) -> Array:
    """Return noise of a standard deviation of 3 N, with a correlation of neighbors of 0.9."""
    result = random.normal(size=len(position))
    for i in range(1, len(result)):
        innovation = np.sqrt(1 - 0.9**2) * result[i]
        result[i] = 0.9 * result[i - 1] + innovation
    return np.asarray(3 * result)


def expected(position: Array, force: Array, random: np.random.Generator) -> Array:
    """Return all unknowns, of normal sizes with their expected standard deviations."""
    offset, drift, friction, softening = random.normal(size=4)
    top = force.max()
    added = top * (0.01 * offset + 0.01 * drift * position + 0.005 * friction)
    return np.asarray(added - 0.05 * softening * position * force)


# Disturbances by name, with the standard deviation of their white noise, N.
DISTURBANCES: dict[str, tuple[float, Disturbance]] = {
    "noise of 1 N": (1.0, lambda p, *_: 0 * p),
    "colored noise of 3 N, correlation 0.9": (0.0, coloured),
    "softening of 5 %": (1.0, lambda p, force, _: -0.05 * force * p),
    "offset of 3 N": (1.0, lambda p, *_: 3 + 0 * p),
    "drift of 5 N": (1.0, lambda p, *_: 5 * p),
    "friction of 2 N": (1.0, lambda _, force, __: 2.0 * (force > 0)),
    "all, as large as expected": (3.0, expected),
}


@lru_cache
def clean() -> tuple[Array, Array]:
    """Return deflection, m, and force, N, of the truth."""
    curve = thud.compress(TRUE, MODEL, max_deflection=0.03, points=41)
    return curve.deflection + TOUCH, curve.force


def curve_of(name: str, seed: int, white: float | None = None) -> tuple[Array, Array]:
    """Return a curve with a disturbance and white noise of a size, N."""
    deflection, force = clean()
    random = random_of(name, seed)
    size, disturbance = DISTURBANCES[name]
    added = disturbance((deflection - TOUCH) / np.ptp(deflection), force, random)
    size = size if white is None else white
    return deflection, force + added + random.normal(size=len(force)) * size


def quiet(curve: tuple[Array, Array], unknowns: Sequence[str] | None = None) -> thud.Fit:
    """Return a fit whose warnings do not matter."""
    options = {} if unknowns is None else {"unknowns": unknowns}
    return quiet_fit(thud.CompressionTarget(*curve, **options), ["youngs_modulus"], CASE)


def miss(fit: thud.Fit) -> float:
    """Return the error of the modulus over its standard error."""
    error = fit.values["youngs_modulus"] - TRUE.youngs_modulus
    return abs(error) / fit.standard_errors["youngs_modulus"]


def fits(name: str, count: int, unknowns: Sequence[str] | None = None) -> Iterator[thud.Fit]:
    """Yield fits to curves with a disturbance."""
    return (quiet(curve_of(name, seed), unknowns) for seed in range(count))


if __name__ == "__main__":
    print_tallies(DISTURBANCES, fits, TRUTH, 40)
