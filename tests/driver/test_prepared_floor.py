"""A result depends on its own case only, never on cases that were computed before it."""

from __future__ import annotations

from dataclasses import replace
from multiprocessing import get_context
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import thud
from thud.base._schema import KEYS

if TYPE_CHECKING:
    from pathlib import Path

    from thud.base._schema import FloorOptions, ModelOptions
    from thud.base.key import Key

    Chosen = tuple[FloorOptions, ModelOptions]

PAIRS = 12
FREQUENCIES = [30.0, 80.0, 200.0]
SOURCE = {"source_x": 0.31, "source_y": 0.22}
# Small and thick floors have few functions.
FLOORS: list[FloorOptions] = [
    *[thud.Plate(length=2.5, width=2.5, thickness=0.5, **SOURCE)] * 3,
    thud.Plate(length=2.5, width=3.0, screed_thickness=0.5, subceiling_thickness=0.2, **SOURCE),
    thud.JoistFloor(length=2.0, width=2.0, spacing=0.6, sheathing_thickness=0.1, **SOURCE),
    thud.LaminateFloor(length=2.0, width=2.0, layer_thickness=(0.2, 0.2), **SOURCE),
    thud.ModalFloor(file="modes_1.csv", thickness=0.2, **SOURCE),
    thud.Oscillator(),
    thud.InfinitePlate(1600.0),
    thud.MeasuredMobility(1e-4, [60.0], [0.05], [0.02], [0.0]),
]
MODELS: list[ModelOptions] = [
    thud.HollowSphere(), thud.HuntCrossley(contact_time=0.02), thud.TwoMass(), thud.ModalBall(),
    thud.MeasuredModes([24.0, 89.0], [0.1, 0.1], [2.0, 0.5]),
    thud.FiniteElement(radial_elements=2, polar_elements=16),
]  # fmt: skip


def changed(options: Any, key: Key, rng: np.random.Generator) -> Any:  # noqa: ANN401 - options
    """Return options of which a key has another value: near-equal, of a choice, or in a list."""
    value = getattr(options, key.name)
    factor = rng.choice([1 - 1e-12, 0.9])
    if key.name == "file":
        value = "modes_2.csv"
    elif key.kind == "list":
        value = tuple(factor * x for x in value) or (1.0,)
    elif key.kind in {"real", "whole"}:
        value = value + 2 if key.whole else value * factor
    elif key.choices:
        value = str(rng.choice(key.choices))
    return replace(options, **{key.name: value})


def draw(number: int) -> list[Chosen]:
    """Return a pair of cases that differ in up to two keys of the floor."""
    rng = np.random.default_rng(number)
    floor, model = (options[rng.integers(len(options))] for options in (FLOORS, MODELS))  # type: ignore[arg-type]
    keys = [key for key in KEYS if key.owner == floor.name and hasattr(floor, key.name)]
    other = floor
    for index in rng.choice(len(keys), size=min(2, len(keys)), replace=False):
        other = changed(other, keys[index], rng)
    return [(floor, model), (other, model)]


def result(case: Chosen) -> str:
    """Return the mobility of a floor and the force of a drop on it, bit for bit; or the refusal."""
    floor, model = case
    try:
        mobility = thud.mobility(floor, FREQUENCIES).values
        impact = thud.solve(thud.Case(model=model, floor=floor))
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
