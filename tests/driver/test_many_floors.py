"""Many drops on floors and in rooms: the numbers of single ones, parameters, studies, files."""

from __future__ import annotations

import csv
import re
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import naming

import thud

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import CaseFile, Run
    from numpy.typing import NDArray

CASE = thud.Case(floor=thud.Plate(), room=thud.Room(), levels=thud.Levels(bands="both"))
# With few modes.
DEAD = thud.Room(reverberation_time=0.05)
THICKNESSES = [0.1, 0.2]


def numbers(many: thud.Ensemble, name: str) -> NDArray[np.float64]:
    """Return a result that cases with a floor and a room have."""
    values = getattr(many, name)
    assert values is not None
    return np.asarray(values)


@pytest.fixture(scope="module")
def many() -> thud.Ensemble:
    """Return drops on plates of two thicknesses, from two heights."""
    parameters = {"height": [0.5, 0.5, 1.0, 1.0], "thickness": 2 * THICKNESSES}
    return thud.solve_many(parameters, CASE, threads=2)


@pytest.mark.parametrize("model", [thud.HollowSphere(), thud.ModalBall()])
def test_each_floor_has_the_numbers_of_a_single_prediction(model: thud.ModelOptions) -> None:
    many = thud.solve_many({"plate.thickness": THICKNESSES}, replace(CASE, model=model))
    blocked = thud.solve(model=model)
    for i, thickness in enumerate(THICKNESSES):
        floor = thud.Plate(thickness=thickness)
        found = thud.predict_level(blocked, floor, thud.Room())
        assert numbers(many, "room_third")[i] == pytest.approx(found.level, abs=1e-9)
        assert numbers(many, "room_rating")[i] == pytest.approx(found.rating.level, abs=1e-9)
        moved = thud.solve(model=model, floor=floor).on_floor
        assert moved is not None
        assert numbers(many, "floor_work")[i] == pytest.approx(moved.floor_work, rel=1e-12)
        for bands in ("octave", "third"):
            levels = moved.levels(bands, force="floor")
            assert numbers(many, f"contact_{bands}")[i] == pytest.approx(levels, abs=1e-9)
        assert many.peak_force[i] == pytest.approx(blocked.peak_force)


def test_each_air_has_the_numbers_of_a_single_prediction() -> None:
    floor = thud.Plate(
        length=2.0, width=1.6, thickness=0.03, density=500.0, wave_speed=2500.0,
        subceiling_thickness=0.0125,
    )  # fmt: skip
    many = thud.solve_many({"air_density": [0.5, 2.0]}, replace(CASE, floor=floor, room=DEAD))
    expected = [
        thud.predict_level(floor=floor, room=replace(DEAD, air_density=density)).level
        for density in (0.5, 2.0)
    ]
    assert numbers(many, "room_third") == pytest.approx(np.array(expected), abs=1e-9)


def test_blocked_drop_is_kept_only_while_it_is_the_same(many: thud.Ensemble) -> None:
    """It is kept from drop to drop and from call to call; no number depends on what came before."""
    order = [3, 0, 2, 1]
    parameters = {name: values[order] for name, values in many.parameters.items()}
    again = thud.solve_many(parameters, CASE, threads=1)
    assert np.array_equal(numbers(again, "room_third"), numbers(many, "room_third")[order])
    assert np.array_equal(again.peak_force, many.peak_force[order])
    alone = thud.solve_many({"height": [1.0]}, CASE, threads=1)
    assert alone.peak_force[0] == again.peak_force[0]
    heavy = thud.Case(ball=thud.Ball(mass=2.6), floor=CASE.floor, room=CASE.room)
    assert thud.solve_many({"height": [1.0]}, heavy).peak_force[0] > 1.01 * alone.peak_force[0]


def test_keys_of_one_name_are_told_apart_by_their_group() -> None:
    case = thud.Case(floor=thud.Oscillator())
    bare = thud.solve_many({"mass": [2.4]}, case)
    named = thud.solve_many({"oscillator.mass": [50.0]}, case)
    assert bare.peak_force[0] < 0.99 * named.peak_force[0]
    assert numbers(named, "floor_work")[0] > 1.1 * numbers(bare, "floor_work")[0]


def test_table_of_floors_has_the_same_numbers(
    run: Run, case_file: CaseFile, tmp_path: Path
) -> None:
    (tmp_path / "samples.txt").write_text("thickness; plate.loss_factor\n0.1; 0.01\n-1; 0.01\n")
    case = case_file("&model /\n&floor name = 'plate' /\n&room /\n")
    done = run(case, "--samples", "samples.txt", "-o", "out")
    assert done.returncode in {0, 2}, done.stderr
    with (tmp_path / "out" / "samples.csv").open(encoding="utf-8") as file:
        first, second = csv.DictReader(file)
    axes = {"thickness": [0.1, -1.0], "plate.loss_factor": 0.01}
    found = thud.solve_many(axes, thud.Case(floor=thud.Plate(), room=thud.Room()))
    for title, name in (("room_rating_dB", "room_rating"), ("floor_work_J", "floor_work")):
        values = numbers(found, name)
        assert float(first[title]) == values[0]
        assert (second[title], np.isnan(values[1])) == ("", True)
    assert float(first["contact_octave_63_Hz_dB"]) == numbers(found, "contact_octave")[0, 1]
    assert found.status.tolist() == [0, 1]
    for reason in (second["reason"], found.reason[1]):
        assert re.search(naming("&plate: thickness", "-1.0"), reason)


def test_studies_vary_floors_and_rooms(tmp_path: Path, many: thud.Ensemble) -> None:
    axes = {"thickness": {"values": THICKNESSES}, "volume": {"values": [40.0, 60.0]}}
    found = thud.design({"case": CASE.to_namelist(), "parameters": axes})
    rating = found.dataset["room_rating"]
    assert rating.shape == (2, 2)
    # A larger room is quieter.
    assert (rating.values[:, 0] > rating.values[:, 1]).all()
    assert ("lowest rating, dB", f"{float(rating.min()):.2f}") in found.rows()
    thud.plot.save(found.plot(), tmp_path / "map.png")
    assert found.dataset["room_third"].dims[-1] == "rated_third"
    draws = {"kind": "random", "size": 4}
    parameters = {"reverberation_time(1)": {"low": 0.4, "high": 0.6}}
    study = {"case": CASE.to_namelist(), "parameters": parameters, "design": draws}
    assert any(row[0] == "rating of the room" for row in thud.uncertainty(study).rows())
    dataset = many.to_xarray()
    assert dataset["room_third"].shape == (4, 12)
    assert dataset["contact_third"].shape == (4, 15)
