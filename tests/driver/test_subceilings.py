"""A subceiling as a plate of its own: limits, its resonance, losses, and what contradicts it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from conftest import frequencies_of

import thud
from thud.base.bridge import ask
from thud.case.case import case_text

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# 160 mm of concrete, and 9 kg/m2 of gypsum board; small floors have few modes.
CONCRETE = thud.Plate(length=2.0, width=1.6, thickness=0.16, loss_factor=0.03, edges="absorption")
MASS, BOARD = 2300 * 0.16, 720 * 0.0125
HUNG = replace(CONCRETE, subceiling_thickness=0.0125, cavity_depth=0.2)
JOISTS = thud.JoistFloor(length=2.0, width=1.6, subceiling_thickness=0.0125, cavity_depth=0.25)
# Stiffness of 1 m of air, N/m3.
AIR = 1.2 * 343**2
# Relative positions of forces.
STRIKES = {"x": np.array([0.23, 0.41, 0.65]), "y": np.array([0.37, 0.29, 0.44])}


@cache
def radiated_by(floor: thud.FloorOptions) -> Array:
    """Return the energies radiated per force in one-third octaves from 50 to 630 Hz, dB."""
    case = thud.Case(floor=floor, room=thud.Room())
    answer = ask("radiation", case=case_text(case), **STRIKES)
    return np.asarray(10 * np.log10(answer["radiated"]))


def large(floor: thud.Plate) -> thud.Plate:
    """Return a floor of 20 m2."""
    return replace(floor, length=5.0, width=4.0)


def test_stiff_fastening_of_a_light_ceiling_adds_mass(oracle: Callable[..., None]) -> None:
    fixed = replace(HUNG, channel_stiffness=1e9, channel_spacing=0.1)
    heavier = replace(
        CONCRETE,
        density=(MASS + BOARD) / 0.16,
        wave_speed=CONCRETE.wave_speed * np.sqrt(MASS / (MASS + BOARD)),
    )
    ratio = frequencies_of(large(fixed), 300.0) / frequencies_of(large(heavier), 300.0)
    # The mass changes frequencies by 1.2 %, the stiffness of the board by 2e-5.
    oracle("natural frequencies: fixed subceiling − added mass", "other model", ratio - 1, 1e-4)
    change = radiated_by(fixed) - radiated_by(heavier)
    oracle("energy radiated by a fixed subceiling − added mass", "other model", change, 0.5, "dB")


def test_soft_fastening_above_a_deep_cavity_leaves_the_floor_alone() -> None:
    frequency = np.array([45.0, 70.0, 140.0, 300.0])
    soft = replace(HUNG, channel_stiffness=0.0, cavity_depth=2.0)
    found, bare = (thud.mobility(floor, frequency).values for floor in (soft, CONCRETE))
    # Above the resonance of the board at 14 Hz, its air is a spring of 2 Hz below the floor.
    assert abs(found / bare - 1).max() < 0.02
    # Held by stiff lines, it matters.
    fixed = thud.mobility(replace(soft, channel_stiffness=1e9), frequency).values
    assert abs(fixed / bare - 1).max() > 0.03


def test_frequencies_are_those_of_masses_on_a_spring_for_each_shape(
    oracle: Callable[..., None],
) -> None:
    """Both plates have the same sines: two equations for each pair of half waves."""
    light = replace(
        CONCRETE, thickness=0.04, density=600.0, wave_speed=2500.0,
        subceiling_thickness=0.0125, channel_stiffness=0.0, cavity_depth=0.1,
    )  # fmt: skip
    upper, stiffness = 24.0, 24.0 * (2500 * 0.04) ** 2 / 12
    board_stiffness, air = 2.5e9 * 0.0125**3 / 12, AIR / 0.1
    m, n = (grid.ravel() for grid in np.meshgrid(np.arange(1, 80), np.arange(1, 80)))
    k4 = ((m * np.pi / 5) ** 2 + (n * np.pi / 4) ** 2) ** 2
    matrix = np.empty((len(k4), 2, 2))
    matrix[:, 0, 0] = (stiffness * k4 + air) / upper
    matrix[:, 1, 1] = (board_stiffness * k4 + air) / BOARD
    matrix[:, 0, 1] = matrix[:, 1, 0] = -air / np.sqrt(upper * BOARD)
    expected = np.sort(np.sqrt(np.linalg.eigvalsh(matrix)).ravel()) / (2 * np.pi)
    found = frequencies_of(large(light), 150.0)
    # The second mode of the first shape lies at the resonance of both masses on the air.
    resonance = np.sqrt(air * (1 / upper + 1 / BOARD)) / (2 * np.pi)
    assert abs(found / resonance - 1).min() < 2e-3
    error = found / expected[: len(found)] - 1
    oracle("natural frequencies of two plates on air", "closed form", error, 1e-9)


def test_radiated_level_has_the_resonance_of_a_mass_on_a_spring(
    oracle: Callable[..., None],
) -> None:
    """Below a heavy slab the board follows as (1 + i eta)/(1 + i eta - (f/f0)**2)."""
    heavy = replace(CONCRETE, density=20000.0, loss_factor=0.1)
    lines = replace(
        heavy, subceiling_thickness=0.0125, cavity_depth=0.2,
        channel_stiffness=4e4, channel_spacing=0.1, channel_loss_factor=0.3,
    )  # fmt: skip
    found = radiated_by(lines) - radiated_by(heavy)
    stiffness = AIR / 0.2 + 4e4 / 0.1
    resonance = np.sqrt(stiffness * (1 / BOARD + 1 / (0.16 * 20000))) / (2 * np.pi)
    nominal = np.array([50, 63, 80, 100, 125, 160, 200, 250, 315, 400, 500, 630])
    frequency = nominal[:, None] * 2 ** np.linspace(-1 / 6, 1 / 6, 101)
    follows = (1 + 0.3j) / (1 + 0.3j - (frequency / resonance) ** 2)
    expected = 10 * np.log10((abs(follows) ** 2).mean(axis=1))
    assert expected[0] > 9
    oracle(
        "level below a subceiling − that below the slab, by one mass on a spring",
        "closed form",
        found - expected,
        1.5,
        "dB",
    )


@pytest.mark.parametrize("floor", [HUNG, JOISTS, thud.LaminateFloor(subceiling_thickness=0.0125)])
def test_floors_with_subceilings_are_passive(floor: thud.FloorOptions) -> None:
    mobility = thud.mobility(floor, np.geomspace(1.0, 5000.0, 4000)).values
    assert (mobility.real >= 0).all()
    assert mobility.real.max() > 0


KEYS = {
    "subceiling_thickness": 0.025, "subceiling_density": 900.0, "subceiling_modulus": 8e9,
    "subceiling_loss_factor": 0.2, "channel_stiffness": 1e6, "channel_loss_factor": 0.9,
    "cavity_depth": 0.4, "cavity_loss_factor": 0.05, "channel_spacing": 0.25,
}  # fmt: skip


@pytest.mark.parametrize(
    ("floor", "key"),
    [(floor, key) for floor in (HUNG, JOISTS) for key in KEYS if hasattr(floor, key)],
)
def test_each_key_changes_the_radiated_level(floor: thud.FloorOptions, key: str) -> None:
    change: dict[str, Any] = {key: KEYS[key]}
    assert abs(radiated_by(replace(floor, **change)) - radiated_by(floor)).max() > 0.05
    without = replace(floor, subceiling_thickness=0.0)
    if key != "subceiling_thickness":
        assert radiated_by(replace(without, **change)) == pytest.approx(radiated_by(without))


def test_subceiling_lies_below_a_floating_plate() -> None:
    floating = replace(CONCRETE, screed_thickness=0.05)
    both = replace(HUNG, screed_thickness=0.05)
    change = radiated_by(both) - radiated_by(floating)
    # As below the slab alone: the layers are far apart in frequency and mass.
    assert change[2:8] == pytest.approx((radiated_by(HUNG) - radiated_by(CONCRETE))[2:8], abs=3.0)
    assert change[7] < -20


def test_air_of_the_room_is_the_spring_of_a_subceiling() -> None:
    """The air above a subceiling was that of the default room, whatever the room stated."""
    dense, light = (thud.Room(air_density=density) for density in (2.0, 1.0))
    floor = replace(HUNG, channel_stiffness=0.0)
    shallow = replace(floor, cavity_depth=0.1)
    assert frequencies_of(floor, 150.0, dense) == pytest.approx(
        frequencies_of(shallow, 150.0, light), rel=1e-12
    )
    resonance = np.sqrt(2.0 * 343**2 / 0.2 * (1 / MASS + 1 / BOARD)) / (2 * np.pi)
    found = frequencies_of(floor, 150.0, dense)
    assert abs(found / resonance - 1).min() < 0.01
    assert abs(frequencies_of(floor, 150.0, light) / resonance - 1).min() > 0.01


def test_air_of_the_room_damps_the_floor_and_changes_the_force() -> None:
    thin = thud.Plate(
        length=1.0, width=0.8, thickness=0.012, density=500.0, wave_speed=2500.0, loss_factor=0.001,
        edges="absorption", subceiling_thickness=0.0125, cavity_depth=0.02,
    )  # fmt: skip
    dense, light = (thud.Room(air_density=x, reverberation_time=0.05) for x in (2.0, 0.5))
    losses = [
        ask("floor_modes", case=case_text(thud.Case(floor=thin, room=room)), highest=200.0)
        for room in (dense, light)
    ]
    assert losses[0]["loss_factor"][0] > losses[1]["loss_factor"][0]
    impact = thud.solve(floor=thin, room=light)
    # Also of a drop that was computed in another air.
    moved = thud.predict_level(impact, thin, dense).source
    expected = thud.solve(floor=thin, room=dense).on_floor
    assert expected is not None
    assert moved.peak("floor") == pytest.approx(expected.peak("floor"))
    assert impact.on_floor is not None
    assert moved.peak("floor") != pytest.approx(impact.on_floor.peak("floor"), rel=1e-4)


@pytest.mark.parametrize(
    ("change", "speed", "words"),
    [
        ({"cavity_depth": 0.5}, 343.0, "172 Hz the cavity"),
        ({"cavity_depth": 0.5}, 400.0, "200 Hz the cavity"),
        ({"cavity_depth": 0.02, "subceiling_thickness": 0.2, "subceiling_modulus": 1e8}, 343.0,
         "six thicknesses of the subceiling"),
        ({"cavity_depth": 0.02}, 343.0, None),
    ],
)  # fmt: skip
def test_limits_of_cavity_and_board_are_warned_of(
    change: dict[str, Any], speed: float, words: str | None
) -> None:
    room = thud.Room(sound_speed=speed, reverberation_time=0.05)
    notes = thud.solve(model="hollow_sphere", floor=replace(HUNG, **change), room=room).notes
    texts = [str(note) for note in notes if note.code == "outside_frequencies"]
    assert len(texts) == (words is not None)
    assert all(words is not None and words in text for text in texts)
