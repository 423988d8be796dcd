"""How often the stated numerical error covers the true one, over random sources.

    python tests/bench/numerical_error.py MODEL [COUNT [SEED]]

Each source is computed at the default resolution, at a fine one, and at one between, which shows
how far the fine one is from convergence. Prints each source whose error is not covered, has no
result, or exceeds 0.5 dB without a warning; then the coverage of the levels of all octaves, and of
contact time, restitution and peak force.
"""

from __future__ import annotations

import math
import random
import sys
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from tqdm import tqdm

import thud

sys.path.insert(0, str(Path(__file__).parents[1] / "faults"))
from cases import log_uniform

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    # Keys of a resolution, or those that a case needs.
    Keys = dict[str, Any] | Callable[[dict[str, Any]], dict[str, Any]]

# Errors below this are not distinguished from zero, dB.
FLOOR = 0.02
# The same of contact time and peak force, relative, and of the restitution.
FLOORS = 0.001
# Quantities that have a stated error, besides the levels.
SCALARS = ("contact_time", "restitution", "peak_force")
# Numerical error above which an impact carries a warning, and error that must not be without, dB.
WARNED, MAXIMUM = 0.2, 0.5
DENSITY = 900.0, 1300.0


def ball(
    chance: random.Random, *, wall: tuple[float, float], modulus: tuple[float, float]
) -> thud.Ball:
    """Return a ball of rubber, with a wall from a range of fractions of its radius."""
    radius, ratio = chance.uniform(0.05, 0.15), chance.uniform(*wall)
    volume = 4 / 3 * math.pi * radius**3 * (1 - (1 - ratio) ** 3)
    return thud.Ball(
        outer_radius=radius,
        wall_thickness=ratio * radius,
        mass=volume * chance.uniform(*DENSITY),
        youngs_modulus=log_uniform(chance, *modulus),
        poisson_ratio=chance.choice([0.5, chance.uniform(0.45, 0.499)]),
    )


def drop(chance: random.Random) -> thud.Drop:
    return thud.Drop(height=log_uniform(chance, 0.1, 1.6))


def duration(source: thud.Ball) -> float:
    """Return a duration, s, several times the contact of a ball."""
    volume = source.mass / (source.outer_radius**2 * source.wall_thickness)
    return min(1.0, 0.06 + 40 * source.outer_radius * math.sqrt(volume / source.youngs_modulus))


@dataclass(frozen=True)
class Study:
    """Random cases of a model, and keys of a fine resolution and of one between."""

    draw: Callable[[random.Random], dict[str, Any]]
    between: Keys
    fine: Keys


def shell(chance: random.Random) -> dict[str, Any]:
    source = ball(chance, wall=(0.1, 0.5), modulus=(3e5, 3e7))
    flux = chance.choice(["momentum_balance", "none", "retarding", "conservative"])
    return {
        "ball": source, "drop": drop(chance), "model": thud.HollowSphere(momentum_flux=flux),
        "duration": duration(source), "sample_rate": log_uniform(chance, 8e3, 96e3),
    }  # fmt: skip


def modal_ball(chance: random.Random) -> dict[str, Any]:
    source = ball(chance, wall=(0.1, 0.9), modulus=(4e5, 3e7))
    model = thud.ModalBall(
        damping_law=chance.choice(["constant", "rising", "fractional"]),
        loss_factor=chance.uniform(0.02, 0.4),
    )
    return {
        "ball": source, "drop": drop(chance), "model": model, "duration": duration(source),
        "sample_rate": log_uniform(chance, 16e3, 96e3),
    }  # fmt: skip


def modes(factor: float, rings: int, substeps: int) -> Keys:
    """Return a resolution with modes up to a multiple of the frequency of the coarsest one."""

    def keys(case: dict[str, Any]) -> dict[str, Any]:
        source = case["ball"]
        inner = source.outer_radius - source.wall_thickness
        density = source.mass / (4 / 3 * math.pi * (source.outer_radius**3 - inner**3))
        shear = math.sqrt(source.youngs_modulus / (2 * (1 + source.poisson_ratio) * density))
        return {
            "sample_rate": 96e3, "rings": rings, "substeps": substeps,
            "highest_frequency": factor * max(1000.0, 2.1 * shear / source.outer_radius),
        }  # fmt: skip

    return keys


def finite_element(chance: random.Random) -> dict[str, Any]:
    source = ball(chance, wall=(0.1, 0.95), modulus=(6e5, 1e7))
    loss = chance.choice([0.0, 0.05, 0.1, 0.2, 0.3])
    model = thud.FiniteElement(
        viscosity="fractional" if loss else "none",
        loss_factor=loss or 0.1,
        fractional_order=chance.choice([0.2, 0.3, 0.5, 0.7, 1.0]),
        friction=chance.choice([0.0, 0.0, 0.3, 0.8]),
    )
    return {"ball": source, "drop": drop(chance), "model": model, "duration": duration(source)}


def hunt_crossley(chance: random.Random) -> dict[str, Any]:
    model = thud.HuntCrossley(
        contact_time=chance.uniform(0.004, 0.04), exponent=chance.uniform(1.0, 3.0),
        restitution=chance.uniform(0.2, 1.0),
    )  # fmt: skip
    return {
        "ball": thud.Ball(mass=log_uniform(chance, 0.5, 50)), "drop": drop(chance), "model": model,
        "duration": 0.2, "sample_rate": log_uniform(chance, 8e3, 96e3),
    }  # fmt: skip


def two_mass(chance: random.Random) -> dict[str, Any]:
    model = thud.TwoMass(
        belt_mass=chance.uniform(1, 4), inflation_pressure=chance.uniform(1e5, 3e5),
        contact_width=chance.uniform(0.2, 0.6), carcass_stiffness=log_uniform(chance, 3e4, 3e5),
        carcass_exponent=chance.uniform(1.5, 4), contact_damping=chance.uniform(0, 0.3),
        belt_frequency=log_uniform(chance, 40, 200), belt_damping=chance.uniform(0.02, 0.6),
    )  # fmt: skip
    return {
        "ball": thud.Ball(mass=chance.uniform(5, 10)), "drop": drop(chance), "model": model,
        "duration": 0.3, "sample_rate": log_uniform(chance, 8e3, 96e3),
    }  # fmt: skip


def measured_modes(chance: random.Random) -> dict[str, Any]:
    count = chance.randint(1, 6)
    first = chance.uniform(15, 40)
    shares = [chance.uniform(0.1, 1) ** 2 for _ in range(count)]
    mass = chance.uniform(1, 8)
    model = thud.MeasuredModes(
        frequency=[first * chance.uniform(1, 1.2) * (1 + 2 * i) for i in range(count)],
        damping_ratio=[chance.uniform(0.01, 0.2) for _ in range(count)],
        effective_mass=[mass * share / sum(shares) for share in shares],
    )
    return {
        "ball": thud.Ball(mass=mass), "drop": drop(chance), "model": model,
        "duration": 0.3, "sample_rate": log_uniform(chance, 8e3, 96e3),
    }  # fmt: skip


SAMPLES = {"sample_rate": 4e5}, {"sample_rate": 1e6}
STUDIES = {
    "hollow_sphere": Study(shell, *SAMPLES),
    "hunt_crossley": Study(hunt_crossley, *SAMPLES),
    "two_mass": Study(two_mass, *SAMPLES),
    "measured_modes": Study(measured_modes, *SAMPLES),
    "modal_ball": Study(modal_ball, modes(2.8, 160, 2), modes(4, 240, 4)),
    "finite_element": Study(
        finite_element,
        {"radial_elements": 12, "polar_elements": 128},
        {"radial_elements": 18, "polar_elements": 192},
    ),
}


def levels(case: dict[str, Any], keys: Keys) -> tuple[Any, Array, Array]:
    """Return the impact of a case, its levels, dB, and contact time, restitution and peak force."""
    keys = keys(case) if callable(keys) else keys
    model = case["model"]
    options = {name: value for name, value in keys.items() if hasattr(model, name)}
    sampling = {name: value for name, value in keys.items() if name not in options}
    if options:
        fields = {name: getattr(model, name) for name in vars(model)}
        model = type(model)(**{**fields, **options})
    impact = thud.solve(**{**case, "model": model, **sampling})
    scalars = np.array([impact.exact_contact_time, impact.restitution, impact.peak_force])
    return impact, np.asarray(impact.levels(force="floor")), scalars


def main() -> None:
    """Compare all cases of a model."""
    name, *numbers = sys.argv[1:]
    count, seed = (int(one) for one in (*numbers, *(500, 1)[len(numbers) :]))
    chance, study = random.Random(seed), STUDIES[name]  # noqa: S311
    rows, refused = [], 0
    for i in tqdm(range(count), disable=None):
        case = study.draw(chance)
        try:
            impact, here, scalars = levels(case, {})
            _, fine, fine_scalars = levels(case, study.fine)
            rest = np.abs(fine - levels(case, study.between)[1])
        except thud.ThudError as problem:
            refused += 1
            print(i, problem, case, flush=True)
            continue
        limit = np.array([impact.quantity(f"{one}_error") for one in SCALARS])
        limit = np.maximum(limit, FLOORS * np.array([scalars[0], 1.0, scalars[2]]))
        difference = np.abs(scalars - fine_scalars)
        one = np.abs(here - fine), impact.level_error, rest, difference <= limit
        rows.append(one)
        silent = (one[0] > MAXIMUM) & (one[1].max() < WARNED)
        if silent.any() or (one[0] > np.maximum(one[1], FLOOR) + rest).any() or not one[3].all():
            print(i, "error {} stated {} reference {}; scalars {}".format(*one), case, flush=True)
    error, said, rest, scalars_covered = map(np.array, zip(*rows, strict=True))
    covered = error <= np.maximum(said, FLOOR)
    quiet = said.max(axis=1, keepdims=True) < WARNED
    print(
        f"{name}: {len(error)} sources, {refused} without a result or a reference; stated error "
        f"covers {100 * covered.mean():.1f} % of the levels, {100 * covered[:, 4].mean():.1f} % at "
        f"500 Hz; largest error {error.max():.2f} dB, without a warning "
        f"{(error * quiet).max():.2f} dB; {(quiet & (error > MAXIMUM)).sum()} above {MAXIMUM} dB "
        f"without; change between the references up to {rest.max():.2f} dB, median "
        f"{np.median(rest):.4f} dB"
    )
    shares = 100 * np.mean(scalars_covered, axis=0)
    print("contact times {:.0f} %, restitutions {:.0f} %, peak forces {:.0f} %".format(*shares))


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    main()
