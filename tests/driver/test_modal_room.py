"""A modal room under a floor: positions, bands, refusals, and what is shown."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import thud
from thud.plot.floor_figures import plate_modes

FLOOR = thud.Plate(length=4.5, width=3.7, thickness=0.16, edges="laboratory")
ROOM = thud.Room(volume=40.0, reverberation_time=(0.4,))
SIZE = np.array([4.5, 3.7, 40 / (4.5 * 3.7)])
BALL = np.array([1.1, 2.3])
MICROPHONE = np.array([3.1, 0.9, 1.4])


@pytest.fixture(scope="module")
def room(shell: thud.Impact) -> thud.ModalRoom:
    """Return the levels of one pair of positions."""
    return thud.modal_room(
        thud.predict_level(shell, FLOOR, ROOM), balls=[BALL], microphones=[MICROPHONE]
    )


def test_bands_end_where_three_modes_overlap(room: thud.ModalRoom) -> None:
    # 4 pi V f**2/c**3 times 2.2/T is 3.
    crossover = np.sqrt(3 * 343**3 * 0.4 / (2.2 * 4 * np.pi * 40))
    assert room.crossover == pytest.approx(crossover)
    assert room.frequency[-1] <= crossover < room.frequency[-1] * 2 ** (1 / 3) * 1.1
    assert room.prediction.n_modal == len(room.frequency)


def test_positions_are_those_of_the_room_or_stated(shell: thud.Impact) -> None:
    standard, even = (
        thud.modal_room(thud.predict_level(shell, FLOOR, replace(ROOM, positions=kind)))
        for kind in ("standard", "even")
    )
    assert standard.level.shape == (5, 5, len(standard.frequency))
    # Center, and four points 0.75 m from the walls; microphones 1.2 m high.
    assert standard.balls[0] == pytest.approx(SIZE[:2] / 2)
    assert standard.balls[1] == pytest.approx([0.75, 0.75])
    assert standard.balls[4] == pytest.approx(SIZE[:2] - 0.75)
    assert standard.microphones[:, 2] == pytest.approx([1.2] * 5)
    assert even.level.shape[:2] == (16, 16)
    for positions, sides in ((even.balls, SIZE[:2]), (even.microphones, SIZE)):
        assert (positions >= 0.5 - 1e-12).all()
        assert (positions <= sides - 0.5 + 1e-12).all()
        # They fill the room: each half of each side has about as many.
        assert (abs((positions > sides / 2).mean(axis=0) - 0.5) < 0.2).all()


def test_mean_of_positions_is_the_modal_level_of_the_prediction(shell: thud.Impact) -> None:
    room = thud.modal_room(thud.predict_level(shell, FLOOR, ROOM))
    energy = (10 ** (room.level / 10)).mean(axis=(0, 1))
    assert room.mean == pytest.approx(10 * np.log10(energy))
    assert room.spread == pytest.approx(room.level.std(axis=(0, 1)))
    n = room.prediction.n_modal
    # Edges whose support is not known are simply supported.
    assert room.prediction.simple_level[:n] == pytest.approx(room.mean)
    # Walls and ceiling are left out.
    other = replace(ROOM, wall_lengths=(3.0, 2.0), ceiling_mass=20.0)
    level = thud.modal_room(thud.predict_level(shell, FLOOR, other)).level
    np.testing.assert_array_equal(level, room.level)


def test_numbers_of_all_positions_and_shapes_are_shown(room: thud.ModalRoom) -> None:
    assert [row[0] for row in room.rows()[1:]] == [f"{f:g}" for f in room.frequency]
    for column, values in ((1, room.mean), (3, room.level.min(axis=(0, 1)))):
        assert [row[column] for row in room.rows()[1:]] == [f"{value:.1f}" for value in values]
    assert f"to {room.crossover:.0f} Hz: 1 x 1 positions" in repr(room)
    titles = [axes.get_title() for axes in plate_modes(FLOOR, 4, columns=2).axes]
    unit = 3500 * 0.16 * np.pi / (4 * np.sqrt(3))
    assert titles[0] == f"{unit * (1 / 4.5**2 + 1 / 3.7**2):.1f} Hz"
    assert sum(map(bool, titles)) == 4


def test_room_below_a_part_of_a_slab_hears_that_part(shell: thud.Impact) -> None:
    """A slab of two equal bays with a wall between: the room below one of them, on either side."""
    slab = thud.Plate(length=8.0, line_x=(4.0,), source_x=0.2)
    left = thud.Room(length=4.0, width=4.0, height=2.5, positions="standard")
    right = replace(left, corner_x=4.0)
    mirrored = replace(slab, source_x=0.8)
    same = thud.predict_level(shell, slab, left), thud.predict_level(shell, mirrored, right)
    n = same[0].n_modal
    assert same[0].level[:n] == pytest.approx(same[1].level[:n], abs=1e-6)


def test_positions_on_a_wall_below_are_no_samples(shell: thud.Impact) -> None:
    """The middle of the standard positions lies on the wall, where the ball moves nothing."""
    slab = thud.Plate(line_x=(2.5,), source_x=0.2)
    found = thud.predict_level(shell, slab, thud.Room(height=2.5, positions="standard"))
    levels = thud.modal_room(found).level
    on_wall = levels.max(axis=(1, 2)) < levels.max() - 100
    assert on_wall.any()
    energy = (10 ** (levels[~on_wall] / 10)).mean(axis=(0, 1))
    assert thud.modal_room(found).mean == pytest.approx(10 * np.log10(energy), abs=1e-6)


def test_one_mode_of_a_floor_drives_the_room() -> None:
    # Only (1, 1) takes part, which is coupled with the even half waves of a room of the same sides,
    # and with all of a room that ends 5 mm before the edge.
    floor = thud.Plate(length=1.5, width=1.5, thickness=0.15, support="simple")
    source = thud.solve()
    levels = []
    for side in (1.5, 1.495):
        room = thud.Room(length=side, width=side, height=8.0, reverberation_time=0.05)
        prediction = thud.predict_level(source, floor, room)
        levels.append(prediction.level[: prediction.n_modal])
    assert len(levels[0]) > 0
    np.testing.assert_allclose(*levels, atol=0.2)
