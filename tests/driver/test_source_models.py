"""What holds for every source model: the meaning of samples, contacts and stated errors."""

from __future__ import annotations

import importlib
import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thud

pytestmark = pytest.mark.filterwarnings("ignore::thud.PlausibilityWarning")

MODELS: dict[str, dict[str, Any]] = {
    "hollow_sphere": {},
    "hunt_crossley": {"contact_time": 0.02, "restitution": 0.8},
    "two_mass": {},
    "measured_modes": {
        "frequency": [24.0, 89.0], "damping_ratio": [0.1, 0.1], "effective_mass": [2.0, 0.5],
    },
    "modal_ball": {},
    "finite_element": {},
}  # fmt: skip
LIGHT = thud.Oscillator(mass=3, stiffness=3e4, damping=5)


@pytest.mark.parametrize("name", MODELS)
def test_samples_of_every_model_belong_to_their_instants(name: str) -> None:
    """The centroid of the force does not move with the sampling rate, nor does the contact."""
    rates = 44100.0, 22050.0, 16000.0
    centroids, contacts, allowed = [], [], []
    for rate in rates:
        impact = thud.solve(model=name, sample_rate=rate, **MODELS[name])
        force = impact.floor_force
        centroids.append((impact.time @ force) / force.sum())
        contacts.append(impact.exact_contact_time)
        # The sum of t F differs from its integral by the Euler-Maclaurin term of the release,
        # interval**2/12 times contact*F'. With a half sine F' is pi**2/2 of impulse/contact**2.
        # Steps of other lengths and the half interval of a mean at first touch bring as much.
        allowed.append(np.pi**2 / 12 / rate**2 / impact.contact_time)
    # Half a sample would be 11 to 31 us.
    change = np.array(centroids) - centroids[0]
    assert change == pytest.approx(0, abs=allowed[0] + allowed[2])
    exact = name not in {"modal_ball", "finite_element"}
    for rate, contact in zip(rates, contacts, strict=True):
        # A mean shows the end of the force to within its half interval.
        assert abs(contact - contacts[0]) <= (1e-9 if exact else 0.5 / rate + 0.5 / rates[0])


@pytest.mark.parametrize("name", ["hollow_sphere", "hunt_crossley", "modal_ball", "finite_element"])
def test_contact_on_a_light_floor_ends_with_its_last_touch(name: str) -> None:
    """The floor strikes the ball again, 25 ms after first touch."""
    case: dict[str, Any] = {"model": name, "floor": LIGHT, **MODELS[name]}
    impact = thud.solve(duration=1.0, **case).on_floor
    assert impact is not None
    touching = np.flatnonzero(impact.floor_force)
    assert np.diff(touching).max() > 0.005 * impact.sample_rate
    assert impact.contact_time == pytest.approx(touching[-1] / impact.sample_rate, abs=1e-4)
    largest = impact.deflection[impact.floor_force > 0].max()
    assert impact.max_deflection == pytest.approx(largest, rel=0.01)
    # The change of momentum by the whole force; gravity acts on elements until the release.
    gained = 2.5 * (impact.impact_velocity * (1 + impact.restitution))
    weight = 2.5 * 9.81 * impact.contact_time if name == "finite_element" else 0.0
    assert impact.impulse == pytest.approx(gained + weight, rel=1e-3)
    assert impact.floor_work < 2.5 / 2 * impact.impact_velocity**2 * (1 - impact.restitution**2)
    if name == "finite_element":
        assert impact.floor_work == pytest.approx(2.10, abs=0.01)
        assert impact.levels(force="floor")[0] == pytest.approx(37.94, abs=0.05)
        assert impact.max_deflection == pytest.approx(0.018, abs=0.0005)
    for duration in (0.03, 0.04):
        with pytest.raises(thud.InputError, match=r"&sampling: duration .* ends "):
            thud.solve(duration=duration, **case)


def test_ball_that_does_not_rebound_is_refused_at_once() -> None:
    """Whatever the duration, the answer is the same."""
    creeping = thud.FiniteElement(
        viscosity="kelvin_voigt", loss_factor=1.0, loss_frequency=10.0,
        radial_elements=3, polar_elements=24,
    )  # fmt: skip
    sentences = set()
    for duration in (0.05, 0.07, 0.5):
        with pytest.raises(thud.NumericalError, match="stays on the floor") as caught:
            thud.solve(drop=thud.Drop(0.05), model=creeping, duration=duration)
        sentences.add(str(caught.value))
    assert len(sentences) == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "count"),
    [("hunt_crossley", 60), ("hollow_sphere", 60), ("two_mass", 40), ("measured_modes", 300),
     ("modal_ball", 60)],
)  # fmt: skip
def test_stated_errors_cover_those_of_random_sources(
    name: str, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At least 95 % of each: contact times, restitutions, peaks and levels of the octaves."""
    monkeypatch.syspath_prepend(Path(__file__).parents[1] / "bench")
    sources: Any = importlib.import_module("numerical_error")
    chance = random.Random(11)  # noqa: S311 - a fixed draw
    covered = []
    for _ in range(count):
        case = sources.STUDIES[name].draw(chance)
        try:
            impact, levels, numbers = sources.levels(case, {})
        except thud.ThudError:
            assert name == "measured_modes"
            continue
        _, fine_levels, fine_numbers = sources.levels(case, sources.STUDIES[name].fine)
        errors = np.abs([*(numbers - fine_numbers), *(levels - fine_levels)])
        limits = [impact.quantity(f"{name}_error") for name in sources.SCALARS]
        limits += impact.level_error.tolist()
        # Differences of 0.02 % and 0.002 dB are those of the reference.
        limits = np.maximum(limits, [2e-4 * numbers[0], 2e-4, 2e-4 * numbers[2], *5 * [0.002]])
        covered.append(errors <= limits)
    shares = np.mean(covered, axis=0)
    assert (shares >= 0.95).all(), shares
