"""The library of floor constructions, and files of users."""

from __future__ import annotations

import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import REPOSITORY, names_in
from refusals.core import write
from refusals.floors import construction_file
from test_figure_look import assert_clean

import thud
from thud import cli
from thud.base import files
from thud.case.constructions import CEILING_KEYS
from thud.report.predicted_floor import PredictedFloor

FILES = sorted((REPOSITORY / "inputs/constructions").glob("*.toml"))
# What a source must name, unless the value is nominal or says that it is an estimate.
SOURCE = re.compile(r"\b(EN|ISO|DIN|ETA) \d|\bestimate\b|^nominal|manufacturer|technical approvals")
# Standards that the library may cite.
CITED = {
    "EN 312", "EN 338", "EN 1168", "EN 13747", "EN 1991-1-1", "EN 1995-1-1", "EN 29052-1",
    "ISO 12354", "ISO 12354-1", "DIN 18560-2",
}  # fmt: skip


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_file_is_a_floor_whose_values_have_sources(path: Path) -> None:
    content = tomllib.loads(path.read_text(encoding="utf-8"))
    entry = thud.construction(path)
    # A name of its own, which states thicknesses in mm and a stiffness.
    assert entry == thud.construction(content["name"]) == thud.constructions()[content["name"]]
    if thickness := re.match(r"(?:concrete|filigree slab|hollow core|CLT) (\d+)", entry.name):
        whole = np.sum(getattr(entry.floor, "layer_thickness", ())) or entry.floor.thickness
        assert whole == pytest.approx(int(thickness[1]) / 1000)
    if layer := re.search(r"screed ?(\d*) on (\d+) MN", entry.name):
        assert entry.floor.layer_stiffness == int(layer[2]) * 1e6
        assert not layer[1] or entry.floor.screed_thickness == int(layer[1]) / 1000
    stated = content["keys"] | content.get("room", {})
    assert set(entry.sources) == set(stated)
    for key, cell in stated.items():
        assert SOURCE.search(cell["source"]), key
        value = getattr(entry.floor, key, entry.room.get(key))
        assert (list(value) if isinstance(value, tuple) else value) == cell["value"]
    cited = re.findall(r"\b(?:EN|ISO|DIN|ETA) \d[\d-]*", path.read_text(encoding="utf-8"))
    assert set(cited) <= CITED
    assert np.isfinite(thud.mobility(entry.floor, [31.5, 500.0]).values).all()


def mass_of_keys(entry: thud.Construction) -> float | None:
    """Return the mass per unit area that the keys describe, kg/m2; None if they do not."""
    floor = entry.floor
    if isinstance(floor, thud.JoistFloor):
        joists = floor.joist_density * floor.joist_width * floor.joist_height / floor.spacing
        mass = floor.sheathing_thickness * floor.sheathing_density + joists
    elif isinstance(floor, thud.LaminateFloor):
        mass = sum(floor.layer_thickness) * floor.density + floor.added_mass
    elif isinstance(floor, thud.Plate):
        mass = floor.thickness * floor.density
    else:
        return None
    mass += floor.screed_thickness * floor.screed_density
    mass += floor.subceiling_thickness * floor.subceiling_density
    return mass + entry.room.get("ceiling_mass", 0.0)


@pytest.mark.parametrize("entry", list(thud.constructions().values()), ids=lambda entry: entry.name)
def test_mass_of_the_layers_is_that_of_the_keys(entry: thud.Construction) -> None:
    # Neither the resilient layer nor the air is in the keys.
    light = ("mineral wool", "polystyrene", "wood fiber", "cavity")
    heavy = [layer for layer in entry.layers if not any(word in layer.material for word in light)]
    mass = sum(layer.thickness * layer.density for layer in heavy)
    assert mass_of_keys(entry) == pytest.approx(mass, rel=0.005)


@pytest.mark.parametrize(
    ("name", "case"),
    [
        ("concrete 140", "concrete_140"), ("concrete 180, ceiling", "concrete_180_ceiling"),
        ("concrete 220", "concrete_220"), ("joists, 1 board", "joists"),
    ],
)  # fmt: skip
def test_construction_agrees_with_the_case_of_this_floor(name: str, case: str) -> None:
    ours = thud.construction(name).case()
    known = thud.read_case(REPOSITORY / f"inputs/floors/{case}.nml")
    assert type(ours.floor) is type(known.floor)
    ceiling = vars(known.room) if known.room and known.room.ceiling_mass else {"ceiling_mass": 0}
    expected = vars(known.floor) | {k: v for k, v in ceiling.items() if k in CEILING_KEYS}
    # Some of these cases have the source in the middle, and rounded keys.
    for key, other in expected.items():
        if key not in {"source_x", "source_y"}:
            value = getattr(ours.room if key in CEILING_KEYS else ours.floor, key)
            is_number = isinstance(value, float)
            assert value == (pytest.approx(other, rel=0.005) if is_number else other), key


def test_case_has_source_and_room_of_another() -> None:
    """A stated ceiling was lost without a word: 12 dB."""
    room = thud.Room(volume=30.0, ceiling_mass=15.0, ceiling_depth=0.3)
    other = thud.Case(ball=thud.Ball(mass=2.4), drop=thud.Drop(0.5), modes=thud.Modes(), room=room)
    bare, with_ceiling = (
        thud.construction(name).case(other) for name in ("concrete 180", "concrete 180, ceiling")
    )
    assert (bare.ball, bare.drop, bare.modes) == (other.ball, other.drop, None)
    assert bare.name == "concrete_180"
    assert bare.room == room
    assert with_ceiling.room == replace(
        thud.Room(volume=30.0), ceiling_mass=9.0, ceiling_depth=0.2, ceiling_loss_factor=0.3
    )


def test_library_is_filtered_by_words() -> None:
    found = thud.constructions("Mineral concrete 180")
    assert list(found) == [
        "concrete 180, screed on 6 MN/m3",
        "concrete 180, screed on 10 MN/m3",
        "concrete 180, screed on 15 MN/m3",
        "concrete 180, screed on 15 MN/m3, ceiling",
    ]
    # The dictionaries are the caller's.
    name, last = found.popitem()
    last.room["ceiling_mass"] = 10.0
    thud.construction(name).sources.clear()
    last = thud.construction(name)
    assert (last.room["ceiling_mass"], last.sources["ceiling_mass"][:8]) == (9.0, "estimate")
    assert thud.constructions("CONCRETE 180  ceiling")[name] == last
    for one in (last, name):
        assert one in thud.constructions("concrete 180,  Ceiling")
    assert last not in thud.constructions("timber")
    assert thud.construction("Concrete 180 Screed on 15 mn/m3,  ceiling") == last
    assert f"{last.mass_per_area:.0f}" == "526"
    assert last.section.split(", ") == [
        "50 mm cement screed", "20 mm mineral wool", "180 mm concrete",
        "200 mm cavity with absorber", "12.5 mm gypsum board",
    ]  # fmt: skip


def test_section_is_to_scale_and_names_each_layer() -> None:
    entry = thud.construction("joists, 3 boards, rigid subceiling")
    figure = entry.plot()
    assert_clean(figure)
    (axes,) = figure.axes
    boxes = [patch.get_window_extent() for patch in axes.patches]
    # Two joists and two battens stand in the drawn piece of 0.8 m.
    scale = boxes[0].width / 0.8
    thicknesses = [0.0125, 0.0125, 0.022, 0.22, 0.22, 0.024, 0.024, 0.0125]
    assert [box.height for box in boxes] == pytest.approx([scale * size for size in thicknesses])
    assert boxes[3].width == pytest.approx(0.06 * scale)
    assert boxes[4].x0 - boxes[3].x0 == pytest.approx(0.4 * scale)
    shown = [" ".join(text.get_text().split()) for text in axes.texts]
    assert shown == [entry.name, *map(str, entry.layers), "200 mm"]
    bar = axes.lines[-1].get_window_extent()
    assert bar.width == pytest.approx(0.2 * scale, rel=0.02)


def test_file_of_the_page_is_a_construction(tmp_path: Path) -> None:
    page = (REPOSITORY / "docs/constructions.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"^```\n(name = .*?)^```", page, re.DOTALL | re.MULTILINE)
    (tmp_path / "my_floor.toml").write_text(block)
    entry = thud.construction(tmp_path / "my_floor.toml")
    assert entry.name == "concrete 200, my mat"
    assert entry.name not in thud.constructions()
    assert entry.floor == thud.Plate(
        thickness=0.2, screed_thickness=0.06, layer_stiffness=1.2e7, layer_loss_factor=0.15
    )


@pytest.mark.usefixtures("working_directory")
def test_command_compares_constructions_beside_cases(capsys: pytest.CaptureFixture[str]) -> None:
    case = thud.Case(name="first", floor=thud.Plate(thickness=0.2), room=thud.Room(volume=30.0))
    thud.write_case(case, "first.nml")
    mine = construction_file("kind =", 'note = "for tests"\nkind =')
    assert (mine.floor, mine.note) == (thud.Plate(thickness=0.2, density=2400), "for tests")
    assert (mine.room, mine.sources["thickness"]) == ({"ceiling_mass": 12.0}, "drawing")
    options = ["--construction", "concrete 200", "--construction", "mine.toml", "-o", "out"]
    assert cli.main(["floor", "first.nml", *options]) == 0
    assert names_in(Path("out")) == ["floors.html", "floors.svg", "thud.txt"]
    printed = capsys.readouterr()
    assert "mine: for tests" in printed.err
    (names,) = [line.split() for line in printed.out.splitlines() if "first" in line]
    assert names == ["name", "first", "concrete", "200", "mine"]
    title = "500 Hz octave, dB"
    (levels,) = [line for line in printed.out.splitlines() if line.startswith(title)]
    first, library, mine = map(float, levels.removeprefix(title).split())
    # The same ball, drop and room; only the ceiling differs.
    assert first == pytest.approx(library, abs=0.1)
    assert mine < library


def test_command_lists_constructions(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["floor", "--list"]) == 0
    printed = capsys.readouterr().out
    assert max(map(len, printed.splitlines())) <= 80
    assert {word for name in thud.constructions() for word in name.split()} <= {*printed.split()}
    assert cli.main(["floor", "--list", "CLT 240"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 2


def test_inputs_of_a_clone_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = tmp_path / "driver/thud/base/files.py"
    monkeypatch.setattr(files, "__file__", str(module))
    assert files.inputs_folder() == tmp_path / "inputs"
    (tmp_path / "driver/thud/inputs").mkdir(parents=True)
    assert files.inputs_folder() == tmp_path / "driver/thud/inputs"


JOISTS = thud.construction("joists, 1 board")
DECK = thud.construction("concrete 180")
LARGE = thud.Plate(length=7.0, width=6.0)


def spanning(length: float) -> thud.Construction:
    """Return joists of a stated length."""
    floor = replace(JOISTS.floor, length=length)
    return replace(JOISTS, floor=floor, sources={**JOISTS.sources, "length": "drawing"})


@pytest.mark.parametrize(
    ("entry", "floor", "room", "expected"),
    [
        (DECK, None, {}, (5.0, 4.0)),
        (DECK, None, {"length": 6.2, "width": 5.0}, (6.2, 5.0)),
        (DECK, LARGE, {"length": 6.2, "width": 5.0}, (6.2, 5.0)),
        *((DECK, LARGE, room, (7.0, 6.0)) for room in (
            {}, {"length": 6.2}, {"length": 6.2, "width": 5.0, "corner_x": 0.5})),
        # A room never turns joists; those of a case remain as they are.
        (JOISTS, None, {"length": 5.0, "width": 4.0}, (4.0, 5.0)),
        (JOISTS, None, {"length": 4.5, "width": 6.0}, (4.5, 6.0)),
        (JOISTS, None, {"length": 6.0, "width": 4.5, "corner_x": 0.0}, (4.5, 6.0)),
        (spanning(4.8), None, {"length": 6.0, "width": 4.5}, (4.8, 6.0)),
        (spanning(4.2), None, {"length": 6.0, "width": 4.5}, (4.2, 6.0)),
        (JOISTS, thud.JoistFloor(length=5.0, width=4.0), {}, (5.0, 4.0)),
    ],
)  # fmt: skip
def test_construction_has_the_sides_of_the_case(
    entry: thud.Construction,
    floor: thud.Plate | None,
    room: dict[str, float],
    expected: tuple[float, float],
) -> None:
    case = entry.case(thud.Case(floor=floor, room=thud.Room(**room)))  # type: ignore[arg-type]
    thud.case.case.check_case(case)
    assert isinstance(case.floor, thud.Plate | thud.JoistFloor)
    assert (case.floor.length, case.floor.width) == expected


def test_prediction_on_a_construction_has_its_floor_and_the_sides_of_the_case() -> None:
    deck = thud.construction("concrete 180, ceiling")
    prediction = thud.predict_level(floor=deck, room=thud.Room(length=6.2, width=5.0))
    assert prediction.floor == replace(deck.floor, length=6.2, width=5.0)
    assert prediction.room.ceiling_mass == deck.room["ceiling_mass"]
    rows = PredictedFloor("deck", "deck", prediction, deck).assumptions
    assert ("length of the floor", "6.2 m", "that of the case") in rows


@pytest.mark.usefixtures("working_directory")
def test_room_alone_is_that_of_the_constructions() -> None:
    write("room.nml", "&room length = 6.2 width = 5 /\n")
    options = ["--construction", "concrete 180", "-q", "-o", "out"]
    assert cli.main(["predict", "room.nml", *options]) == 0
    # The sides are those of the floor: no note on the room.
    assert "room," not in Path("out/ratings.csv").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "path", sorted((REPOSITORY / "inputs/floors").glob("*.nml")), ids=lambda path: path.stem
)
def test_inputs_of_floors_say_where_their_values_come_from(path: Path) -> None:
    case = thud.read_case(path)
    assert case.floor is not None
    assert np.isfinite(thud.mobility(case.floor, [31.5, 500.0]).values).all()
    group = path.read_text().partition(f"&{case.floor.name}\n")[2].partition("\n/")[0]
    bare = [line.split()[0] for line in group.splitlines() if "=" in line and "!" not in line]
    # A size follows the one above it; a choice says itself, a comment above may tell of a ratio.
    assert set(bare) <= {"width", "thickness", "edges", "source_on", "stiffness_ratio"}
