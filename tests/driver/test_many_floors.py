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

CASE = thud.Case(floor=thud.Plate(), room=thud.Room(), levels=thud.Levels(bands="both"))
TEXT = "&model /\n&floor name = 'plate' /\n&room /\n"
# With few modes.
DEAD = thud.Room(reverberation_time=0.05)
THICKNESSES = [0.1, 0.2]


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
        assert many.room_third is not None
        assert many.room_rating is not None
        assert many.floor_work is not None
        assert many.room_third[i] == pytest.approx(found.level, abs=1e-9)
        assert many.room_rating[i] == pytest.approx(found.rating.level, abs=1e-9)
        moved = thud.solve(model=model, floor=floor).on_floor
        assert moved is not None
        assert many.floor_work[i] == pytest.approx(moved.floor_work, rel=1e-12)
        for bands in ("octave", "third"):
            levels = moved.levels(bands, force="floor")
            assert getattr(many, f"contact_{bands}")[i] == pytest.approx(levels, abs=1e-9)
        assert many.peak_force[i] == pytest.approx(blocked.peak_force)


def test_each_air_has_the_numbers_of_a_single_prediction() -> None:
    floor = thud.Plate(
        length=2.0,
        width=1.6,
        thickness=0.03,
        density=500.0,
        wave_speed=2500.0,
        subceiling_thickness=0.0125,
    )
    many = thud.solve_many({"air_density": [0.5, 2.0]}, replace(CASE, floor=floor, room=DEAD))
    assert many.room_third is not None
    for level, density in zip(many.room_third, [0.5, 2.0], strict=True):
        found = thud.predict_level(floor=floor, room=replace(DEAD, air_density=density))
        assert level == pytest.approx(found.level, abs=1e-9)


def test_blocked_drop_is_kept_only_while_it_is_the_same(many: thud.Ensemble) -> None:
    """It is kept from drop to drop and from call to call; no number depends on what came before."""
    order = [3, 0, 2, 1]
    parameters = {name: values[order] for name, values in many.parameters.items()}
    again = thud.solve_many(parameters, CASE, threads=1)
    assert again.room_third is not None
    assert many.room_third is not None
    assert np.array_equal(again.room_third, many.room_third[order])
    assert np.array_equal(again.peak_force, many.peak_force[order])
    alone = thud.solve_many({"height": [1.0]}, CASE, threads=1)
    assert alone.peak_force[0] == again.peak_force[0]
    heavy = thud.Case(ball=thud.Ball(mass=2.6), floor=CASE.floor, room=CASE.room)
    assert thud.solve_many({"height": [1.0]}, heavy).peak_force[0] > 1.01 * alone.peak_force[0]


def test_failed_floors_have_a_reason_and_no_numbers() -> None:
    found = thud.solve_many({"thickness": [0.1, -1.0]}, CASE)
    assert found.status.tolist() == [0, 1]
    assert re.search(naming("&plate: thickness", "-1.0"), found.reason[1])
    assert found.room_third is not None
    assert np.isnan(found.room_third[1]).all()
    assert np.isfinite(found.room_third[0]).all()


def test_keys_of_one_name_are_told_apart_by_their_group() -> None:
    case = thud.Case(floor=thud.Oscillator())
    bare = thud.solve_many({"mass": [2.4]}, case)
    named = thud.solve_many({"oscillator.mass": [50.0]}, case)
    assert bare.floor_work is not None
    assert named.floor_work is not None
    assert bare.peak_force[0] < 0.99 * named.peak_force[0]
    assert named.floor_work[0] > 1.1 * bare.floor_work[0]


def test_table_of_floors_has_the_same_numbers(
    run: Run, case_file: CaseFile, tmp_path: Path
) -> None:
    (tmp_path / "samples.txt").write_text("thickness; plate.loss_factor\n0.1; 0.01\n-1; 0.01\n")
    done = run(case_file(TEXT), "--samples", "samples.txt", "-o", "out")
    assert done.returncode in {0, 2}, done.stderr
    with (tmp_path / "out" / "samples.csv").open(encoding="utf-8") as file:
        first, second = csv.DictReader(file)
    case = thud.Case(floor=thud.Plate(), room=thud.Room())
    found = thud.solve_many({"thickness": [0.1], "plate.loss_factor": [0.01]}, case)
    assert found.room_rating is not None
    assert found.floor_work is not None
    assert float(first["room_rating_dB"]) == found.room_rating[0]
    assert float(first["floor_work_J"]) == found.floor_work[0]
    assert float(first["contact_octave_63_Hz_dB"]) == found.contact_octave[0, 1]
    assert second["room_rating_dB"] == ""
    assert "thickness" in second["reason"]


def test_studies_vary_floors_and_rooms(tmp_path: Path, many: thud.Ensemble) -> None:
    path = tmp_path / "case.nml"
    path.write_text(TEXT, encoding="utf-8")
    axes = {"thickness": {"values": THICKNESSES}, "volume": {"values": [40.0, 60.0]}}
    study = {"case": str(path), "parameters": axes}
    found = thud.design(study)
    rating = found.dataset["room_rating"]
    assert many.room_rating is not None
    assert rating.shape == (2, 2)
    # A larger room is quieter.
    assert (rating.values[:, 0] > rating.values[:, 1]).all()
    assert ("lowest rating, dB", f"{float(rating.min()):.2f}") in found.rows()
    thud.plot.save(found.plot(), tmp_path / "map.png")
    assert found.dataset["room_third"].dims[-1] == "rated_third"
    draws = {"kind": "random", "size": 4}
    parameters = {"reverberation_time(1)": {"low": 0.4, "high": 0.6}}
    spread = thud.uncertainty({"case": str(path), "parameters": parameters, "design": draws})
    assert any(row[0] == "rating of the room" for row in spread.rows())
    dataset = many.to_xarray()
    assert dataset["room_third"].shape == (4, 12)
    assert dataset["contact_third"].shape == (4, 15)
