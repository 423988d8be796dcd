"""The cases of floors: they can be read, and say where their values come from."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import thud

FLOORS = sorted((Path(__file__).parents[2] / "inputs/floors").glob("*.nml"))


@pytest.mark.parametrize("path", FLOORS, ids=lambda path: path.stem)
def test_inputs_of_floors_say_where_their_values_come_from(path: Path) -> None:
    case = thud.read_case(path)
    assert case.floor is not None
    assert np.isfinite(thud.mobility(case.floor, [31.5, 500.0])).all()
    group = path.read_text().partition(f"&{case.floor.name}\n")[2].partition("\n/")[0]
    values = [
        line for line in group.splitlines() if "=" in line and not line.strip().startswith("!")
    ]
    bare = [line.split()[0] for line in values if "!" not in line]
    # A size follows the one above it; a choice says itself, a comment above may tell of a ratio.
    assert set(bare) <= {"width", "thickness", "edges", "source_on", "stiffness_ratio"}
