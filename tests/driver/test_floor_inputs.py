"""The cases of floors: they can be read, and say where their values come from."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import thud

FLOORS = sorted((Path(__file__).parents[2] / "inputs/floors").glob("*.nml"))


@pytest.mark.parametrize("path", FLOORS, ids=lambda path: path.stem)
def test_inputs_of_floors_say_where_their_values_come_from(path: Path) -> None:
    case = thud.read_case(path)
    assert case.floor is not None
    assert np.isfinite(thud.mobility(case.floor, [31.5, 500.0]).values).all()
    group = path.read_text().partition(f"&{case.floor.name}\n")[2].partition("\n/")[0]
    values = [
        line for line in group.splitlines() if "=" in line and not line.strip().startswith("!")
    ]
    bare = [line.split()[0] for line in values if "!" not in line]
    # A size follows the one above it; a choice says itself, a comment above may tell of a ratio.
    assert set(bare) <= {"width", "thickness", "edges", "source_on", "stiffness_ratio"}


def test_lines_that_coincide_are_refused() -> None:
    """Equal lines counted as two supports, and gave wrong modes."""
    with pytest.raises(thud.InputError, match=r"&plate: line_x = 2\.0 m is stated twice"):
        thud.mobility(thud.Plate(line_x=(2.0, 3.0, 2.0), source_x=0.2), [50.0])
    with pytest.raises(
        thud.InputError, match=r"line_y = 1\.505 m is stated twice, or within 10\.0 mm"
    ):
        thud.mobility(thud.Plate(line_y=(1.5, 1.505)), [50.0])


@pytest.mark.parametrize("thickness", [0.003, 0.01, 0.18])
def test_stiff_rotation_springs_clamp_light_plates(thickness: float) -> None:
    """Springs of 1e12 N and more were lost in rounding."""
    plate = thud.Plate(thickness=thickness, density=500.0, wave_speed=2500.0, support="clamped")
    stiff = replace(plate, support="elastic", support_rotation=(1e14,))
    frequency = np.array([2.0, 20.0, 200.0])
    assert thud.mobility(stiff, frequency).values == pytest.approx(
        thud.mobility(plate, frequency).values, rel=1e-4
    )


def test_warning_says_where_the_modes_of_a_floor_end() -> None:
    with pytest.warns(thud.PlausibilityWarning, match="&joist_floor: above 678 Hz the modes"):
        thud.solve(floor=thud.JoistFloor(support="clamped"))
