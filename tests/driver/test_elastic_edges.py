"""Elastic edges: closed form of a beam on springs, and limits."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import frequencies_of
from scipy.optimize import brentq

import thud

if TYPE_CHECKING:
    from collections.abc import Callable

CONCRETE = thud.Plate(thickness=0.16, loss_factor=0.03, edges="absorption")


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


def test_strip_on_elastic_edges_has_the_frequency_of_a_beam_on_springs(
    oracle: Callable[..., None],
) -> None:
    """A long floor with hardly any stiffness along it: each strip across is a beam."""
    width, thickness = 4.0, 0.2
    floor = thud.Plate(
        length=8.0, width=width, thickness=thickness, stiffness_ratio=1e3, torsion_ratio=0.0,
        wave_speed=1800.0, support="elastic", support_stiffness=(2e9 * 0.24 / 2.5,),
        support_rotation=(3 * 2e9 * 0.24**3 / 12 / 2.5,),
    )  # fmt: skip
    mass = 2300 * thickness
    # B_y = B' sqrt(stiffness_ratio).
    stiffness = mass * (1800 * thickness) ** 2 / 12 * np.sqrt(1e3)
    compression = 2e9 * 0.24 / 2.5 * width**3 / stiffness
    rotation = 3 * 2e9 * 0.24**3 / 12 / 2.5 * width / stiffness
    k = 2 * get_beam_root(compression, rotation) / width
    beam = k**2 * np.sqrt(stiffness / mass) / (2 * np.pi)
    # The springs, those of a wall below, lower the frequency of a beam on supports.
    assert beam < 0.85 * (np.pi / width) ** 2 * np.sqrt(stiffness / mass) / (2 * np.pi)
    found = frequencies_of(floor, 2 * beam)
    oracle("lowest frequency of a strip on elastic edges", "closed form", found[0] / beam - 1, 1e-2)


def test_elastic_edges_lie_between_simple_and_clamped_ones() -> None:
    simple, clamped = (
        frequencies_of(replace(CONCRETE, support=s), 200.0) for s in ("simple", "clamped")
    )
    elastic = replace(CONCRETE, support="elastic")
    stiff, thin, some = (
        frequencies_of(replace(elastic, support_stiffness=(a,), support_rotation=(r,)), 200.0)
        for a, r in ((8e11, 8e11), (2e9, 5e4), (2e9, 3e7))
    )
    assert stiff[:6] == pytest.approx(clamped[:6], rel=1e-2)
    assert thin[:6] == pytest.approx(simple[:6], rel=2e-2)
    assert (simple[:4] < some[:4]).all()
    assert (some[:4] < clamped[:4]).all()


@pytest.mark.parametrize("thickness", [0.003, 0.01, 0.18])
def test_stiff_rotation_springs_clamp_light_plates(thickness: float) -> None:
    """Springs of 1e12 N and more were lost in rounding."""
    plate = thud.Plate(thickness=thickness, density=500.0, wave_speed=2500.0, support="clamped")
    stiff = replace(plate, support="elastic", support_rotation=(1e14,))
    frequency = np.array([2.0, 20.0, 200.0])
    found, expected = (thud.mobility(floor, frequency).values for floor in (stiff, plate))
    assert found == pytest.approx(expected, rel=1e-4)
