"""Calibrate the standard rubber ball on what the standards and the paper say of it.

Run by ``./bootstrap calibrate``: python driver/calibrate_standard_ball.py [FILE]

Prints the least-squares fits of elements and modal ball, how well the data determine them, and the
table of misfits; writes sets of parameters that are equally likely (docs/standard_ball.md).
"""

from __future__ import annotations

import sys
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import least_squares
from tqdm import tqdm

import thud
from thud.level.assessment import octave_limits
from thud.studies import calibrated_set

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

    Sets = dict[str, NDArray[np.float64]]

FILE = Path(__file__).parent / "thud/studies" / calibrated_set.FILE
COLUMNS = ("youngs_modulus", "poisson_ratio", "loss_factor", "fractional_order", "friction")
MODELS: dict[str, Any] = {
    "finite_element": thud.FiniteElement(viscosity="fractional", loss_frequency=74.0),
    "modal_ball": thud.ModalBall(damping_law="rising", loss_frequency=74.0),
}
# Resolution of fits and sets; a single drop refines its mesh by its numerical error.
MESH = {"finite_element": calibrated_set.MESH, "modal_ball": {}}
LOWER, UPPER = octave_limits("rubber_ball")
NOMINAL, TOLERANCE = (UPPER + LOWER) / 2, (UPPER - LOWER) / 2
# Value and tolerance: the paper's measured contact time, s; restitution of the standards; modulus
# by which the free modes are those that the paper computed, Pa.
CONTACT_TIME, RESTITUTION, MODULUS = (19.6e-3, 0.3e-3), (0.8, 0.1), (2.08e6, 0.10e6)
# What is free in a fit: start, minimum, maximum.
FREE = {
    "finite_element": {
        "youngs_modulus": (2.08e6, 1e6, 4e6),
        "loss_factor": (0.2, 0.02, 0.6),
        "fractional_order": (0.7, 0.3, 1.0),
        "friction": (0.1, 0.0, 0.5),
    },
    "modal_ball": {"youngs_modulus": (1.6e6, 1e6, 3e6), "loss_factor": (0.2, 0.02, 1.0)},
}
# What stands for each key that is not free.
FIXED = {"finite_element": {"poisson_ratio": 0.5, "friction": 0.0}, "modal_ball": {}}
# Rounding of what is fitted.
DIGIT = {"youngs_modulus": 0.01e6, "loss_factor": 0.01, "fractional_order": 0.05}
# Priors of the sets: distributions of numpy.
PRIORS: dict[str, dict[str, tuple[str, float, float]]] = {
    "finite_element": {
        "youngs_modulus": ("normal", *MODULUS),
        "poisson_ratio": ("uniform", 0.485, 0.5),
        "loss_factor": ("uniform", 0.05, 0.45),
        "fractional_order": ("uniform", 0.2, 1.0),
        "friction": ("uniform", 0.0, 0.5),
    },
    "modal_ball": {
        "youngs_modulus": ("uniform", 1.3e6, 1.9e6),
        "loss_factor": ("uniform", 0.05, 0.6),
    },
}
# Sets of each model.
COUNT = 32
COMMENT = (
    "# Equally likely parameters of the standard ball (Pa; loss factor at 74 Hz), "
    "made by ./bootstrap calibrate"
)
# Other balls in the table of misfits.
OTHERS: tuple[dict[str, float], ...] = (
    {"youngs_modulus": 2.00e6, "loss_factor": 0.20, "fractional_order": 1.0},
    {"youngs_modulus": 2.08e6, "loss_factor": 0.20, "fractional_order": 1.0},
    {"youngs_modulus": 2.00e6, "loss_factor": 0.20, "fractional_order": 0.85},
    {"youngs_modulus": 2.08e6, "loss_factor": 0.20, "fractional_order": 0.5},
    {"youngs_modulus": 2.08e6, "loss_factor": 0.143, "fractional_order": 0.3},
)
# Drops that are drawn at once; the sets depend on it.
BLOCK = 64
# Parameters change by this fraction of their size for derivatives, above the steps of the contact
# time by rings and samples.
STEP = 0.03


def solve(model: str, sets: Mapping[str, ArrayLike]) -> thud.Ensemble:
    """Return the drops of sets of parameters from 1 m."""
    case = thud.Case(model=replace(MODELS[model], **MESH[model]))
    return thud.solve_many({**FIXED[model], **sets}, case)


def residuals(model: str, sets: Mapping[str, ArrayLike]) -> NDArray[np.float64]:
    """Return (value - target) / tolerance, shape (n_sample, 7): octaves, contact time, restitution.

    Elements have an eighth, the modulus; that of the modal ball is an effective modulus.
    """
    drops = solve(model, sets)
    columns = [
        *((drops.floor_octave - NOMINAL) / TOLERANCE).T,
        (drops.contact_time - CONTACT_TIME[0]) / CONTACT_TIME[1],
        (drops.restitution - RESTITUTION[0]) / RESTITUTION[1],
    ]
    if model == "finite_element":
        modulus = np.asarray(sets["youngs_modulus"], dtype=float)
        columns.append(np.broadcast_to((modulus - MODULUS[0]) / MODULUS[1], len(drops)))
    return np.stack(columns, axis=1)


def jacobian(model: str, point: Mapping[str, float]) -> NDArray[np.float64]:
    """Return the derivatives of the residuals by each parameter over its size in `FREE`."""
    start = {key: FREE[model][key][0] for key in point}
    sides = []
    for sign in (-1, 1):
        for key in point:
            _, low, high = FREE[model][key]
            moved = np.clip(point[key] + sign * STEP * start[key], low, high)
            sides.append({**point, key: float(moved)})
    below, above = np.split(residuals(model, _columns(sides)), 2)
    spans = [
        (sides[len(point) + i][key] - sides[i][key]) / start[key] for i, key in enumerate(point)
    ]
    return np.transpose((above - below) / np.array(spans)[:, None])


def fit(model: str, keys: Sequence[str]) -> tuple[dict[str, float], float]:
    """Return the least-squares values of keys, and the sum of squares of the residuals there."""
    start, low, high = np.array([FREE[model][key] for key in keys]).T

    def point(x: NDArray[np.float64]) -> dict[str, float]:
        return dict(zip(keys, (x * start).tolist(), strict=True))

    found = least_squares(
        lambda x: residuals(model, point(x))[0],
        np.ones(len(keys)),
        lambda x: jacobian(model, point(x)),
        bounds=(low / start, high / start),
        xtol=1e-4,
    )
    return point(found.x), 2 * float(found.cost)


def round_point(model: str, point: Mapping[str, float]) -> tuple[dict[str, float], float]:
    """Return the rounded neighbor of a point with the least sum of squares, and this sum."""
    ends = [
        [float(f"{digit * side(point[key] / digit):.6g}") for side in (np.floor, np.ceil)]
        for key, digit in DIGIT.items()
        if key in point
    ]
    points = [dict(zip(point, values, strict=True)) for values in product(*ends)]
    cost = (residuals(model, _columns(points)) ** 2).sum(axis=1)
    return points[int(cost.argmin())], float(cost.min())


def accept(drops: thud.Ensemble) -> NDArray[np.bool_]:
    """Return whether each drop is one of a standard ball; False for drops that failed."""
    levels = drops.floor_octave
    return (
        ((levels >= LOWER) & (levels <= UPPER)).all(axis=1)
        & (np.abs(drops.contact_time - CONTACT_TIME[0]) <= CONTACT_TIME[1])
        & (np.abs(drops.restitution - RESTITUTION[0]) <= RESTITUTION[1])
    )


def draw_prior(model: str, count: int, random: np.random.Generator) -> Sets:
    """Return sets of the prior, rounded to four digits as the file states them."""
    prior = PRIORS[model]
    values = {key: getattr(random, kind)(*ends, count) for key, (kind, *ends) in prior.items()}
    return {key: np.array([float(f"{x:.4g}") for x in drawn]) for key, drawn in values.items()}


def draw_sets(model: str, count: int, seed: int = 0, *, progress: bool = True) -> tuple[Sets, int]:
    """Return accepted sets of the prior, and the number of sets that were drawn for them."""
    random = np.random.default_rng(seed)
    blocks: list[Sets] = []
    drawn = accepted = 0
    with tqdm(total=count, unit="set", desc=model, disable=not progress, leave=False) as bar:
        while accepted < count:
            block = draw_prior(model, BLOCK, random)
            (chosen,) = np.nonzero(accept(solve(model, block)))
            chosen = chosen[: count - accepted]
            accepted += len(chosen)
            drawn += int(chosen[-1]) + 1 if accepted == count else BLOCK
            blocks.append({key: values[chosen] for key, values in block.items()})
            bar.update(len(chosen))
    return {key: np.concatenate([block[key] for block in blocks]) for key in blocks[0]}, drawn


def report_fit(model: str) -> dict[str, float]:
    """Print the fits of a model and what the data determine; return the rounded standard ball."""
    keys = [key for key in FREE[model] if key != "friction"]
    point, cost = fit(model, keys)
    rounded, rounded_cost = round_point(model, point)
    print(f"\n{model}: {_shown(point)}: sum of squares {cost:.3f}")
    if "friction" in FREE[model]:
        point_with, cost_with = fit(model, list(FREE[model]))
        print(f"  with friction: {_shown(point_with)}: {cost_with:.3f}")
    print(f"  rounded: {_shown(rounded)}: {rounded_cost:.3f}")
    sizes = np.array([FREE[model][key][0] for key in keys])
    _, strength, directions = np.linalg.svd(jacobian(model, point), full_matrices=False)
    deviation = sizes * np.sqrt(((directions / strength[:, None]) ** 2).sum(axis=0))
    print(f"  standard deviation: {_shown(dict(zip(keys, deviation.tolist(), strict=True)))}")
    for value, direction in zip(strength, directions, strict=True):
        step = dict(zip(keys, (sizes * direction / value).tolist(), strict=True))
        print(f"  one tolerance: {_shown(step)}")
    return rounded


def report_misfit(rounded: Mapping[str, Mapping[str, float]]) -> None:
    """Print the table of misfits of both standard balls and others, with their numerical errors."""
    print("\n| E, MPa | model | 31.5 | 63 | 125 | 250 | 500 Hz | contact, ms | e |")
    print("|---|---|---|---|---|---|---|---|---|")
    for model, values in [*rounded.items(), *(("finite_element", other) for other in OTHERS)]:
        ball = thud.Ball(youngs_modulus=values["youngs_modulus"])
        options = {key: value for key, value in values.items() if key != "youngs_modulus"}
        impact = thud.solve(ball, model=replace(MODELS[model], **options))
        errors = [criterion.estimate.expanded for criterion in impact.assess().criteria[:5]]
        cells = [
            f"{1e-6 * ball.youngs_modulus:.2f}",
            f"{model}, {_shown(options)}",
            *(
                f"{level:+.2f} ± {error:.2f}"
                for level, error in zip(impact.levels() - NOMINAL, errors, strict=True)
            ),
            f"{1e3 * impact.contact_time:.2f}",
            f"{impact.restitution:.3f}",
        ]
        print(f"| {' | '.join(cells)} |")


def write_sets(path: Path, sets: Mapping[str, Sets]) -> None:
    """Write the sets of all models; a key that a model does not have is empty."""
    lines = [COMMENT, ",".join(("model", *COLUMNS))]
    for model, columns in sets.items():
        for i in range(len(columns["loss_factor"])):
            values = [f"{columns[key][i]:.4g}" if key in columns else "" for key in COLUMNS]
            lines.append(",".join((model, *values)))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _shown(values: Mapping[str, float]) -> str:
    return ", ".join(f"{key} {value:.4g}" for key, value in values.items())


def _columns(points: list[dict[str, float]]) -> Sets:
    return {key: np.array([point[key] for point in points]) for key in points[0]}


def main() -> None:
    """Calibrate both models."""
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else FILE
    report_misfit({model: report_fit(model) for model in MODELS})
    sets = {}
    for model in MODELS:
        sets[model], drawn = draw_sets(model, COUNT)
        print(f"{model}: {COUNT} of {drawn} sets of the prior accepted")
        for key, values in sets[model].items():
            print(f"  {key} {values.mean():.4g}, {values.min():.4g} to {values.max():.4g}")
    write_sets(path, sets)


if __name__ == "__main__":
    main()
