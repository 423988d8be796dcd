"""A result depends on its own case only, never on cases that were computed before it."""

from __future__ import annotations

from multiprocessing import get_context
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import thud

if TYPE_CHECKING:
    from pathlib import Path

# Name and keys of a floor, name and keys of a model.
Chosen = tuple[str, dict[str, Any], str, dict[str, Any]]

PAIRS = 12
FREQUENCIES = [30.0, 80.0, 200.0]
SOURCE = {"source_x": 0.31, "source_y": 0.22}
# Near-equal floors and models: round positions and counts, digits, lengths, keys without effect.
# Small and thick ones have few functions.
FLOORS: dict[str, tuple[Any, dict[str, list[Any]]]] = {
    "plate": (thud.Plate, {
        "line_x": [(), (1.0,), (2.0,), (1.0, 2.0)],
        "line_y": [(), (1.0,), (2.0,), (1.0, 2.0)],
        "length": [3.0, 3.000001, 2.5],
        "width": [2.5, 3.0],
        "thickness": [0.5],
        "support": ["simple", "clamped"],
        "screed_thickness": [0.0, 0.5],
        "layer_stiffness": [1e7, 1e7 * (1 + 1e-12)],
        "subceiling_thickness": [0.0, 0.2],
    }),
    "joist_floor": (thud.JoistFloor, {
        "line_x": [(), (1.0,)],
        "length": [2.0, 2.5],
        "width": [2.0],
        "spacing": [0.6],
        "sheathing_thickness": [0.1],
    }),
    "laminate_floor": (thud.LaminateFloor, {
        "line_y": [(), (1.0,)],
        "length": [2.0, 2.5],
        "width": [2.0],
        "layer_thickness": [(0.2, 0.2)],
    }),
    "modal_floor": (thud.ModalFloor, {
        "file": ["modes_1.csv", "modes_2.csv"],
        "residual_compliance": [0.0, 1e-9],
        "thickness": [0.0, 0.2],
    }),
    "oscillator": (thud.Oscillator, {"mass": [100.0, 100.0 + 1e-9], "stiffness": [2e6, 2.1e6]}),
    "infinite_plate": (thud.InfinitePlate, {"resistance": [1600.0, 1600.0 * (1 + 1e-12)]}),
    "measured_mobility": (thud.MeasuredMobility, {
        "direct": [1e-4],
        "pole_frequency": [(60.0,), (60.0 + 1e-9,)],
        "damping_ratio": [(0.05,)],
        "residue_real": [(0.02,), (0.021,)],
        "residue_imaginary": [(0.0,)],
    }),
}  # fmt: skip
AT_A_POINT = "oscillator", "infinite_plate", "measured_mobility"
MODELS: dict[str, tuple[Any, dict[str, list[Any]]]] = {
    "hollow_sphere": (thud.HollowSphere, {"momentum_flux": ["momentum_balance", "retarding"]}),
    "hunt_crossley": (thud.HuntCrossley, {"contact_time": [0.02], "exponent": [1.0, 1.5]}),
    "two_mass": (thud.TwoMass, {}),
    "measured_modes": (thud.MeasuredModes, {
        "frequency": [(24.0, 89.0), (24.0, 89.0 + 1e-9)],
        "damping_ratio": [(0.1, 0.1), (0.1, 0.11)],
        "effective_mass": [(2.0, 0.5)],
    }),
    "modal_ball": (thud.ModalBall, {"rings": [0, 20], "damping_law": ["constant", "fractional"]}),
    "finite_element": (thud.FiniteElement, {
        "radial_elements": [2],
        "polar_elements": [16, 18],
        "viscosity": ["none", "kelvin_voigt"],
    }),
}  # fmt: skip


def draw(number: int) -> list[Chosen]:
    """Return a pair of cases that differ in a few keys."""
    rng = np.random.default_rng(number)

    def choose(keys: dict[str, list[Any]]) -> dict[str, Any]:
        return {key: values[rng.integers(len(values))] for key, values in keys.items()}

    floor = str(rng.choice(list(FLOORS), p=[0.4] + [0.1] * 6))
    model = str(rng.choice(list(MODELS)))
    first = choose(FLOORS[floor][1])
    changed = rng.choice(list(first), size=min(2, len(first)), replace=False)
    second = {**first, **{key: choose(FLOORS[floor][1])[key] for key in changed}}
    return [(floor, keys, model, choose(MODELS[model][1])) for keys in (first, second)]


def result(case: Chosen) -> str:
    """Return the mobility of a floor and the force of a drop on it, bit for bit; or the refusal."""
    floor, keys, model, options = case
    position = {} if floor in AT_A_POINT else SOURCE
    try:
        built = FLOORS[floor][0](**keys, **position)
        mobility = thud.mobility(built, FREQUENCIES).values
        impact = thud.solve(thud.Case(model=MODELS[model][0](**options), floor=built))
    except thud.ThudError as error:
        return str(error)
    force = impact.on_floor.floor_force if impact.on_floor else impact.floor_force
    return mobility.tobytes().hex() + force[::50].tobytes().hex()


def test_pairs_in_any_order_and_alone_give_the_same_bits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    grid = np.linspace(0, 3, 5)
    for number in (1, 2):
        shape = np.sin(np.pi * grid / 3)[:, None] * np.sin(np.pi * grid / 3) / 20
        thud.write_floor_modes(
            f"modes_{number}.csv", frequency=[30.0 + 1e-6 * number], loss_factor=[0.05],
            x=grid, y=grid, shape=shape[None],
        )  # fmt: skip
    cases = [case for number in range(PAIRS) for case in draw(number)]
    # Each by a fork of a process that has computed nothing.
    with get_context("forkserver").Pool(2, maxtasksperchild=1) as processes:
        alone = processes.map(result, cases, chunksize=1)
    assert len(set(alone)) > PAIRS // 2
    assert list(map(result, cases)) == alone
    assert list(map(result, cases[::-1])) == alone[::-1]


def test_samples_that_differ_in_the_floor_share_no_drop_of_another_case() -> None:
    """A text is part of the case: the flux term of an earlier call is not that of the next."""
    levels = [
        thud.solve_many(
            {"oscillator.mass": [100.0, 200.0]},
            thud.Case(model=thud.HollowSphere(momentum_flux=flux), floor=thud.Oscillator()),
        ).restitution
        for flux in ("momentum_balance", "conservative")
    ]
    assert np.all(levels[0] < 0.95)
    assert levels[1] == pytest.approx(1.0, abs=1e-6)
