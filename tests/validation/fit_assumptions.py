"""Fits whose case makes a wrong assumption: modulus and loss factor of the modal ball.

    python tests/validation/fit_assumptions.py [FITS]

The case has the fractional damping law of order 0.3, no friction, no gravity and a rigid floor; in
each record one of these is not true. Noise is white, log-uniform from 0.5 to 5 % of the peak force.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from fit_tally import print_tallies, quiet_fit, random_of

import thud
from thud.case.keys import with_values

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

RATE = 44100.0
BACKGROUND = 0.04
TRUTH = {"youngs_modulus": 1.8e6, "loss_factor": 0.2}
START = {"youngs_modulus": 1.6e6, "loss_factor": 0.15}
ASSUMED = thud.Case(
    # Few rings, and its own truth.
    model=thud.ModalBall(1400.0, rings=20, damping_law="fractional"),
    sampling=thud.Sampling(duration=0.03),
)


# The true cases by name; a clock does not change the case.
CASES: dict[str, Callable[[np.random.Generator], thud.Case]] = {
    "as assumed": lambda _: ASSUMED,
    "order 0.7": lambda _: with_values(ASSUMED, {"fractional_order": 0.7}),
    "stick": lambda _: with_values(ASSUMED, {"floor_friction": "stick"}),
    "gravity": lambda _: with_values(ASSUMED, {"contact_gravity": True}),
    # A slab of 75 to 240 mm of concrete.
    "plate": lambda r: replace(ASSUMED, floor=thud.InfinitePlate(resistance=10 ** r.uniform(5, 6))),
    "clock 0.2 %": lambda _: ASSUMED,
}
CLOCK = {"clock 0.2 %": 1.002}


def record(name: str, random: np.random.Generator, noise: float) -> tuple[Array, Array]:
    """Return time, s, and force, N, of a true case with noise, relative to the peak."""
    impact = thud.solve(with_values(CASES[name](random), TRUTH))
    impact = impact.on_floor or impact
    contact = impact.floor_force[: int(impact.contact_time * RATE) + 2]
    force = np.pad(contact, int(BACKGROUND * RATE))
    force = force + random.normal(scale=noise * force.max(), size=len(force))
    return np.arange(len(force)) / RATE * CLOCK.get(name, 1.0), force


def fits(
    name: str,
    count: int,
    noise: tuple[float, float] = (0.005, 0.05),
    **options: Any,  # noqa: ANN401 - of `fit`
) -> Iterator[thud.Fit]:
    """Yield fits to records of a true case, with noise log-uniform between two sizes."""
    for seed in range(count):
        random = random_of(name, seed)
        size = float(np.exp(random.uniform(*np.log(noise))))
        yield quiet_fit(record(name, random, size), START, ASSUMED, **options)


if __name__ == "__main__":
    print_tallies(CASES, fits, TRUTH, 200)
