"""The motion of the source on the page: sections, stresses, masses."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import pytest

from thud.explorer.answer import answer_case, new_case
from thud.explorer.models import model_facts
from thud.explorer.motion import mises_stress, motion_of
from thud.impact.compute import compute


@lru_cache
def motion(name: str) -> dict[str, Any]:
    """Return the motion of a model with the values with which the page begins."""
    values = next(facts["values"] for facts in model_facts() if facts["name"] == name)
    found = answer_case(new_case({"model": {"name": name}, **values}))["motion"]  # type: ignore[dict-item]
    assert found is not None
    return found  # type: ignore[no-any-return]


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("hollow_sphere", "sphere"),
        ("modal_ball", "sphere"),
        ("finite_element", "section"),
        ("two_mass", "masses"),
    ],
)
def test_every_model_with_a_shape_moves(name: str, kind: str) -> None:
    found = motion(name)
    assert found["kind"] == kind
    assert len(found["time"]) == len(found["floor"]) > 15
    assert found["time"][0] == 0
    assert found["caption"].endswith(".")


def test_models_without_a_shape_have_no_picture() -> None:
    for name in ("measured_modes", "hunt_crossley"):
        values = next(facts["values"] for facts in model_facts() if facts["name"] == name)
        impact = compute(new_case({"model": {"name": name}, **values}))  # type: ignore[dict-item]
        assert motion_of(impact) is None


def test_stress_of_a_uniform_compression_is_that_of_theory() -> None:
    r, z = np.meshgrid(np.linspace(0.01, 0.02, 4), np.linspace(0.0, 0.02, 5), indexing="ij")
    start = np.stack([r, z], axis=-1)
    stretch = 0.7
    position = start * np.array([stretch**-0.5, stretch])
    for share in (0.0, 0.3):
        found = mises_stress(start, position[None], 2e6 / 3, share)
        modulus = 2e6 / 3 * (1 - share + share / stretch)
        assert found == pytest.approx(abs(modulus * (stretch**2 - 1 / stretch)), rel=1e-9)
        assert found.shape == (1, 3, 4)


def test_colors_of_finite_elements_are_those_of_their_mesh() -> None:
    found = motion("finite_element")
    lines, rings = found["mesh"]["shape"]
    assert np.shape(found["mesh"]["nodes"]) == (len(found["time"]), lines, rings, 2)
    stress = np.array(found["color"]["value"])
    assert stress.shape == (len(found["time"]), lines - 1, rings - 1)
    assert found["color"]["unit"] == "kPa"
    # At first touch there is none; then it is largest near the floor.
    assert stress[0].max() < 5
    most = np.unravel_index(stress.argmax(), stress.shape)
    assert most[1] < lines / 3
    assert 100 < stress.max() < 2000


def test_floor_of_the_animation_is_that_of_the_impact() -> None:
    values = {"model": {"name": "modal_ball"}, "floor": {"name": "joist_floor"}}
    impact = compute(new_case(values))
    assert impact.on_floor is not None
    found = motion_of(impact.on_floor)
    assert found is not None
    assert max(found["floor"]) == pytest.approx(
        1e3 * impact.on_floor.floor_displacement.max(), rel=0.05
    )
