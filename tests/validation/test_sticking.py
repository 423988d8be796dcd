"""Contacts that stick, against the boundary elements of a half space."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from half_space import flat_punch_ratio, new_half_space, sphere_ratio

import thud

if TYPE_CHECKING:
    from collections.abc import Callable

pytestmark = pytest.mark.filterwarnings("ignore::thud.PlausibilityWarning")


@pytest.mark.parametrize("poisson_ratio", [0.0, 0.3, 0.45])
def test_boundary_elements_have_the_factor_of_spence_under_a_punch(
    poisson_ratio: float, oracle: Callable[..., None]
) -> None:
    # Mossakovskii 1954; Spence 1968, Proc. R. Soc. A 305, 55-80.
    nu = poisson_ratio
    factor = (1 - nu) * np.log(3 - 4 * nu) / (1 - 2 * nu)
    oracle(
        "boundary elements: force on a flat punch that sticks",
        "closed form",
        flat_punch_ratio(new_half_space(nu, 80)) / factor - 1,
        6e-4,
    )


@pytest.mark.parametrize("poisson_ratio", [0.0, 0.3])
def test_modal_ball_sticks_as_a_half_space(
    poisson_ratio: float, oracle: Callable[..., None]
) -> None:
    """Points stick where they touch: a sphere gains half as much as a flat punch."""
    ball = thud.Ball(poisson_ratio=poisson_ratio, wall_thickness=0.085)
    forces = [
        thud.compress(
            ball,
            thud.ModalBall(rings=300, floor_friction=friction, loss_factor=1e-3),
            max_deflection=0.5e-3,
            points=101,
            gas="vented",
        ).force
        for friction in ("stick", "none")
    ]
    # About eight rings touch; the next one changes the ratio by 0.3 %.
    ratio = np.mean(forces[0][30:60] / forces[1][30:60])
    expected = sphere_ratio(new_half_space(poisson_ratio, 80))
    assert expected - 1 < 0.6 * (flat_punch_ratio(new_half_space(poisson_ratio, 40)) - 1)
    oracle(
        "modal ball: force on a sphere that sticks", "independent code", ratio / expected - 1, 0.003
    )
