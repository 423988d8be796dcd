"""A measured mobility with the plate that it was measured on radiates into the room below."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from conftest import naming

import thud

SIDES = {"length": 4.5, "width": 3.6, "thickness": 0.14, "loss_factor": 0.1, "edges": "absorption"}
PLATE = thud.Plate(**SIDES, source_x=0.43, source_y=0.37)  # type: ignore[arg-type]
ROOM = thud.Room(height=2.5)
FREQUENCY = np.arange(10.0, 1000.0)


def known_floor(plate: thud.Plate) -> thud.MeasuredMobility:
    """Return the mobility of a plate at a point, fitted, with the plate."""
    fit = thud.fit_mobility(thud.mobility(plate, FREQUENCY))
    return replace(fit.floor, **{key: getattr(plate, key) for key in SIDES})


@pytest.fixture(scope="module")
def floor() -> thud.MeasuredMobility:
    """Return the mobility of the plate."""
    return known_floor(PLATE)


@pytest.mark.parametrize("radiation", ["modes", "iso_12354"])
def test_level_of_a_plate_changes_by_its_mobility(
    floor: thud.MeasuredMobility, radiation: str
) -> None:
    room = replace(ROOM, radiation=radiation)  # type: ignore[arg-type]
    known, plate = (thud.predict_level(floor=each, room=room) for each in (floor, PLATE))
    assert known.radiation_factor == pytest.approx(plate.radiation_factor)
    assert known.loss_factor == pytest.approx(plate.loss_factor)
    # Mean of Re Y in each band, by quadrature.
    fine = np.linspace(40, 720, 68001)
    conductance = thud.mobility(PLATE, fine).values.real
    bands = thud.get_bands("third")
    rated = np.isin(bands.nominal, known.frequency)
    change = np.array([
        10 * np.log10(conductance[(fine >= low) & (fine < high)].mean() / plate.conductance[0])
        for low, high in zip(bands.lower[rated], bands.upper[rated], strict=True)
    ])  # fmt: skip
    assert np.abs(change).max() > 1
    statistical = slice(known.n_modal, None)
    assert (known.level - plate.level)[statistical] == pytest.approx(change[statistical], abs=0.05)


def test_mobility_of_a_large_plate_has_the_level_of_the_plate() -> None:
    # Many modes overlap from 80 Hz on: Re Y at a point is that of the infinite plate.
    large = replace(PLATE, length=12.0, width=10.0, thickness=0.06)
    room = thud.Room(radiation="iso_12354", reverberation_time=0.1, length=5.0, width=4.0)
    known, plate = (
        thud.predict_level(floor=each, room=room) for each in (known_floor(large), large)
    )
    above = slice(max(2, known.n_modal), None)
    assert known.level[above] == pytest.approx(plate.level[above], abs=0.3)


def test_one_point_has_the_modes_of_its_plate_in_the_room(floor: thud.MeasuredMobility) -> None:
    known = thud.predict_level(floor=floor, room=ROOM)
    assert known.n_modal == thud.predict_level(floor=PLATE, room=ROOM).n_modal > 0
    assert known.has_edges
    with pytest.raises(thud.InputError, match=naming("this floor has no modes")):
        thud.modal_room(known)


def test_plate_takes_over_outside_the_measurement(floor: thud.MeasuredMobility) -> None:
    short = replace(floor, lowest_frequency=90.0, highest_frequency=300.0)
    known = thud.predict_level(floor=short, room=ROOM)
    plate = thud.predict_level(floor=PLATE, room=ROOM)
    outside = (known.frequency < 90) | (known.frequency > 300)
    assert (known.conductance[outside] == plate.conductance[outside]).all()
    assert (known.conductance[~outside] != plate.conductance[~outside]).all()
    assert any("above 300 Hz" in str(note) for note in known.notes)
