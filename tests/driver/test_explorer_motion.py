"""The motion of the source on the page: computed sections, and flattened spheres."""

from __future__ import annotations

import numpy as np
import pytest

from thud.explorer.answer import answer_case, new_case
from thud.explorer.models import model_facts


@pytest.mark.parametrize(
    ("name", "is_computed"),
    [("hollow_sphere", False), ("modal_ball", False), ("finite_element", True), ("two_mass", None)],
)
def test_section_of_a_ball_is_flattened_and_returns(name: str, *, is_computed: bool | None) -> None:
    (values,) = (facts["values"] for facts in model_facts() if facts["name"] == name)
    motion = answer_case(new_case({"model": {"name": name}, **values}))["motion"]  # type: ignore[dict-item]
    if is_computed is None:
        assert motion is None
        return
    assert motion["is_computed"] is is_computed
    outer, inner = np.array(motion["outer"]), np.array(motion["inner"])
    assert outer.shape == inner.shape == (len(motion["time"]), 25, 2)
    assert len(motion["time"]) > 15
    assert motion["time"][0] == 0
    # The radius and the wall of the standard ball, mm, before the impact and on the floor.
    assert outer[0, :, 0].max() == pytest.approx(89, abs=1)
    assert outer[0, -1, 1] - inner[0, -1, 1] == pytest.approx(32, abs=1)
    half = int(np.argmin(np.abs(np.array(motion["time"]) - 10)))
    assert outer[half, :, 1].min() == pytest.approx(0, abs=0.1)
    assert 30 < outer[half][outer[half, :, 1] < 1, 0].max() < 70
    assert outer[half, -1, 1] < outer[0, -1, 1] - 15
