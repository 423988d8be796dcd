"""Finite elements on a floor that moves against the modal ball, which is linear.

Both models agree as the drop becomes small. The modal ball couples its rings with the floor by a
scheme of its own, on modes of the exact sphere.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

import thud

if TYPE_CHECKING:
    from collections.abc import Callable

# The modal ball has no bulk ratio, and no gravity: 9.81 m2/s2 is the product of height and gravity.
BALL = thud.Ball(youngs_modulus=2.08e6, poisson_ratio=0.4975)


@pytest.mark.parametrize("resistance", [500.0, 1600.0])
def test_small_drops_on_light_floors_are_those_of_the_modal_ball(
    resistance: float, oracle: Callable[..., None]
) -> None:
    floor = thud.InfinitePlate(resistance=resistance)
    elements = thud.FiniteElement(
        snapshot_interval=0,
        radial_elements=6,
        polar_elements=48,
        loss_factor=0.143,
        fractional_order=0.3,
    )
    modes = thud.ModalBall(damping_law="fractional", loss_factor=0.143)
    found, expected = (
        thud.solve(BALL, thud.Drop(9.81, 0.001), model, duration=0.1, floor=floor)
        for model in (elements, modes)
    )
    assert found.on_floor
    assert expected.on_floor
    # The ball deflects by less than 1 mm, some nodes touch. On a rigid floor 0.0013 of the
    # restitution and 0.1 dB remain between the models.
    oracle(
        "small drops on light floors, elements and exact modes: restitution",
        "other model",
        found.on_floor.restitution - expected.on_floor.restitution,
        4e-3,
    )
    drop = BALL.mass * 9.81e-3
    works = (found.on_floor.floor_work / drop, expected.on_floor.floor_work / drop)
    assert works[0] == pytest.approx(works[1], abs=3e-3)
    assert works[0] > 0.3
    assert found.on_floor.contact_time == pytest.approx(expected.on_floor.contact_time, rel=0.01)
    changes = (found.on_floor.difference()[0], expected.on_floor.difference()[0])
    oracle(
        "small drops on light floors, elements and exact modes: change at 31.5 Hz",
        "other model",
        changes[0] - changes[1],
        0.1,
        "dB",
    )
    assert changes[0] < -1
