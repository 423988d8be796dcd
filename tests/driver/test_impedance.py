"""Impedance of a source during its impact."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import naming

import thud

if TYPE_CHECKING:
    from collections.abc import Callable

STIFFNESS = 6e4
MASS = 2.5


@pytest.fixture(scope="module")
def linear() -> thud.BallImpedance:
    """Return the impedance of a mass on a spring."""
    ball = thud.Ball(mass=MASS)
    impact = thud.solve(ball, model="hunt_crossley", stiffness=STIFFNESS, exponent=1.0)
    return thud.ball_impedance(impact, resistance=[1e3, 1e4, 1e5])


def closed_spectrum(frequency: np.ndarray, resistance: float) -> np.ndarray:
    """Return the spectrum of the force of the linear source, by its closed form.

    F = k v0/w exp(-b t) sin w t up to pi/w, b = k/(2 Z), w**2 = k/M - b**2 (physics of a mass on a
    spring on a resistance).
    """
    decay = STIFFNESS / (2 * resistance)
    rate = np.sqrt(STIFFNESS / MASS - decay**2)
    s = decay + 2j * np.pi * frequency
    speed = np.sqrt(2 * 9.81)
    return STIFFNESS * speed * (1 + np.exp(-s * np.pi / rate)) / (s**2 + rate**2)


def test_linear_source_has_its_closed_form(
    linear: thud.BallImpedance, oracle: Callable[..., None]
) -> None:
    bands = thud.get_bands()
    for i, resistance in enumerate(linear.resistance):
        for j, (low, high) in enumerate(zip(bands.lower, bands.upper, strict=True)):
            lines = low + (np.arange(2000) + 0.5) * (high - low) / 2000
            blocked, moved = closed_spectrum(lines, 1e15), closed_spectrum(lines, resistance)
            expected = resistance * np.vdot(moved, blocked - moved) / np.vdot(moved, moved)
            change = 10 * np.log10(np.vdot(moved, moved).real / np.vdot(blocked, blocked).real)
            # 64 lines in a band, and samples of a force that ends with an edge.
            assert abs(linear.estimate[i, j] - expected) < 3e-3 * abs(expected)
            oracle(
                "mass on a spring on a resistance: change of octaves",
                "closed form",
                linear.change[i, j] - change,
                2e-3,
                "dB",
            )


def test_all_levels_of_a_linear_source_change_alike(linear: thud.BallImpedance) -> None:
    # To the first order in 1/Z the force is that on a rigid floor times exp(-b t), and about the
    # middle of a symmetric pulse the factor is exp(-b pi/(2 w)) in each band: pi/4 sqrt(k M)/Z.
    expected = np.pi / 4 * np.sqrt(STIFFNESS * MASS)
    # What is left of the second order is 304/1e5.
    np.testing.assert_allclose(linear.impedance.real, expected, rtol=5e-3)
    np.testing.assert_allclose(linear.change[-1], -20 / np.log(10) * expected / 1e5, rtol=5e-3)


def test_limit_of_changes_with_one_over_the_resistance_is_exact(linear: thud.BallImpedance) -> None:
    slope = np.array([-900.0, 2500.0, -7000.0, -0.2, 15000.0])
    found = replace(linear, change=slope / linear.resistance[:, None])
    for decibels in (0.5, 1.0, 2.0):
        expected = np.where(abs(slope) / 1e3 >= decibels, abs(slope) / decibels, np.nan)
        assert found.limit(decibels) == pytest.approx(expected, nan_ok=True)
    # Of several crossings the last one counts.
    found = replace(found, change=np.array([[2.0], [0.1], [0.4]]) * np.ones(5))
    with pytest.raises(thud.InputError, match=naming("decibels", 0.3, 0.4)):
        found.limit(0.3)
    assert ((found.limit(1.0) > 1e3) & (found.limit(1.0) < 1e4)).all()
    far = replace(found, change=np.full((3, 5), 0.001))
    assert np.isnan(far.limit()).all()
    assert far.rows()[1][-1] == ""


def test_limit_is_where_the_level_changes_by_1_db(shell: thud.Impact) -> None:
    found = thud.ball_impedance(shell)
    assert found.resistance[[0, -1]] == pytest.approx([10**2.75, 1e6])
    assert len(found.resistance) == 14
    limit = found.limit()
    for band in (0, 2):
        floor = thud.InfinitePlate(resistance=float(limit[band]))
        moved = thud.solve(floor=floor, model="hollow_sphere").on_floor
        assert moved is not None
        assert moved.difference()[band] == pytest.approx(-1.0, abs=0.02)


def test_figure_draws_sources_and_floors(linear: thud.BallImpedance) -> None:
    figure = linear.plot(floors={"chipboard": thud.InfinitePlate(resistance=1600.0)})
    (axes,) = figure.axes
    assert len(axes.lines) == 3
    np.testing.assert_allclose(axes.lines[0].get_ydata(), 1600.0)
    np.testing.assert_allclose(axes.lines[1].get_ydata(), np.abs(linear.impedance))
    assert axes.get_ylabel() == "Impedance, N s/m"
