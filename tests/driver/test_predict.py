"""The command ``predict``: its tables and pages state what the prediction states."""

from __future__ import annotations

import csv
import html
import io
import math
import re
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import REPOSITORY, names_in
from test_figure_look import assert_clean

import thud
from thud import cli
from thud.floors.description import CONTRIBUTIONS, rating_title, verdict_text
from thud.floors.resonances import floor_frequencies, resonances, room_frequencies
from thud.plot.room_figures import draw_levels
from thud.report.floor_files import contents, page_contents, screen_text
from thud.report.floor_page import floor_page
from thud.report.predicted_floor import PredictedFloor, band_rows

TABLES = [
    f"{name}.csv" for name in ("bands", "contributions", "modes", "octaves", "paths", "ratings")
]
DECK = "concrete 180, screed on 15 MN/m3, ceiling"


def predicted(name: str = DECK, **room: Any) -> PredictedFloor:  # noqa: ANN401 - of any key
    """Return a construction and its prediction."""
    entry = thud.construction(name)
    case = entry.case(thud.Case(room=thud.Room(**room)))  # type: ignore[arg-type]
    return PredictedFloor(name, case.name, thud.predict_level(thud.solve(case)), entry)


@pytest.fixture(scope="module")
def floor() -> PredictedFloor:
    """Return the prediction of a construction with all kinds of layers, and a requirement."""
    return predicted(volume=40.0, required=49.0, wall_lengths=(5.0, 4.0))


def text_of(floor: PredictedFloor) -> str:
    """Return the text of the page of a floor."""
    text = re.sub(r"<style.*?</style>", "", floor_page(floor, b"", b""), flags=re.DOTALL)
    return html.unescape(re.sub(r"<[^>]*>", " ", text)).replace("\N{NO-BREAK SPACE}", " ")


def read_table(content: bytes) -> list[dict[str, str]]:
    comment, _, rows = content.decode().partition("\n")
    assert comment.startswith("# thud ")
    return list(csv.DictReader(rows.splitlines()))


def test_tables_have_the_numbers_of_the_prediction(floor: PredictedFloor, tmp_path: Path) -> None:
    prediction = floor.prediction
    files = contents([floor], tmp_path, report=False)
    bands = read_table(files["bands.csv"])
    force = "force level, dB re 1 N, 1 s"
    expected = {
        "band, Hz": prediction.frequency,
        "energy into the bearing floor, µJ": 1e6 * prediction.energy,
        "radiation factor": prediction.radiation_factor,
        "loss factor": prediction.loss_factor,
        "T, s": prediction.reverberation_time,
        "level, dB": prediction.level,
        "standard uncertainty, dB": prediction.uncertainty,
        "standardized, dB": prediction.standardized,
        # Only where the sound is modal.
        "simply supported, dB": prediction.simple_level[: prediction.n_modal],
        "clamped, dB": prediction.clamped_level[: prediction.n_modal],
    }
    assert 0 < prediction.n_modal < len(bands)
    for title, values in expected.items():
        assert [float(row[title]) for row in bands if row[title]] == values.tolist(), title
    assert {*floor.columns()} == {*expected, force}
    # The energy in a band is its force exposure times the conductance.
    exposure = 10 ** (np.array([float(row[force]) for row in bands]) / 10)
    assert exposure * prediction.conductance == pytest.approx(prediction.energy, rel=1e-9)
    ratings = {row["rating"]: row for row in read_table(files["ratings.csv"])}
    for name, entry in prediction.ratings.items():
        row = ratings[rating_title(prediction, name)]
        assert float(row["value, dB"]) == entry.level
        assert float(row["standard uncertainty, dB"]) == entry.uncertainty
    (octaves,) = read_table(files["octaves.csv"])
    levels = [float(octaves[f"{f} Hz, dB"]) for f in (63, 125, 250, 500)]
    assert levels == prediction.octave_level.tolist()
    assert ratings["required"]["text"] == verdict_text(prediction)
    # No uncertainty is stated without what it consists of.
    rows = read_table(files["contributions.csv"])
    parts = [float(row["standard uncertainty, dB"]) for row in rows]
    assert np.hypot.reduce(parts) == pytest.approx(prediction.rating.uncertainty)


def test_fractions_of_the_paths_are_stated(floor: PredictedFloor, tmp_path: Path) -> None:
    """The A-weighted fractions are means of those of the bands, weighted by their energies."""
    shares, bands = floor.prediction.weighted_shares, floor.prediction.path_shares
    assert shares.sum() == pytest.approx(1.0)
    assert (shares > bands.min(axis=0)).all()
    assert (shares < bands.max(axis=0)).all()
    text = f"floor {100 * shares[0]:.0f} %, wall 1 (5 m) {100 * shares[1]:.0f} %"
    assert text in " ".join(screen_text(floor).split())
    assert text in text_of(floor)
    rows = read_table(contents([floor], tmp_path, report=False)["paths.csv"])
    stated = [float(row["fraction of the energy"]) for row in rows]
    assert stated == pytest.approx([*bands.ravel(), *shares])
    assert {row["path"] for row in rows} == {"floor", "wall 1 (5 m)", "wall 2 (4 m)"}


def test_page_states_ratings_contributions_and_sources(floor: PredictedFloor) -> None:
    text = text_of(floor)
    assert floor.construction
    stated = [
        str(floor.prediction.rating), verdict_text(floor.prediction), "5 × 4 × 2 m, 40 m³",  # noqa: RUF001
        "T = 0.5 s", "15 MN/m³", *floor.construction.sources.values(),
        *map(str, floor.prediction.notes), *(cell for row in band_rows(floor) for cell in row),
    ]  # fmt: skip
    assert [words for words in stated if words not in text] == []
    for name, value in floor.contributions.items():
        assert re.search(f"{name}\\s+{value:.1f}", text)


@pytest.mark.usefixtures("working_directory")
def test_command_reports_details_and_keeps_a_report(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(PredictedFloor, "changes", ())
    monkeypatch.setattr("thud.report.pdf.html_to_pdf", lambda _: b"")
    case = thud.Case(name="my floor", floor=thud.Plate(), room=thud.Room(required=60.0))
    thud.write_case(case, "case.nml")
    words = ["predict", "case.nml", "--construction", "concrete 140", "-o", "out"]
    details = ["--project", "Block <B>", "--client", "A & B"]
    assert cli.main([*words, "--report", *details]) == 0
    text = Path("out/concrete_140.html").read_text(encoding="utf-8")
    stated = re.search(r"Project: Block &lt;B&gt;<br>Client: A &amp; B<br>Date: (.*?)</p>", text)
    assert stated
    assert date.fromisoformat(stated[1])
    printed = capsys.readouterr().out
    assert max(map(len, printed.partition("Results:")[0].splitlines())) <= 80
    prediction = thud.predict_level(floor=case.floor, room=case.room)
    floor = PredictedFloor("my floor", "my_floor", prediction)
    shown = " ".join(printed.split())
    assert " ".join(screen_text(floor).split()) in shown
    assert verdict_text(prediction) in shown
    files = names_in(Path("out"))
    assert {*TABLES, "changes.csv", "my_floor.html", "concrete_140.html"} <= {*files}
    # A report is removed only by a new one.
    assert cli.main([*words, "-q"]) == 1
    assert names_in(Path("out")) == files
    assert "is in the way" in capsys.readouterr().err


def test_resonances_are_those_of_two_masses_on_a_spring(floor: PredictedFloor) -> None:
    # The deck of 180 mm has 414 kg/m2, the screed 100 kg/m2 on 15 MN/m3.
    screed = math.sqrt(15e6 * (1 / 100 + 1 / 414)) / (2 * math.pi)
    ceiling = math.sqrt(1.2 * 343.0**2 / 0.2 * (1 / 9 + 1 / 414)) / (2 * math.pi)
    assert resonances(floor.prediction) == pytest.approx(
        {"floating plate on its layer": screed, "ceiling on its cavity": ceiling}
    )
    # Two boards of 115 kg/m2 on air and channels.
    plate = thud.Plate(
        thickness=0.05, subceiling_thickness=0.05, subceiling_density=2300.0,
        subceiling_modulus=2300.0 * 3500.0**2, channel_stiffness=1e7, channel_spacing=0.1,
    )  # fmt: skip
    room = thud.Room(reverberation_time=0.05)
    stiffness = 1.2 * 343.0**2 / 0.1 + 1e7 / 0.1
    (value,) = resonances(thud.predict_level(floor=plate, room=room)).values()
    assert value == pytest.approx(math.sqrt(2 * stiffness / 115) / (2 * math.pi))


def test_natural_frequencies_are_those_of_plate_and_box(floor: PredictedFloor) -> None:
    plain = predicted("concrete 180", volume=50.0)
    unit = 3500 * 0.18 * np.pi / (4 * np.sqrt(3))
    plate = sorted(unit * (m**2 / 25 + n**2 / 16) for m in range(1, 9) for n in range(1, 9))
    assert floor_frequencies(plain.prediction) == pytest.approx(plate[:8], rel=1e-6)
    box = room_frequencies(plain.prediction)
    sides = np.array(plain.prediction.size)
    assert [*box] == sorted(box, key=lambda order: box[order])
    assert box[1, 0, 0] == pytest.approx(343 / 2 / 5)
    for order, frequency in box.items():
        assert frequency == pytest.approx(343 / 2 * np.linalg.norm(np.array(order) / sides))
    names = dict(floor.modes)
    assert names.keys() > {"floor 1", "room 1, 0, 0", "floating plate on its layer"}


def test_floor_without_modes_is_reported(tmp_path: Path) -> None:
    """The report of a measured mobility was refused for the lack of modes."""
    case = thud.read_case(REPOSITORY / "inputs/floors/measured_slab.nml")
    floor = PredictedFloor("a", "a", thud.predict_level(floor=case.floor, room=case.room))
    assert not [name for name, _ in floor.modes if name.startswith("floor")]
    assert "modes.csv" in contents([floor], tmp_path, report=False)
    assert [layer.thickness for layer in floor.layers] == [0.14]
    assert "Lowest natural frequencies" in floor_page(floor, b"", b"")


def test_changes_are_predictions_of_the_changed_floor(floor: PredictedFloor) -> None:
    changes = {change.text: change.difference for change in floor.changes}
    prediction = floor.prediction
    deck, room = prediction.floor, prediction.room
    assert isinstance(deck, thud.Plate)
    thick = thud.predict_level(floor=replace(deck, thickness=0.19), room=room)
    level = prediction.rating.level
    assert changes["bearing plate +10 mm"] == pytest.approx(thick.rating.level - level)
    long = thud.predict_level(floor=deck, room=replace(room, reverberation_time=1.0))
    assert changes["reverberation time doubled"] == pytest.approx(long.rating.level - level)
    assert {"floating plate +10 mm", "mass of the ceiling doubled"} < changes.keys()
    sizes = [*map(abs, changes.values())]
    assert sizes == sorted(sizes, reverse=True)
    # A change out of range is not listed: 150 kg/m2 doubled, not of a subceiling either.
    hung = thud.Plate(subceiling_thickness=0.0125, length=2.0, width=1.2)
    for deck, mass in ((hung, 0.0), (thud.Plate(), 150.0)):
        room = thud.Room(ceiling_mass=mass, reverberation_time=0.05)
        other = PredictedFloor("a", "a", thud.predict_level(floor=deck, room=room))
        texts = {change.text: change.difference for change in other.changes}
        assert "mass of the ceiling doubled" not in texts
        assert texts["bearing plate +10 mm"] < 0
        assert (texts.get("mass of the subceiling doubled", 0) < 0) == (deck is hung)
        assert (texts.get("stiffness of the channels halved", 0) < 0) == (deck is hung)


@pytest.mark.parametrize(
    ("plate", "materials"),
    [
        (thud.Plate(screed_thickness=0.05), ["floating plate", "resilient layer", "plate"]),
        (
            thud.JoistFloor(length=2.0, width=1.2, subceiling_thickness=0.0125, cavity_depth=0.25),
            ["sheathing", "joists, 60 mm wide, 0.4 m apart", "cavity", "subceiling"],
        ),
        (
            thud.LaminateFloor(added_mass=90.0),
            ["added mass, 90 kg/m²", *["lamella, along", "lamella, across"] * 2, "lamella, along"],
        ),
    ],
)
def test_layers_of_a_case_are_those_of_its_keys(plate: thud.Plate, materials: list[str]) -> None:
    hung = isinstance(plate, thud.JoistFloor)
    room = thud.Room(ceiling_mass=9.0 * (not hung), ceiling_depth=0.25, reverberation_time=0.05)
    floor = PredictedFloor("a", "a", thud.predict_level(floor=plate, room=room))
    layers = floor.layers
    ceiling = [] if hung else ["cavity", "ceiling"]
    for layer, material in zip(layers, [*materials, *ceiling], strict=True):
        assert layer.description.startswith(material)
    # Between joists the cavity is 0.03 m deep below them.
    assert layers[-2].thickness == pytest.approx(0.03 if hung else 0.25)
    if isinstance(plate, thud.LaminateFloor):
        assert [layer.thickness for layer in layers[:6]] == pytest.approx(
            [0.06, 0.04, 0.02, 0.04, 0.02, 0.04]
        )
    rows = {meaning: (value, source) for meaning, value, source in floor.assumptions}
    if not hung:
        meaning = "mass per unit area of a suspended ceiling; 0: none"
        assert rows[meaning] == ("9 kg/m²", "stated in the case")
    assert any("subceiling" in meaning for meaning in rows) == hung
    assert "width of the floor" in " ".join(rows)
    assert_clean(draw_levels(floor.prediction))


def test_workbook_has_every_table(floor: PredictedFloor) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    files = contents([replace(floor, name="=1+1")], Path(), report=False)
    book = openpyxl.load_workbook(io.BytesIO(files["predictions.xlsx"]))
    assert book.sheetnames == [
        "bands", "octaves", "ratings", "contributions", "paths", "modes", "assumptions", "warnings",
    ]  # fmt: skip
    titles, *rows = book["bands"].iter_rows(values_only=True)
    column = titles.index("level, dB")
    assert [row[column] for row in rows] == pytest.approx(floor.prediction.level)
    assert book["bands"]["A2"].data_type == "s"
    rows = list(book["assumptions"].iter_rows(min_row=2, values_only=True))
    assert rows == [("=1+1", *row) for row in floor.assumptions[1:]]
    texts = [row[1] for row in book["warnings"].iter_rows(min_row=2, values_only=True)]
    assert texts == list(map(str, floor.prediction.notes))


def test_source_that_does_not_conform_is_beside_the_rating_and_digits_are_few() -> None:
    case = thud.Case(
        floor=thud.Plate(screed_thickness=0.05, layer_stiffness=6e6, covering_stiffness=1e5),
        room=thud.Room(volume=66.092, reverberation_time=0.05), drop=thud.Drop(height=0.1),
    )  # fmt: skip
    prediction = thud.predict_level(thud.solve(case))
    floor = PredictedFloor("low", "low", prediction)
    note = "the source does not conform"
    assert note in " ".join(screen_text(floor).split())
    page = floor_page(floor, b"", b"")
    assert note.capitalize() in page.partition('class="verdict">')[2].partition("</div>")[0]
    text = text_of(floor)
    assert "66.1 m³" in text
    # No exponents.
    assert not re.search(r"\d+e[-+−]\d", text)
    assert not re.search(r"\de[-+−]\d", str(band_rows(floor)))
    for value, row in zip(prediction.energy, band_rows(floor)[1:], strict=True):
        assert float(row[2]) == pytest.approx(1e6 * value, rel=5e-3)


def test_report_with_all_assumptions_has_two_pages_of_a4(tmp_path: Path) -> None:
    """Two lines of default values were on a page of their own."""
    pytest.importorskip("weasyprint")
    pdfium = pytest.importorskip("pypdfium2", reason="pypdfium2 is not installed")
    room = thud.Room(
        length=5, width=4, height=2.5, reverberation_time=0.1,
        wall_lengths=(5, 4, 5, 4), wall_junction="t",
        wall_thickness=(0.2, 0.1, 0.2, 0.1), wall_density=(2300, 1200, 1800, 1200),
        wall_wave_speed=(3500, 2500, 2700, 2500), required=49,
    )  # fmt: skip
    built = thud.construction("joists, 3 boards, double resilient subceiling")
    prediction = thud.predict_level(thud.solve(built.case(thud.Case(room=room))))
    details = ("Project", "House A"), ("Client", "B"), ("Date", "2026-01-01")
    floor = PredictedFloor(built.name, "joists", prediction, built, details)
    document = pdfium.PdfDocument(page_contents(floor, tmp_path)["joists.pdf"])
    texts = [" ".join(sheet.get_textpage().get_text_bounded().split()) for sheet in document]
    assert len(texts) == 2
    assert str(prediction.rating) in texts[0]
    assert all(str(note)[:40] in texts[0] for note in prediction.notes)
    assert "What would change it" in "".join(texts)
    assert "end of report" in texts[1]
    sizes = {(round(sheet.get_width()), round(sheet.get_height())) for sheet in document}
    assert sizes == {(595, 842)}


def test_floor_with_stated_edges_has_no_contribution_of_them() -> None:
    prediction = thud.predict_level(floor=thud.Plate(support="clamped"))
    known = PredictedFloor("a", "a", prediction)
    assert prediction.level.tolist() == prediction.clamped_level.tolist()
    assert "support of the edges" not in known.contributions
    assert all(row[9] == "–" for row in band_rows(known)[1:])


@pytest.mark.parametrize(
    ("limit", "verdict"), [(40.0, "does not conform"), (57.0, "undecided"), (70.0, "conforms")]
)
def test_undecided_requirement_names_what_would_decide_it(limit: float, verdict: str) -> None:
    prediction = predicted("concrete 180", required=limit).prediction
    text = verdict_text(prediction)
    assert f": {verdict}" in text
    largest = next(iter(prediction.rating.contributions))
    assert (CONTRIBUTIONS[largest].remedy in text) == (verdict == "undecided")
