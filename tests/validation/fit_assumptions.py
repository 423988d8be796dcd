"""Fits whose case makes a wrong assumption: how many miss the truth, and how many in silence.

    python tests/validation/fit_assumptions.py [FITS]

fits modulus and loss factor of the modal ball, with the fractional damping law of order 0.3, no
friction, no gravity and a rigid floor, to records of which one of these is not true. Noise is
white, log-uniform from 0.5 to 5 % of the peak force. A miss is an estimate that is more than 3
standard errors from the truth; it is silent if the fit does not warn.
"""

from __future__ import annotations

import sys
import warnings
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

import thud
from thud.case.keys import with_values

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

RATE = 44100.0
BACKGROUND = 0.04
ERRORS = 3.0
TRUTH = {"youngs_modulus": 1.8e6, "loss_factor": 0.2}
START = {"youngs_modulus": 1.6e6, "loss_factor": 0.15}
ASSUMED = thud.Case(
    # Few rings, and its own truth.
    model=thud.ModalBall(1400.0, rings=20, damping_law="fractional"),
    sampling=thud.Sampling(duration=0.03),
)


def plate(random: np.random.Generator) -> thud.Case:
    """Return the case on a slab of 75 to 240 mm of concrete."""
    return replace(ASSUMED, floor=thud.InfinitePlate(resistance=10 ** random.uniform(5, 6)))


# The true cases by name; a clock does not change the case.
CASES: dict[str, Callable[[np.random.Generator], thud.Case]] = {
    "as assumed": lambda _: ASSUMED,
    "order 0.7": lambda _: with_values(ASSUMED, {"fractional_order": 0.7}),
    "order 0.2 to 1": lambda r: with_values(ASSUMED, {"fractional_order": r.uniform(0.2, 1)}),
    "stick": lambda _: with_values(ASSUMED, {"floor_friction": "stick"}),
    "gravity": lambda _: with_values(ASSUMED, {"contact_gravity": True}),
    "plate": plate,
    "clock 0.2 %": lambda _: ASSUMED,
}
CLOCK = {"clock 0.2 %": 1.002}


class Tally(NamedTuple):
    """Fits of one assumption: their number, misses, warnings, misses without, relative errors."""

    fits: int
    missed: int
    warned: int
    silent: int
    errors: NDArray[np.float64]
    widths: NDArray[np.float64]


def record(
    name: str, random: np.random.Generator, noise: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return time, s, and force, N, of a true case with noise, relative to the peak."""
    impact = thud.solve(with_values(CASES[name](random), TRUTH))
    impact = impact.on_floor or impact
    force = np.pad(
        impact.floor_force[: int(impact.contact_time * RATE) + 2], int(BACKGROUND * RATE)
    )
    force = force + random.normal(scale=noise * force.max(), size=len(force))
    return np.arange(len(force)) / RATE * CLOCK.get(name, 1.0), force


def tally(
    name: str,
    fits: int,
    noise: tuple[float, float] = (0.005, 0.05),
    unknowns: Sequence[str] | None = None,
) -> Tally:
    """Return what fits to records of a true case give."""
    options = {} if unknowns is None else {"unknowns": unknowns}
    missed = warned = silent = 0
    errors, widths = [], []
    for seed in range(fits):
        random = np.random.default_rng([seed, *name.encode()])
        size = float(np.exp(random.uniform(*np.log(noise))))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            fit = thud.fit(record(name, random, size), START, ASSUMED, **options)
        error = np.array([fit.values[key] - TRUTH[key] for key in TRUTH])
        width = np.array([fit.standard_errors[key] for key in TRUTH])
        miss = bool((np.abs(error) > ERRORS * width).any())
        missed, warned = missed + miss, warned + bool(fit.warnings)
        silent += miss and not fit.warnings
        errors.append(error / list(TRUTH.values()))
        widths.append(width / list(TRUTH.values()))
    return Tally(fits, missed, warned, silent, np.array(errors), np.array(widths))


def main() -> None:
    """Print the table of all assumptions, with and without unknowns."""
    fits = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    sys.stdout.write(
        f"{fits} fits each; errors and standard errors: medians, %\n"
        "| truth | unknowns | missed | warned | silent misses | error of E | standard error | "
        "error of loss factor | standard error |\n|---|---|---|---|---|---|---|---|---|\n"
    )
    for name in CASES:
        for unknowns in (None, ()):
            found = tally(name, fits, unknowns=unknowns)
            medians = 100 * np.median(np.abs([found.errors, found.widths]), axis=1).T.ravel()
            cells = [
                name, "none" if unknowns is not None else "all", *map(str, found[1:4]),
                *(f"{value:.2g}" for value in medians),
            ]  # fmt: skip
            sys.stdout.write(f"| {' | '.join(cells)} |\n")
            sys.stdout.flush()


if __name__ == "__main__":
    main()
