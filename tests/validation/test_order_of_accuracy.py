"""Orders of accuracy, balances, and a source on a floor in closed form."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import thud

if TYPE_CHECKING:
    from collections.abc import Callable


def order(size: np.ndarray, error: np.ndarray) -> float:
    """Return the slope of log error against log size."""
    return float(np.polyfit(np.log(size), np.log(error), 1)[0])


def test_shell_is_of_fourth_order(oracle: Callable[..., None], curve: Callable[..., None]) -> None:
    step = 1 / np.array([2e3, 4e3, 8e3, 16e3])
    times = np.array(
        [thud.solve(sample_rate=1 / s, model="hollow_sphere").exact_contact_time for s in step]
    )
    error = abs(times / thud.solve(sample_rate=96e3, model="hollow_sphere").exact_contact_time - 1)
    oracle("shell: order of accuracy, less 4", "convergence", order(step, error) - 4, 0.05)
    curve("order of accuracy", "shell, contact time", step / step[0], error)


def test_linear_source_on_a_resistance(oracle: Callable[..., None]) -> None:
    # F = k v0/w exp(-b t) sin w t with b = k/(2 Z), w**2 = k/M - b**2.
    stiffness, mass, resistance = 6e4, 2.5, 1600.0
    decay = stiffness / (2 * resistance)
    rate = np.sqrt(stiffness / mass - decay**2)
    found = thud.solve(
        thud.Ball(mass=mass), model="hunt_crossley", stiffness=stiffness, exponent=1.0,
        floor=thud.InfinitePlate(resistance=resistance),
    ).on_floor  # fmt: skip
    assert found
    oracle(
        "mass on a spring on a resistance: contact time and restitution",
        "closed form",
        [
            found.contact_time * rate / np.pi - 1,
            found.restitution * np.exp(np.pi * decay / rate) - 1,
        ],
        1e-8,
    )


# Models refuse answers that miss 1e-6 of the energy, elements 5e-3; default steps miss far less.
@pytest.mark.parametrize(
    "model",
    [
        thud.HollowSphere(),
        thud.ModalBall(),
        thud.TwoMass(),
        thud.HuntCrossley(contact_time=0.02, restitution=0.8),
    ],
    ids=lambda model: model.name,
)
def test_momentum_and_energy_balance(model: thud.ModelOptions, oracle: Callable[..., None]) -> None:
    impact = thud.solve(thud.Ball(mass=7.3 if model.name == "two_mass" else 2.5), model=model)
    oracle("impulse less change of momentum", "balance", impact.impulse_residual, 1e-8)
    oracle("energy of shell, modes and lumped sources", "balance", impact.energy_residual, 1e-8)


def test_energy_of_the_elements_balances(oracle: Callable[..., None]) -> None:
    impact = thud.solve(thud.Ball(), model="finite_element", snapshot_interval=0)
    oracle("impulse less change of momentum, elements", "balance", impact.impulse_residual, 1e-8)
    oracle("energy of the elements", "balance", impact.energy_residual, 1e-3)
