"""Edges by the walls: closed forms of a beam on springs, limits, and the validity of springs."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.optimize import brentq

import thud
from thud.base.bridge import ask
from thud.case.case import case_text

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

CONCRETE = thud.Plate(thickness=0.16, loss_factor=0.03, edges="absorption")
WALLS = replace(CONCRETE, support="walls")


def frequencies_of(floor: thud.FloorOptions, highest: float = 200.0) -> Array:
    """Return natural frequencies, Hz."""
    case = thud.Case(floor=floor)
    return np.asarray(ask("floor_modes", case=case_text(case), highest=highest)["frequency"])


@pytest.mark.parametrize(
    ("keys", "compression", "rotation"),
    [
        ({}, 5e9 * 0.175 / 2.5, 3 * 5e9 * 0.175**3 / 12 / 2.5),
        ({"edge_wall_position": "both"}, 3.5e8, 6 * 5e9 * 0.175**3 / 12 / 2.5),
        ({"edge_wall_far_end": "clamped"}, 3.5e8, 4 * 5e9 * 0.175**3 / 12 / 2.5),
        (
            {"edge_wall_thickness": 0.24, "edge_wall_modulus": 3e10, "edge_wall_height": 3.0},
            3e10 * 0.24 / 3, 3 * 3e10 * 0.24**3 / 12 / 3,
        ),
    ],
)  # fmt: skip
def test_walls_are_springs_of_their_bending_and_compression(
    keys: dict[str, Any], compression: float, rotation: float
) -> None:
    """M = 3 E I phi/h of a beam with a pinned far end, 4 E I phi/h with a clamped one."""
    elastic = replace(
        CONCRETE, support="elastic", support_stiffness=(compression,), support_rotation=(rotation,)
    )
    expected = frequencies_of(elastic)
    assert frequencies_of(replace(WALLS, **keys)) == pytest.approx(expected, rel=1e-9)


def get_beam_root(compression: float, rotation: float) -> float:
    """Return k l/2 of the lowest even mode of a beam on springs, in units of E I and l.

    w = A cos k x + B cosh k x about the middle; moment and shear force at x = 1/2 are those of the
    springs.
    """

    def determinant(half: float) -> float:
        k = 2 * half
        c, s, ch, sh = np.cos(half), np.sin(half), np.cosh(half), np.sinh(half)
        # E I w'' = -rotation w' and E I w''' = compression w.
        moment = [-(k**2) * c - rotation * k * s, k**2 * ch + rotation * k * sh]
        force = [k**3 * s - compression * c, k**3 * sh - compression * ch]
        return float(moment[0] * force[1] - moment[1] * force[0])

    return float(brentq(determinant, 0.05, 2.36))


def test_strip_between_walls_has_the_frequency_of_a_beam_on_springs(
    oracle: Callable[..., None],
) -> None:
    """A long floor with hardly any stiffness along it: each strip across is a beam."""
    width, thickness = 4.0, 0.2
    floor = thud.Plate(
        length=8.0, width=width, thickness=thickness, stiffness_ratio=1e3, torsion_ratio=0.0,
        wave_speed=1800.0, support="walls", edge_wall_thickness=0.24, edge_wall_modulus=2e9,
    )  # fmt: skip
    mass = 2300 * thickness
    # B_y = B' sqrt(stiffness_ratio).
    stiffness = mass * (1800 * thickness) ** 2 / 12 * np.sqrt(1e3)
    compression = 2e9 * 0.24 / 2.5 * width**3 / stiffness
    rotation = 3 * 2e9 * 0.24**3 / 12 / 2.5 * width / stiffness
    k = 2 * get_beam_root(compression, rotation) / width
    beam = k**2 * np.sqrt(stiffness / mass) / (2 * np.pi)
    # The compression of the walls lowers the frequency of a beam on supports.
    assert beam < 0.85 * (np.pi / width) ** 2 * np.sqrt(stiffness / mass) / (2 * np.pi)
    found = frequencies_of(floor, 2 * beam)
    oracle(
        "lowest frequency of a strip between walls",
        "closed form",
        found[0] / beam - 1,
        1e-2,
    )


def test_walls_lie_between_simple_and_clamped_edges() -> None:
    simple, clamped = (frequencies_of(replace(CONCRETE, support=s)) for s in ("simple", "clamped"))
    stiff = replace(WALLS, edge_wall_thickness=2.0, edge_wall_modulus=1e12)
    assert frequencies_of(stiff)[:6] == pytest.approx(clamped[:6], rel=1e-2)
    thin = replace(WALLS, edge_wall_thickness=0.01, edge_wall_modulus=1e12, edge_wall_height=5.0)
    assert frequencies_of(thin)[:6] == pytest.approx(simple[:6], rel=2e-2)
    concrete = replace(WALLS, edge_wall_modulus=3e10, edge_wall_position="both")
    assert (simple[:4] < frequencies_of(concrete)[:4]).all()
    assert (frequencies_of(concrete)[:4] < clamped[:4]).all()


def test_modes_of_the_walls_are_warned_of() -> None:
    """Clamped at the floor, pinned at the far end: (k h)**2 = 15.418 (Blevins)."""
    limit = 15.418 * np.sqrt(5e9 * 0.175**2 / (12 * 1800)) / (2 * np.pi * 2.5**2)
    warnings = thud.solve(model="hollow_sphere", floor=WALLS).warnings
    assert any(f"above {limit:.0f} Hz the walls at the edges resonate" in w for w in warnings)
    light = replace(WALLS, edge_wall_density=900.0, edge_wall_far_end="clamped")
    higher = limit * np.sqrt(2) * 22.373 / 15.418
    warnings = thud.solve(model="hollow_sphere", floor=light).warnings
    assert any(f"above {higher:.0f} Hz the walls" in w for w in warnings)


@pytest.mark.parametrize(
    ("keys", "word"),
    [
        ({"edge_wall_thickness": 0.0}, "edge_wall_thickness"),
        ({"edge_wall_position": "above"}, "edge_wall_position"),
    ],
)
def test_walls_that_cannot_be_are_refused(keys: dict[str, Any], word: str) -> None:
    with pytest.raises(thud.InputError, match=word) as refused:
        thud.mobility(replace(WALLS, **keys), [50.0])
    assert "\n" not in str(refused.value)
