"""The flagship by finite elements against a second element code of other make."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from quadratic_impact import HARD, Body, Rubber, drop_of_library

import thud

if TYPE_CHECKING:
    from collections.abc import Callable

# What 2 x 16 elements read more than 6 x 48 of the same code: docs/finite_elements.md.
COARSE = np.array([0.09, 0.28, 0.29, -0.24, 0.63])


def test_flagship_is_that_of_a_second_code(
    oracle: Callable[..., None], curve: Callable[..., None]
) -> None:
    found, impact = Body(Rubber(), 2, 16).drop(HARD), drop_of_library(8)
    # Its steps of 1e-6 s are of first order in the losses.
    assert found.impulse_residual < 1e-5
    assert found.energy_residual < 1e-4
    # The coarse mesh is 0.25 ms off.
    assert impact.contact_time == pytest.approx(found.contact_time + 0.25e-3, abs=0.1e-3)
    assert impact.restitution == pytest.approx(found.restitution - 0.0014, abs=0.002)
    expected = found.levels - COARSE
    difference = impact.levels() - expected
    oracle(
        "flagship by quadratic elements: octaves to 250 Hz",
        "independent code",
        difference[:4],
        0.05,
        "dB",
    )
    # 8 x 64 elements of the library are not converged at 500 Hz.
    oracle("flagship by quadratic elements: 500 Hz", "independent code", difference[4], 0.2, "dB")
    curve("element codes", "Kelvin–Voigt: quadratic elements", thud.get_bands().nominal, expected)
    curve("element codes", "Kelvin–Voigt: thud", thud.get_bands().nominal, impact.levels())
