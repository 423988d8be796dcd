"""The motion of the source on the page: sections, stresses, masses."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import pytest

from thud.explorer.answer import answer_case, new_case
from thud.explorer.models import model_facts
from thud.explorer.motion import motion_of
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
    assert len(found["time"]) > 15
    assert found["time"][0] == 0
    assert found["caption"].endswith(".")


def test_models_without_a_shape_have_no_picture() -> None:
    for name in ("measured_modes", "hunt_crossley"):
        values = next(facts["values"] for facts in model_facts() if facts["name"] == name)
        impact = compute(new_case({"model": {"name": name}, **values}))  # type: ignore[dict-item]
        assert motion_of(impact) is None


def test_section_of_finite_elements_is_flattened_and_returns() -> None:
    found = motion("finite_element")
    outer, inner = np.array(found["outer"]), np.array(found["inner"])
    assert outer.shape == inner.shape == (len(found["time"]), 33, 2)
    # The radius and the wall of the standard ball, mm, before the impact and on the floor.
    assert outer[0, :, 0].max() == pytest.approx(89, abs=1)
    assert outer[0, -1, 1] - inner[0, -1, 1] == pytest.approx(32, abs=1)
    half = int(np.argmin(np.abs(np.array(found["time"]) - 10)))
    assert outer[half, :, 1].min() == pytest.approx(0, abs=0.1)
    assert 30 < outer[half][outer[half, :, 1] < 1, 0].max() < 55
    assert outer[half, -1, 1] < outer[0, -1, 1] - 15
