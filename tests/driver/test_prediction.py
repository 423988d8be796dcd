"""The level in the room below, predicted from a force."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal
from unittest.mock import Mock

import f90nml
import numpy as np
import pytest
from conftest import MINIMAL, naming, recorded
from scipy.linalg import expm
from synthetic import recording_of

import thud
from thud import plot
from thud.base.errors import ReportWarning
from thud.base.note import Note
from thud.base.sentences import PROCESSING, WARNINGS
from thud.floors.prediction import _force_change
from thud.impact.compute import new_room_level
from thud.level.assessment import octave_limits

if TYPE_CHECKING:
    from conftest import CaseFile, Run
    from numpy.typing import NDArray

ROOM_CASE = f"""{MINIMAL}&floor name = 'plate' /
&plate thickness = 0.2 /
&room
 volume = 40
/
"""
# Exact mid frequencies of the one-third-octave bands from 50 to 630 Hz, Hz.
BAND_CENTERS = 1000 * 10 ** (np.arange(-13, -1) / 10)


def test_executable_and_python_predict_the_same(run: Run, case_file: CaseFile) -> None:
    keys = "volume = 40\n wall_lengths = 5, 4, 4\n ceiling_mass = 12\n positions = 'even'"
    done = run(case_file(ROOM_CASE.replace("volume = 40", keys)), "-o", "out")
    assert done.returncode == 0, done.stderr
    assert "contact force" in done.stdout
    assert "rigid floor" not in done.stdout
    folder = case_file(ROOM_CASE).parent / "out"
    impact = thud.read_results(folder)
    found = thud.predict_level(impact)
    assert isinstance(found.floor, thud.Plate)
    assert (found.floor.thickness, found.room.wall_lengths) == (0.2, (5, 4, 4))
    octaves = (63, 125, 250, 500), found.octave_level
    for name, bands in (("levels", (found.frequency, found.level)), ("octaves", octaves)):
        table = np.genfromtxt(folder / f"room_{name}.csv", delimiter=",", names=True)
        for title, values in zip(("nominal_Hz", "level_dB"), bands, strict=True):
            assert table[title] == pytest.approx(values, abs=1e-9), name
    sums = 10 * np.log10((10 ** (found.level.reshape(4, 3) / 10)).sum(axis=1))
    assert (found.octave_level <= sums + 1e-9).all()
    assert "Energy that enters the room through the floor:" in done.stdout
    summary = f90nml.read(folder / "summary.nml")["room_summary"]
    ratings = found.ratings.values()
    assert summary["level"] == pytest.approx([entry.level for entry in ratings])
    assert summary["uncertainty"] == pytest.approx(found.rating.uncertainty)
    assert str(found.rating) in " ".join(done.stdout.split())
    assert f"&room: {found.source_notes[0]}" in done.stderr
    bare = thud.predict_level(impact, room=thud.Room(volume=40.0))
    assert (found.level[6:] < bare.level[6:] - 8).all()


@pytest.mark.parametrize("thickness", [0.02, 0.2])
def test_executable_tells_of_a_floor_that_gives_way(
    run: Run, case_file: CaseFile, thickness: float
) -> None:
    modes = "frequency = 24, 89\n damping_ratio = 0.05, 0.1\n effective_mass = 2.4, 0.1"
    text = ROOM_CASE.replace("0.2", f"{thickness}").replace("hollow_sphere", "measured_modes")
    done = run(case_file(f"{text}&measured_modes {modes} /"), "-o", "out")
    assert ("rigid floor" in done.stdout) == (thickness < 0.1)
    assert "blocked force" in done.stdout


def test_energy_is_that_of_an_infinite_plate(shell: thud.Impact) -> None:
    found = thud.predict_level(shell, thud.Plate(), thud.Room())
    resistance = 8 / np.sqrt(12) * 2300 * 3500 * 0.18**2
    assert found.conductance == pytest.approx(1 / resistance)
    on_plate = thud.solve(floor=thud.Plate(), model="hollow_sphere")
    moved = on_plate.on_floor
    assert moved is not None
    levels = moved.levels("third", force="floor")[3:]
    assert found.energy == pytest.approx(10 ** (levels / 10) / resistance)
    assert found.force == "contact"
    assert found.force_change == pytest.approx(20 * np.log10(moved.peak() / shell.peak()))
    assert thud.predict_level(on_plate).level == pytest.approx(found.level, abs=1e-12)


def test_standardization_takes_room_and_reverberation_out(shell: thud.Impact) -> None:
    """Of the reference room nothing is left; twice the volume halves the energy of sound."""

    def predict(**keys: Any) -> thud.RoomPrediction:  # noqa: ANN401 - of any key
        return thud.predict_level(shell, thud.Plate(), thud.Room(**keys))

    reference = predict()
    assert reference.standardized == pytest.approx(reference.level)
    # Above the modal bands.
    half = reference.level - 10 * np.log10(2)
    assert predict(volume=100.0).level[-4:] == pytest.approx(half[-4:], abs=0.1)
    times = (0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.3, 1.4, 1.5)
    longer = predict(reverberation_time=times)
    assert longer.reverberation_time.tolist() == list(times)
    assert (longer.level[2:] > reference.level[2:]).all()
    octaves = predict(reverberation_time=(0.9, 0.6, 0.5, 0.4)).reverberation_time
    assert octaves.tolist() == [0.9] * 3 + [0.6] * 3 + [0.5] * 3 + [0.4] * 3
    room = thud.Room(reverberation_time=0.8)
    assert room == thud.Room(reverberation_time=(0.8,)) == thud.Room(reverberation_time=[0.8])


@pytest.mark.parametrize("thickness", [0.022, 0.005])
def test_recording_has_the_blocked_force(shell: thud.Impact, thickness: float) -> None:
    """Chipboard, 22 mm Z about 1600 N s/m, and 5 mm, on which the force does not swing."""
    board = thud.Plate(thickness=thickness, density=650.0, wave_speed=2300.0)
    record = recorded(shell, mass=2.5, height=1.0)
    found = thud.predict_level(record, board, thud.Room(reverberation_time=0.1))
    assert found.force == "blocked"
    change = _force_change(2.5, record.contact_time, 1 / found.conductance[0])
    assert found.force_change == pytest.approx(change)


def test_room_hears_the_mean_of_the_drops_without_noise(shell: thud.Impact) -> None:
    quiet = np.zeros(int(0.1 * shell.sample_rate))
    drops = [np.concatenate([quiet, gain * shell.floor_force, quiet]) for gain in (0.9, 1.1)]
    force = np.concatenate(drops)
    force += np.random.default_rng(1).normal(scale=15.0, size=len(force))
    recording = recording_of(force, shell.sample_rate, mass=2.5, height=1.0)
    mean = thud.force_exposure_levels(recording.mean_force(), shell.sample_rate, "third")
    assert mean == pytest.approx(recording.levels("third"), abs=0.01)
    plate, room = thud.Plate(), thud.Room(length=5.0, width=4.0)
    expected = thud.predict_level(shell, plate, room)
    energy = 10 * np.log10((1.1**2 + 0.9**2) / 2)
    error = thud.predict_level(recording, plate, room).level - expected.level - energy
    # What the noise in the contact leaves, for which the levels have their uncertainty.
    assert np.abs(error).max() < 0.5
    heard = thud.modal_room(thud.predict_level(recording, plate, room)).mean - energy
    assert heard == pytest.approx(thud.modal_room(expected).mean, abs=0.2)


def test_positions_are_drawn_unless_modes_are_none_or_too_many(
    shell: thud.Impact, monkeypatch: pytest.MonkeyPatch
) -> None:

    def drawn(floor: thud.Plate, room: thud.Room) -> dict[str, Any]:
        case = replace(shell.case, floor=floor, room=room)
        return plot.case_figures(replace(shell, case=case))

    plate, room = thud.Plate(), thud.Room(reverberation_time=0.1)
    assert "room_positions" in drawn(plate, room)
    # A hall, whose modes overlap in all bands.
    assert "room_positions" not in drawn(thud.Plate(length=12, width=10), thud.Room(height=8))
    refuse = Mock(side_effect=thud.InputError("balls have another shape"))
    monkeypatch.setattr("thud.floors.modal_room._positions", refuse)
    with pytest.warns(ReportWarning, match="room_positions is not drawn .balls"):
        assert "room_positions" not in drawn(plate, room)


def test_impact_on_the_floor_itself_is_of_the_contact_force() -> None:
    floor = thud.Plate(thickness=0.02, density=600, wave_speed=2500)
    impact = thud.solve(floor=floor)
    assert impact.on_floor is not None
    room = thud.Room(reverberation_time=0.1)
    wanted = thud.predict_level(impact, floor, room)
    found = thud.predict_level(impact.on_floor, floor, room)
    assert (found.force, found.notes) == ("contact", wanted.notes)
    assert found.force_change == pytest.approx(wanted.force_change, abs=1e-4)
    # On another floor the change is against the rigid one as well.
    other = thud.Plate(thickness=0.03, density=600, wave_speed=2500)
    change = thud.predict_level(impact.on_floor, other, room).force_change
    assert change == pytest.approx(thud.predict_level(impact, other, room).force_change, abs=1e-4)


def test_share_that_is_radiated_is_that_of_one_side() -> None:
    """It is rho c sigma/(m'' omega eta), with two sides and the inner losses where eta is less."""
    impact, room = thud.solve(), thud.Room(air_density=1.19, sound_speed=340.0)
    light = thud.Plate(
        thickness=0.1, density=45, wave_speed=4600, loss_factor=0.02, edges="laboratory"
    )
    least = []
    for floor in (thud.Plate(thickness=0.2), light):
        found = thud.predict_level(impact, floor, room)
        omega = 2 * np.pi * found.frequency
        lost = 1.19 * 340 * found.radiation_factor / (floor.thickness * floor.density * omega)
        least.append(floor.loss_factor + 2 * lost > found.loss_factor)
        whole = np.where(least[-1], floor.loss_factor + 2 * lost, found.loss_factor)
        assert found.radiated_share == pytest.approx(lost / whole)
    assert not least[0].any()
    assert least[1].any()


LIGHT_SCREED = {"screed_thickness": 0.08, "layer_stiffness": 6.0e6}


@pytest.mark.parametrize(
    ("plate", "room", "expected"),
    [
        ({"thickness": 0.16, **LIGHT_SCREED}, {}, {}),
        ({"thickness": 0.3, **LIGHT_SCREED}, {}, {"level_below_paths": 28.7}),
        ({}, {"volume": 39.0}, {"outside_limits": 1.95}),
        ({}, {"volume": 41.0}, {}),
        ({}, {"volume": 119.0}, {}),
        ({}, {"volume": 121.0}, {"outside_limits": 6.05}),
    ],
)
def test_implausible_levels_and_heights_raise_a_warning(
    shell: thud.Impact, plate: dict[str, float], room: dict[str, float], expected: dict[str, float]
) -> None:
    found = thud.predict_level(shell, thud.Plate(**plate), thud.Room(**room))  # type: ignore[arg-type]
    notes = [note for note in found.notes if note.code in {"level_below_paths", "outside_limits"}]
    assert {note.code: note.value for note in notes} == pytest.approx(expected, abs=0.05)


def test_force_that_is_not_that_on_the_floor_raises_a_warning(shell: thud.Impact) -> None:
    found = thud.predict_level(shell, thud.Plate(), thud.Room())
    enough = replace(found, source_notes=())
    assert enough.notes == ()
    # The force that is used is the right one, or its change is stated.
    for force, change, expected in (
        ("blocked", -0.1, ["blocked_model"]), ("blocked", -0.11, ["blocked_force"]),
        ("blocked", 0.11, ["blocked_force"]), ("contact", -3.0, []),
    ):  # fmt: skip
        one = replace(enough, force=force, force_change=change)  # type: ignore[arg-type]
        assert [(note.code, note.value) for note in one.notes] == [
            (code, change) for code in expected
        ]
    notes = Note("a", others={"name": "&a", "text": "b"}), Note("blocked_force", value=1.0)
    assert replace(enough, floor_notes=notes).notes == notes
    # A fact of the library is stated in its words, whatever the code.
    for code in ("a", *WARNINGS, *PROCESSING):
        note = Note(code, "room", others={"name": "&room", "text": "is large"})
        assert str(note) == "&room is large"


def test_single_numbers_are_those_of_the_levels(shell: thud.Impact) -> None:
    room = thud.Room(volume=70.0, reverberation_time=0.8)
    found = thud.predict_level(shell, thud.Plate(), room)
    assert found.standardized == pytest.approx(thud.standardized_level(found.level, 0.8, 70.0))
    levels = {"thirds": found.level, "standardized": found.standardized}
    for name, bands in (*((name, "third") for name in levels), ("octaves", "octave")):
        expected = thud.rating(levels.get(name, found.octave_level), bands)  # type: ignore[arg-type]
        entry = found.ratings[name]  # type: ignore[index]
        assert entry.level == pytest.approx(expected.a_weighted, abs=1e-9)
        assert entry.rounded == expected.rounded
        parts = [*entry.contributions.values()]
        assert entry.uncertainty == pytest.approx(np.hypot.reduce(parts))
        assert parts == sorted(parts, reverse=True)
    assert found.rating == found.ratings["thirds"]
    # The energy mean of both edges, where the sound is modal.
    edges = np.array([found.simple_level, found.clamped_level])
    assert found.level == pytest.approx(10 * np.log10((10 ** (edges / 10)).mean(axis=0)))
    assert (edges[0] != edges[1]).nonzero()[0].tolist() == list(range(found.n_modal))
    measured = thud.RoomLevels(
        "more", "third", thud.get_bands("third").nominal, np.linspace(80, 40, 15)[None]
    )
    assert found.difference(measured) == pytest.approx(np.linspace(80, 40, 15)[3:] - found.level)


# The resistance sqrt(k M)/2 below which the force does not swing; its peak is 1/e there.
CRITICAL = 2.5 * np.pi / 0.02 / 2


@pytest.mark.parametrize(
    "resistance", [100.0, CRITICAL * (1 - 1e-9), CRITICAL, CRITICAL * (1 + 1e-9), 300.0, 600.0, 1e4]
)
def test_force_on_a_resistance_is_that_of_a_linear_source(resistance: float) -> None:
    """M F'' + (k M/Z) F' + k F = 0 from F = 0: the maximum of its closed form, on both sides."""
    mass, contact = 2.5, 0.02
    stiffness = mass * (np.pi / contact) ** 2
    matrix = np.array([[0, 1], [-stiffness / mass, -stiffness / resistance]])
    force = stiffness * expm(np.linspace(0, 0.03, 30001)[:, None, None] * matrix)[:, 0, 1]
    expected = 20 * np.log10(force.max() / np.sqrt(stiffness * mass))
    tolerance = 1e-3 if abs(resistance - CRITICAL) < 1e-3 else 1e-6
    assert _force_change(mass, contact, resistance) == pytest.approx(expected, abs=tolerance)


@pytest.mark.parametrize("kind", ["finished", "bare"])
def test_reverberation_time_holds_the_losses_that_its_room_has(
    shell: thud.Impact, kind: Literal["finished", "bare"]
) -> None:
    """Above the crossover."""
    room = thud.Room(height=8.0, reverberation_time=0.9, reverberation_of=kind)
    plate = thud.Plate(length=12.0, width=10.0, thickness=0.1)
    found = thud.predict_level(shell, plate, room)
    assert found.n_modal < 3
    air = room.air_density * room.sound_speed
    radiated = air * found.radiation_factor / found.mass_per_area
    floor_density = 120 * np.sqrt(12) / (2 * 3500 * 0.1)
    room_density = 4 * np.pi * 960 * BAND_CENTERS**2 / room.sound_speed**3
    returned = radiated * floor_density / room_density
    decay = 6 * np.log(10) / 0.9
    time = np.linspace(0, 1, 20001)
    for k in range(found.n_modal, 12):
        loss = 2 * np.pi * BAND_CENTERS[k] * found.loss_factor[k]
        room_loss = decay if kind == "finished" else decay + returned[k]
        pressure = air * room.sound_speed / found.volume
        # Energies of floor and room, and the square of the pressure after the detector.
        rates = [[-loss, returned[k], 0], [radiated[k], -room_loss, 0], [0, 8 * pressure, -8]]
        values, vectors = np.linalg.eig(np.array(rates))
        parts = vectors[2] * np.linalg.solve(vectors, [found.energy[k], 0, 0])
        square = (parts * np.exp(np.outer(time, values))).sum(axis=1).real
        expected = 10 * np.log10(square.max() / 2e-5**2)
        assert found.level[k] == pytest.approx(expected, abs=1e-4), k


def test_source_that_does_not_conform_is_named(shell: thud.Impact) -> None:
    (note,) = thud.predict_level(shell, thud.Plate(), thud.Room()).source_notes
    assert note.code == "source_not_conforming"
    lower, upper = np.array(octave_limits("rubber_ball"))
    level = shell.levels(force="floor")
    outside = (level < lower) | (level > upper)
    distances = level - (lower + upper) / 2
    bands = zip(thud.get_bands().nominal, distances, strict=True)
    assert [f"{f:g} Hz {x:.1f} dB" in str(note) for f, x in bands] == outside.tolist()
    impact = thud.solve(replace(shell.case, floor=thud.Plate(), room=thud.Room()))
    assert thud.predict_level(impact.on_floor).source_notes == (note,)  # type: ignore[arg-type]
    assert thud.predict_level(floor=thud.Plate()).source_notes == ()


def test_modal_bands_that_take_too_long_are_named(shell: thud.Impact) -> None:
    """Bands below the crossover of a very live room were statistical without a warning."""
    room = thud.Room(volume=40.0, reverberation_time=20.0, positions="standard")
    found = thud.predict_level(shell, thud.Plate(thickness=0.2, support="simple"), room)
    overlap = np.sqrt(3 * 343**3 * 20 / (2.2 * 4 * np.pi * 40))
    (warning,) = [str(note) for note in found.notes if "three modes" in str(note)]
    assert f"from {found.frequency[found.n_modal]:g} Hz on" in warning
    assert f"overlap, {overlap:.0f} Hz" in warning
    assert 8 < found.n_modal < np.count_nonzero(overlap >= BAND_CENTERS)


def test_walls_take_their_power_from_the_losses_of_the_edges(shell: thud.Impact) -> None:
    """Nothing is lost twice: walls behind soft junctions change nothing, stiff ones take all.

    The contact force depends a little on the losses at the edges: 0.003 dB.
    """

    def level(edges: Literal["building", "absorption"], **walls: object) -> NDArray[np.float64]:
        room = thud.Room(radiation="iso_12354", reverberation_time=0.2, **walls)  # type: ignore[arg-type]
        found = thud.predict_level(shell, thud.Plate(edges=edges), room)
        # Modal levels follow the loss of the modes.
        return found.level[found.n_modal :]

    walls: dict[str, object] = {"wall_lengths": (5, 4, 5, 4), "wall_junction": "index"}
    soft, stiff = ({**walls, "junction_index": index} for index in (80, -5))
    assert level("building", **soft) == pytest.approx(level("building"), abs=5e-3)
    assert level("building", **stiff) == pytest.approx(level("absorption", **stiff), abs=5e-3)
    assert (level("absorption") > level("building") + 1).all()


def test_paths_share_the_energy_that_enters_the_room(shell: thud.Impact) -> None:
    """Equal walls have equal shares, a heavier one or one behind a soft junction less."""

    def predict(**walls: Any) -> thud.RoomPrediction:  # noqa: ANN401 - of any key
        return thud.predict_level(shell, thud.Plate(), thud.Room(**walls))

    bare = predict()
    assert bare.path_shares.tolist() == [[1.0]] * 12
    lengths = {"wall_lengths": (5, 4, 5, 4)}
    found = predict(**lengths)
    assert found.path_shares.sum(axis=1) == pytest.approx(np.ones(12))
    assert found.path_shares[:, 1:3] == pytest.approx(found.path_shares[:, 3:])
    # Walls decay as slowly as the floor does: the level rises as much as the energy.
    rise = -10 * np.log10(found.path_shares[:, 0])
    assert found.level - bare.level == pytest.approx(rise, abs=0.3)
    assert (rise > 0.1).all()
    index = {**lengths, "wall_junction": "index"}
    one = predict(**index)
    values = {"wall_thickness": 0.2, "wall_density": 2300.0, "wall_wave_speed": 3500.0,
              "wall_loss_factor": 0.005, "junction_index": 10.0}  # fmt: skip
    each = predict(**index, **{key: (value,) * 4 for key, value in values.items()})
    assert each.level == pytest.approx(one.level, abs=1e-9)
    cross = {**lengths, "wall_junction": "cross"}
    heavy = predict(**cross, wall_density=(2300.0, 2300.0, 4600.0, 2300.0)).path_shares
    assert (heavy[:, 3] < predict(**cross).path_shares[:, 3]).all()
    assert (heavy[:, 1] > heavy[:, 3]).all()
    soft = predict(**index, junction_index=(10.0, 10.0, 10.0, 30.0))
    assert (soft.path_shares[:, 4] < 0.03 * one.path_shares[:, 4]).all()


def test_room_has_the_dimensions_that_are_stated(shell: thud.Impact) -> None:
    floor = thud.Plate(length=6.0, width=3.0)

    def predict(**keys: Any) -> thud.RoomPrediction:  # noqa: ANN401 - of any key
        return thud.predict_level(shell, floor, thud.Room(**keys))

    assert predict().volume == pytest.approx(45.0)
    assert predict(height=3.0).volume == pytest.approx(54.0)
    assert predict(height=3.0).level == pytest.approx(predict(volume=54.0).level, abs=1e-12)
    small = predict(length=4.0, height=2.5)
    assert small.volume == pytest.approx(30.0)
    (area,) = [str(note) for note in small.notes if note.code == "room_area"]
    assert "12.0 m2" in area
    assert "18.0 m2" in area


@pytest.mark.parametrize("name", ["octaves", "thirds", "standardized"])
def test_requirement_is_judged_by_the_rating_that_it_names(
    run: Run, case_file: CaseFile, name: Literal["octaves", "thirds"]
) -> None:
    room = thud.Room(volume=50.0, reverberation_time=0.8)
    floor = thud.Plate(thickness=0.2)
    source = thud.solve(thud.Case(floor=floor, room=room))
    found = thud.predict_level(source, floor, replace(room, rating=name))
    assert not found.verdict
    rating = found.ratings[name]
    reach = math.ceil(rating.uncertainty)
    for limit, verdict in (
        (rating.rounded + reach + 1, "conforms"), (rating.rounded, "undecided"),
        (rating.rounded - 1, "undecided"), (rating.rounded - reach - 1, "does not conform"),
    ):  # fmt: skip
        prediction = thud.predict_level(source, floor, replace(room, required=limit, rating=name))
        assert prediction.verdict == verdict
        distance = limit + 0.5 - prediction.rating.rounded
        chance = (1 + math.erf(distance / math.sqrt(2) / prediction.rating.uncertainty)) / 2
        assert prediction.probability == pytest.approx(chance)
    keys = f"reverberation_time = 0.8\n required = {limit}\n rating = '{name}'"
    text = ROOM_CASE.replace("volume = 40", f"volume = 50\n {keys}")
    done = run(case_file(text.replace("&model name = 'hollow_sphere' /\n", "")), "-o", "out")
    assert done.returncode == 0, done.stderr
    summary = f90nml.read(case_file(text).parent / "out/summary.nml")["room_summary"]
    assert summary["verdict"] == verdict
    assert summary["probability"] == pytest.approx(chance, abs=1e-9)
    table = thud.compare_floors({"floor": prediction}).to_dataframe().loc[0]
    assert (table["required_dB"], table["required_rating"]) == (limit, name)
    assert table["verdict"] == verdict
    assert table["probability_%"] == pytest.approx(100 * chance)


def test_class_is_that_of_the_rating_of_octaves() -> None:
    room = thud.Room(length=5, width=4, height=2.5, rating="octaves")
    for name, korean in (("concrete 220", 0), ("concrete 220, screed on 15 MN/m3", 3)):
        found = thud.predict_level(floor=name, room=room)
        sums = 10 * np.log10((10 ** (found.level.reshape(4, 3) / 10)).sum(axis=1))
        assert found.rating.level == pytest.approx(thud.rating(sums).a_weighted, abs=0.03)
        assert found.korean_class == korean


@pytest.mark.parametrize("function", [thud.predict_level, thud.tapping_level, thud.solve])
def test_floor_is_a_construction_or_its_name(function: Any) -> None:  # noqa: ANN401
    entry = thud.construction("concrete 180")
    results = [function(floor=floor) for floor in ("concrete 180", entry, entry.floor)]
    assert repr(results[0]) == repr(results[1])
    if function is thud.solve:
        assert results[0].case.room == thud.Room()
    else:
        assert repr(results[0]) == repr(results[2])


def test_level_that_is_not_finite_gets_a_sentence() -> None:
    """It ended with a traceback: cannot convert float NaN to integer."""
    bands = {"nominal_Hz": np.arange(12.0), "level_dB": np.where(np.arange(12) < 2, np.nan, 0)}
    with pytest.raises(thud.NumericalError, match=naming("room", "finite")):
        new_room_level({"room": {}, "room_levels": bands})


def test_covering_lowers_levels_or_is_a_spring_under_the_source(shell: thud.Impact) -> None:
    """Far below the floor's stiffness, the mobility is i omega over the spring with its loss."""
    octaves = (1.0, 3.0, 6.0, 10.0)
    plates = thud.Plate(), thud.Plate(covering_improvement=octaves)
    bare, covering = (thud.predict_level(shell, plate, thud.Room()) for plate in plates)
    for name in ("level", "simple_level", "clamped_level"):
        change = getattr(bare, name) - getattr(covering, name)
        assert change == pytest.approx(np.repeat(octaves, 3), abs=1e-6)
    assert thud.modal_room(covering).mean == pytest.approx(thud.modal_room(bare).mean)
    stiff = thud.Plate(thickness=1.0)
    covered = thud.Plate(thickness=1.0, covering_stiffness=2e5, covering_loss_factor=0.3)
    added = thud.mobility(covered, [50.0]).values - thud.mobility(stiff, [50.0]).values
    assert added == pytest.approx(2j * np.pi * 50 / (2e5 * (1 + 0.3j)), rel=1e-9)


@pytest.mark.parametrize("floor", [thud.JoistFloor(), thud.LaminateFloor()])
def test_bands_beyond_the_modes_are_those_of_the_simply_supported_floor(
    shell: thud.Impact, floor: thud.JoistFloor | thud.LaminateFloor
) -> None:
    """Polynomials resolve few waves of light floors: levels fell by up to 27 dB without a word."""
    room = thud.Room(volume=50.0)
    simple = thud.predict_level(shell, replace(floor, support="simple"), room)
    clamped = thud.predict_level(shell, replace(floor, support="clamped"), room)
    assert clamped.level[-4:] == pytest.approx(simple.level[-4:], abs=2.0)
    assert (simple.n_modal, clamped.n_modal) == (7, 7)
    assert abs(clamped.level[0] - simple.level[0]) > 1


def test_finished_room_decays_as_stated_below_a_light_floor(shell: thud.Impact) -> None:
    """What it loses to floor and ceiling is a part of its reverberation time."""
    floor = thud.LaminateFloor(length=2.0, width=1.5, subceiling_thickness=0.0125, cavity_depth=0.2)
    short, long = (
        thud.predict_level(shell, floor, thud.Room(reverberation_time=(time,)))
        for time in (0.3, 1.2)
    )
    # The floor alone absorbed so much that both times gave one level.
    assert (long.level[long.n_modal :] > short.level[long.n_modal :] + 1.5).all()


def test_level_below_joists_hardly_depends_on_the_width_of_the_floor() -> None:
    """Modes of wide floors end below the bands; their middle represents them there."""
    impact = thud.solve()
    joists = thud.JoistFloor(length=6.0, subceiling_thickness=0.0125, cavity_depth=0.247)
    room = thud.Room(length=6.0, width=5.0, height=2.5, reverberation_time=0.1)
    narrow, wide = (
        thud.predict_level(impact, replace(joists, width=width), room).level
        for width in (5.0, 20.0)
    )
    # Parts of the energy are beyond the room.
    assert np.max(abs(wide - narrow)[5:]) < 4.0
