"""The tyre of the standards as one mass and as belt and rim."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import thud

INPUTS = Path(__file__).parents[2] / "inputs"
TYRE = thud.read_case(INPUTS / "tyre.nml")


def test_two_masses_conform() -> None:
    impact = thud.solve(TYRE)
    assert impact.assess()
    assert impact.energy_residual < 1e-9
    # The published case is the default of the model.
    assert thud.TwoMass() == TYRE.model


def test_one_mass_on_hertz_s_force_does_not() -> None:
    impact = thud.solve(thud.read_case(INPUTS / "tyre_one_mass.nml"))
    met = [bool(criterion) for criterion in impact.assess().criteria[:5]]
    assert met == [False, False, False, True, False]


def test_one_mass_on_the_patch_conforms_too() -> None:
    # docs/lumped_models.md: it is the law of the patch that Hertz's force lacks, not the belt.
    model = replace(TYRE.model, belt_frequency=2e3, carcass_stiffness=4.6e4, contact_damping=0.055)
    impact = thud.solve(replace(TYRE, model=model))
    assert impact.assess()
    np.testing.assert_allclose(impact.levels(), [47.8, 41.2, 22.0, 13.1, 4.1], atol=0.06)


def test_rigid_sidewall_is_one_mass_on_the_patch() -> None:
    # The sidewall's flexibility falls with the square of the frequency, and all that it does.
    levels = [
        thud.solve(
            replace(TYRE, model=replace(TYRE.model, belt_frequency=frequency, belt_damping=1.0))
        ).levels()
        for frequency in (1e3, 2e3, 8e3)
    ]
    change = np.abs(np.array(levels[:2]) - levels[2]).max(axis=1)
    # First order in a flexibility of 1, 1/4 and 1/64.
    assert change[0] / change[1] == pytest.approx((1 - 1 / 64) / (1 / 4 - 1 / 64), rel=0.1)
