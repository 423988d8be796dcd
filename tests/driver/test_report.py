"""The calibration report: all numbers of the table, any names, any number of drops."""

from __future__ import annotations

import base64
import html
import itertools
import json
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from conftest import REPOSITORY, names_in, naming
from markupsafe import escape
from matplotlib import font_manager
from scipy.special import stdtrit
from synthetic import make_recording, with_force
from test_comparison_page import assert_scrolls_inside, open_in_browser
from test_figure_look import assert_clean

import thud
from thud.base.errors import ReportWarning
from thud.base.note import Note
from thud.level.assessment import Criterion, criterion_quantity
from thud.level.estimate import NORMAL_FACTOR, Contribution, Estimate
from thud.level.levels import low_pass
from thud.plot.recording_figures import recording_forces, recording_levels
from thud.recordings.config import Config, read_config
from thud.recordings.instruments import Plate
from thud.recordings.recorded_levels import measure_levels
from thud.recordings.recording import Recording, read_recording
from thud.recordings.words import read_date
from thud.report.contents import (
    REQUIRED,
    ReportCriterion,
    json_bytes,
    missing_keys,
    report_criteria,
    report_data,
)
from thud.report.notes import group_notes
from thud.report.page import BUDGET_HEAD, range_picture, report_page
from thud.report.pdf import html_to_pdf, missing_characters
from thud.report.recording_files import file_names, read_picture, table, write_report
from thud.report.rows import criterion_row, drop_table, excluded_text, freedom_text, risk_text

if TYPE_CHECKING:
    from pathlib import Path

UNKNOWN = Estimate(float("nan"), float("nan"))
LAB = Config(
    laboratory="Prüfstelle Ωmega, Институт акустики",
    ball="Rubber ball µ ± 1 ≤ 2",
    serial="RB-0042",
    temperature=-1.25,
    instruments=("Force plate, no. 1", "Amplifier, no. 2"),
    mass=2.51,
    height=1.0,
)
HOSTILE = '<script>alert("a&b")</script>\u202e\x07\udcff$x^{$'


@pytest.fixture(scope="module")
def one(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """Return a recording of one drop of known mass and height, with noise and an offset."""
    impact = thud.solve()
    force = impact.floor_force[: int(np.flatnonzero(impact.floor_force > 0)[-1]) + 2]
    rate = impact.sample_rate
    recorded, _ = make_recording(force, rate, noise_db=50, offset=12, before=0.05, after=0.05)
    path = tmp_path_factory.mktemp("report") / "drop.csv"
    time = np.arange(len(recorded)) / rate
    np.savetxt(path, np.column_stack([time, recorded]), "%.9g", ",", header="time_s,force_N")
    return read_recording(path, config=LAB)


def many(one: Recording, count: int, **config: Any) -> Recording:  # noqa: ANN401
    """Return a recording of drops that differ by a few percent, an outlier among them."""
    (drop,) = one.drops
    factors = np.resize([1.0, 0.98, 1.01, 1.02, 0.99], count)
    if count > 5:
        factors[5] = 1.4
    drops = [
        replace(
            with_force(drop, factor * drop.force),
            name=f"drop_{i}.csv",
            contact_time=Estimate(drop.contact_time.value + 1e-4 * factor, 1e-5),
        )
        for i, factor in enumerate(factors)
    ]
    origins = [
        replace(one.origins[0], name=drop.name, date=f"2024-05-{3 + i % 2:02}")
        for i, drop in enumerate(drops)
    ]
    return Recording("many", tuple(drops), tuple(origins), replace(LAB, **config), 0.01)


def test_page_says_that_the_background_does_not_count(one: Recording) -> None:
    (drop,) = one.drops
    first, stop = drop.gate
    force = np.full_like(drop.force, 500.0)
    force[first:stop] = drop.force[first:stop]
    assert 0 < first < stop < len(force)
    disturbed = replace(one, drops=(with_force(drop, force),))
    found, expected = (measure_levels(r.drops) for r in (disturbed, one))
    np.testing.assert_array_equal(found.measured, expected.measured)
    # The gate contains the contact, with a margin of less than 3 ms on either side.
    contact_time = drop.contact_time.value
    assert -3e-3 < drop.time[first] < 0
    assert contact_time < drop.time[stop - 1] < contact_time + 3e-3
    text = "from first touch to release, with a margin for their uncertainty; zero outside"
    assert text in words_of(one)


def crowded(one: Recording) -> Recording:
    """Return a recording whose names, lists and sentences are as long as they can be."""
    base = many(one, 500, laboratory="W" * 500, ball="ball " * 100, serial="1 x" * 160,
                instruments=tuple(f"Instrument {i} " + "y" * 300 for i in range(40)))  # fmt: skip
    drops = [
        replace(
            drop,
            name=f"a_long_name_of_a_file_{i}" + "z" * 200,
            notes=tuple(
                Note(code, value=i, others={name: chr(97 + k) + " a long one" * 20, **rest})
                for k in range(20)
                for code, name, rest in (
                    ("drop_left_out", "reason", {"time": i}),
                    ("plate_unknown", "what", {"keys": ""}),
                )
            ),
        )
        for i, drop in enumerate(base.drops)
    ]
    origins = [
        replace(o, name=d.name, calibration="c" * 300, date=f"some day no. {i}")
        for i, (o, d) in enumerate(zip(base.origins, drops, strict=True))
    ]
    return replace(base, drops=tuple(drops), origins=tuple(origins))


def unknown(one: Recording) -> Recording:
    """Return a recording of which nothing is known but the force."""
    drop = replace(one.drops[0], restitution=UNKNOWN, restitutions={})
    return Recording("unknown", (drop,), one.origins)


KINDS = {
    "one": lambda one: one,
    "five": lambda one: many(one, 5),
    "500": lambda one: many(one, 500),
    "crowded": crowded,
    "unknown": unknown,
    "failing": lambda one: many(one, 3, mass=2.8, height=0.9, serial="x" * 500),
}


@pytest.fixture(scope="module")
def weasyprint() -> None:
    """Skip what needs the extra report where it is not installed."""
    pytest.importorskip(
        "weasyprint", reason="the extra report is not installed", exc_type=ImportError
    )


@pytest.fixture(scope="module", params=KINDS)
def written(
    request: pytest.FixtureRequest, one: Recording, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Recording, Path]:
    """Write the report of a recording of each kind."""
    request.getfixturevalue("weasyprint")
    recording = KINDS[request.param](one)
    folder = tmp_path_factory.mktemp("written")
    paths = write_report(recording, folder)
    assert [path.name for path in paths] == file_names()
    return recording, folder


def open_pdf(path: Path) -> Any:  # noqa: ANN401 - of pypdfium2
    pdfium = pytest.importorskip("pypdfium2", reason="pypdfium2 is not installed")
    return pdfium.PdfDocument(path)


def text_of(path: Path) -> str:
    """Return the text of a PDF."""
    texts = (page.get_textpage().get_text_bounded() for page in open_pdf(path))
    return " ".join(" ".join(texts).split())


def print_page(folder: Path) -> Path:
    """Print the HTML as PDF by a browser."""
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        pytest.skip("there is no chromium")
    target = folder / "printed.pdf"
    if target.exists():
        return target
    subprocess.run(
        [
            browser, "--headless", "--no-sandbox", "--disable-gpu", "--no-pdf-header-footer",
            f"--user-data-dir={folder}/browser", f"--print-to-pdf={target}",
            (folder / "report.html").as_uri(),
        ],
        check=True, capture_output=True, timeout=120,
    )  # fmt: skip
    return target


def data_of(recording: Recording) -> dict[str, Any]:
    """Return the content of ``report.json``."""
    data: dict[str, Any] = json.loads(json_bytes(report_data(recording)))
    return data


def test_page_holds_the_rows_of_the_table(written: tuple[Recording, Path]) -> None:
    recording, folder = written
    page = (folder / "report.html").read_text().replace("\N{NO-BREAK SPACE}", " ")
    found = re.findall(r'<tr class="[a-z-]+">(.*?)</tr>', page, re.DOTALL)
    printed = text_of(folder / "report.pdf")
    for row, entry in zip(found, report_criteria(recording), strict=True):
        cells = [html.unescape(re.sub(r"<[^>]*>", "", cell)) for cell in row.split("</td>")]
        expected = [*criterion_row(entry)]
        assert [cell for cell in map(str.strip, cells) if cell] == expected
        assert " ".join(expected) in printed
    for words in (
        recording.assess().conforms, recording.origins[0].checksum, thud.__version__, "signature",
        "place and date", "report.json", "force on the floor", "single drops",
    ):  # fmt: skip
        assert words in printed.lower()


def test_each_page_has_its_number_and_that_of_the_report(written: tuple[Recording, Path]) -> None:
    recording, folder = written
    pages = [page.get_textpage().get_text_bounded() for page in open_pdf(folder / "report.pdf")]
    for i, text in enumerate(pages, 1):
        assert f"page {i} of {len(pages)}" in text
        name = recording.config.serial or recording.name
        assert f"Report of {name[:50]}" in " ".join(text.split())
    assert "end of report" in pages[-1]
    assert "Signature" in pages[-1]
    # Five drops fill two sheets; only crowded recordings need many.
    assert len(pages) <= (2 if len(recording.drops) < 10 else 15)


@pytest.mark.slow
@pytest.mark.usefixtures("weasyprint")
def test_signature_is_on_a_page_with_the_last_notes(one: Recording, tmp_path: Path) -> None:
    data = report_data(many(one, 5))
    figures = [b'<svg viewBox="0 0 9 9"></svg>'] * 2
    counts = set()
    # The end of the notes moves over the end of a page.
    for count in range(14, 24):
        steps = [f"last note {i} " + "of some length " * 4 for i in range(count)]
        path = tmp_path / f"{count}.pdf"
        path.write_bytes(html_to_pdf(report_page(replace(data, processing=steps), figures)))
        pages = [page.get_textpage().get_text_bounded() for page in open_pdf(path)]
        assert "last note" in pages[-1]
        assert "Signature" in pages[-1]
        counts.add(len(pages))
    assert counts == {2, 3}


@pytest.mark.slow
def test_browser_prints_the_same_page(written: tuple[Recording, Path]) -> None:
    _, folder = written
    # The table of budgets repeats its head where it breaks, which engines do at other rows.
    head = "".join(BUDGET_HEAD).replace(" ", "")
    words = [
        re.sub(r"\s", "", text_of(path)).replace(head, "")
        for path in (folder / "report.pdf", print_page(folder))
    ]
    # Figures are laid out letter by letter; the order of their words may differ.
    assert sorted(words[0]) == sorted(words[1])


def test_texts_do_not_overlap_and_stay_on_the_page(written: tuple[Recording, Path]) -> None:
    for page in open_pdf(written[1] / "report.pdf"):
        text = page.get_textpage()
        width, height = page.get_size()
        boxes = [text.get_rect(i) for i in range(text.count_rects())]
        for left, bottom, right, top in boxes:
            assert 20 < left < right < width - 20
            assert 15 < bottom < top < height - 15
        for one, other in itertools.combinations(boxes, 2):
            across = min(one[2], other[2]) - max(one[0], other[0])
            up = min(one[3], other[3]) - max(one[1], other[1])
            # Boxes are those of the letters; descenders may touch the line below.
            assert across < 1 or up < 1.5


def test_page_refers_to_nothing_outside_and_is_small(written: tuple[Recording, Path]) -> None:
    page = (written[1] / "report.html").read_text()
    assert not re.findall("http|@import|<link|<script|url[(]", page)
    assert {*re.findall(r"""\b(?:src|href)\s*=\s*["'](.{5})""", page)} == {"data:"}
    assert len(page.encode()) < 400_000


def test_data_are_those_of_the_recording(written: tuple[Recording, Path]) -> None:
    recording, folder = written

    def refuse(word: str) -> None:
        pytest.fail(f"{word} is no JSON")

    data = json.loads((folder / "report.json").read_text(), parse_constant=refuse)
    verdict = recording.assess()
    assert data["verdict"] == verdict.conforms
    for row, decision in zip(data["criteria"], verdict.criteria, strict=True):
        known = not np.isnan(decision.value)
        assert row["value"] == (decision.value if known else None)
        stated = bool(decision.estimate.contributions)
        assert row["expanded_uncertainty"] == (decision.estimate.expanded if stated else None)
        assert (row["lower"], row["upper"]) == (decision.lower, decision.upper)
        assert row["verdict"] == decision.conforms
        assert row["limits_of_standard"]
    assert len(data["drops"]) == len(recording.drops)
    assert [one["sha256"] for one in data["files"]] == [o.checksum for o in recording.origins]
    np.testing.assert_array_equal(data["levels"]["third"]["level"], recording.levels("third"))


def test_date_is_that_of_the_files(one: Recording) -> None:
    assert data_of(many(one, 3))["date"] == "2024-05-03 to 2024-05-04"
    assert data_of(one)["date"] == ""
    assert data_of(many(one, 3, date="7.6.2024"))["date"] == "2024-06-07"


@pytest.mark.parametrize(
    "text",
    [
        "2024-05-03",
        "2024-05-03T10:11:12.123456Z",
        "03.05.2024 10:11",
        "2024/05/03",
        "03-MAY-24   10:11:12",
    ],
)
def test_dates_of_many_kinds_are_read(text: str) -> None:
    found = read_date(text)
    assert found is not None
    assert found.date().isoformat() == "2024-05-03"
    assert read_date("3/5/24") is None


@pytest.mark.usefixtures("weasyprint")
def test_names_are_no_code(one: Recording, tmp_path: Path) -> None:
    # A configuration refuses characters that no page shows; files may hold them.
    line = "".join(filter(str.isprintable, HOSTILE))
    texts = dict.fromkeys(("laboratory", "ball", "serial"), line)
    recording = many(one, 2, **texts, instruments=(line, line))
    hostile = (Note("plate_unknown", others={"what": HOSTILE, "keys": ""}),)
    drops = tuple(replace(d, name=HOSTILE + d.name, notes=hostile) for d in recording.drops)
    origins = tuple(replace(o, name=HOSTILE, calibration=HOSTILE) for o in recording.origins)
    write_report(replace(recording, drops=drops, origins=origins), tmp_path)
    page = (tmp_path / "report.html").read_text()
    assert "<script" not in page
    script = str(escape('<script>alert("a&b")</script>'))
    assert page.count(script) > 6
    assert f"{script}\ufffd\ufffd\ufffd$x^{{$" in page
    assert '<script>alert("a&b")</script>' in text_of(tmp_path / "report.pdf")
    assert json.loads((tmp_path / "report.json").read_text())["serial"] == line


@pytest.mark.usefixtures("weasyprint")
def test_what_is_not_known_is_said(one: Recording, tmp_path: Path) -> None:
    write_report(unknown(one), tmp_path)
    words = text_of(tmp_path / "report.pdf")
    lines = ("Laboratory", "Ball", "Serial number", "Measured on", "Temperature", "Instruments")
    rows = ("Restitution", "Mass, kg", "Drop height, m")
    for text in (*(f"{n} not known" for n in lines), *(f"{n} not known – " for n in rows)):
        assert text in words
    assert "uncertainty not stated" in words
    assert not re.search(r"\bnan\b|\bNone\b|\binf\b", words)


@pytest.mark.parametrize("library", [None, "raise OSError('no libpango')"])
def test_without_weasyprint_there_is_a_page_and_a_sentence(
    one: Recording,
    tmp_path: Path,
    library: str | None,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    folder = tmp_path / "report"
    if library is None:
        monkeypatch.setitem(sys.modules, "weasyprint", None)
    else:
        # As WeasyPrint itself where a library of Debian is missing.
        (tmp_path / "weasyprint.py").write_text(library)
        for name in [name for name in sys.modules if name.split(".")[0] == "weasyprint"]:
            monkeypatch.delitem(sys.modules, name)
        monkeypatch.syspath_prepend(tmp_path)
    with pytest.warns(ReportWarning, match=naming("report.pdf", "pip install")):
        paths = write_report(one, folder)
    assert [path.name for path in paths] == [name for name in file_names() if name != "report.pdf"]
    assert not capsys.readouterr().out


@pytest.mark.usefixtures("weasyprint")
def test_missing_font_is_told(
    one: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(font_manager, "findSystemFonts", list)
    recording = replace(one, config=replace(LAB, laboratory="建材 lab"))
    with pytest.warns(ReportWarning, match=naming("font", "建材")):
        write_report(recording, tmp_path)
    assert not missing_characters("µ − ± ≤ Ω ° … Институт Ελλάς Šč")
    # Those of any installed font are not missing.
    installed = [font_manager.findfont("DejaVu Sans")]
    monkeypatch.setattr(font_manager, "findSystemFonts", lambda: installed)
    assert missing_characters("a 建") == "建"


@pytest.mark.filterwarnings("ignore::thud.base.errors.ReportWarning")
def test_report_replaces_no_file_of_others(one: Recording, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(TypeError, match=naming("recording", "int")):
        thud.write_report(5, tmp_path)  # type: ignore[arg-type]
    for name in ("a\0b", "a\nb"):
        with pytest.raises(thud.InputError, match="one line"):
            thud.write_report(one, tmp_path / name)
    for also in (False, True):
        with pytest.raises(thud.InputError, match=naming(tmp_path)):
            thud.write_report(one, tmp_path, replace=also)
    assert names_in(tmp_path) == ["notes.txt"]


@pytest.mark.usefixtures("weasyprint")
def test_equal_recordings_give_equal_pages(one: Recording, tmp_path: Path) -> None:
    for name in "ab":
        write_report(one, tmp_path / name)
    for name in ("report.json", "report.html"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


@pytest.mark.parametrize("count", [1, 3, 60])
def test_figures_show_every_drop_the_average_and_the_limits(one: Recording, count: int) -> None:
    recording = many(one, count)
    for bands in ("octave", "third"):
        assert_clean(recording_levels(recording, bands=bands))
    figure = recording_forces(recording)
    assert_clean(figure)
    (axes,) = figure.axes
    drops = [line for line in axes.lines if line.get_linewidth() == 0.5]
    assert len(drops) == (count if count <= 40 else 0)
    if count == 3:
        drop = recording.drops[1]
        recorded = low_pass(drop.force, drop.sample_rate)
        assert np.max(drops[1].get_ydata()) == pytest.approx(1e-3 * recorded.max(), rel=1e-3)
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels[0] == "permitted, 18 to 22 ms"
    assert ("average" in labels) == (count > 1)
    assert ("outlier" in labels) == ("range of 60 drops" in labels) == (count == 60)
    for bands in ("octave", "third"):
        axes = recording_levels(recording, bands=bands).axes[0]
        bars = axes.containers[0]
        np.testing.assert_allclose(bars.lines[0].get_ydata(), recording.levels(bands))
        half = [np.ptp(segment[:, 1]) / 2 for segment in bars.lines[2][0].get_segments()]
        np.testing.assert_allclose(half, [one.expanded for one in recording.level_estimates(bands)])


def test_levels_of_all_bands_have_the_same_contributions(one: Recording) -> None:
    recording = many(one, 5, plate=Plate(f0=1600.0, Q=20.0, f0_uncertainty=0.005))
    for bands in ("octave", "third"):
        names = [part.name for part in recording.level_estimates(bands)[-1].contributions]
        assert names[-4:] == [
            "calibration", "plate", "share of the plate's resonance, assumed",
            "recorder filter, assumed",
        ]  # fmt: skip


STATED = """
laboratory = "Laboratory"
date = 2024-05-03
mass = 2.5
mass_uncertainty = 0.002
height = 1.0
height_uncertainty = 0.003
calibration_uncertainty = 0.005
unit = "N"
[report]
number = "2024-17"
address = ["Street 1", "Town"]
client = ["Client & Co.", "Their town"]
item = "hollow ball"
state = "no cracks"
received = 2024-04-30
issued = "06.05.2024"
place = "Hall 3"
procedure = "P-17, edition 4"
deviations = "four drops only"
humidity = 45.4
pressure = 101325.0
accreditation = "Body, no. 1"
accreditation_mark = "mark.svg"
authorized_by = "E. Muster"
[properties]
diameter = 0.1803
wall_thickness = 0.0301
hardness = "41 Shore A"
surface = "clean"
temperature = 20.8
[[instruments]]
name = "Force plate"
serial = "123"
certificate = "K-1"
calibrated = 2024-01-10
due = 2025-01-10
[[instruments]]
name = "Amplifier"
due = 2024-05-02
"""
MARK = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9"><path d="M0 0h9v9z"/></svg>'


def stated(one: Recording, folder: Path, text: str = STATED) -> Recording:
    """Return a recording with everything that a laboratory can state."""
    (folder / "mark.svg").write_text(MARK)
    (folder / "lab.toml").write_text(text)
    return replace(many(one, 5), config=read_config(folder / "lab.toml"))


def words_of(recording: Recording) -> str:
    """Return the text of the page of a recording."""
    page = report_page(report_data(recording))
    text = re.sub(r"<style>.*?</style>|<svg.*?</svg>|<[^>]*>", " ", page, flags=re.DOTALL)
    return " ".join(html.unescape(text).split())


def test_page_states_what_the_laboratory_states(one: Recording, tmp_path: Path) -> None:
    recording = stated(one, tmp_path)
    data = report_data(recording)
    page = report_page(data, [], read_picture(tmp_path / "mark.svg"))
    words = words_of(recording)
    for text in (
        "Calibration report 2024-17", "Address Street 1 Town", "Client Client & Co. Their town",
        "Item hollow ball", "State of the item no cracks", "Received on 2024-04-30",
        "Measured on 2024-05-03", "Issued on 2024-05-06", "Place Hall 3",
        "Procedure P-17, edition 4", "Deviations four drops only", "Humidity 45 %",
        "Air pressure 1013 hPa", "Accreditation Body, no. 1",
        "Force plate, no. 123, certificate K-1 of 2024-01-10, due 2025-01-10",
        "diameter 180.3 mm (standards: 180 mm as an example, no tolerance)",
        "wall thickness 30.1 mm (standards: 30 mm as an example, no tolerance)",
        "hardness 41 Shore A", "surface clean", "temperature 20.8 °C",
        "Hall 3, 2024-05-06 Place and date E. Muster Authorized by Signature",
        "The results relate only to the item tested.",
        "Amplifier: its calibration was due on 2024-05-02, before the measurement",
    ):  # fmt: skip
        assert text in words, text
    (image,) = re.findall(r'<img[^>]*src="data:image/svg\+xml;base64,([^"]*)"', page)
    assert base64.b64decode(image).decode() == MARK
    assert r'content: "Report 2024\2d 17"' in page
    content = json_bytes(data).decode()
    assert json.loads(content)["report"]["accreditation_mark"] == "mark.svg"
    assert str(tmp_path) not in content


def test_what_iso_17025_asks_for_and_is_not_stated_is_listed(
    one: Recording, tmp_path: Path
) -> None:
    recording = stated(one, tmp_path)
    missing = missing_keys(recording.config, recording.origins)
    assert missing == [
        "ball", "serial", "traceability", "temperature", "instruments: certificate",
    ]  # fmt: skip
    text = STATED.replace("procedure =", 'traceability = "to the SI by K-1"\nprocedure =')
    traceable = stated(one, tmp_path, text)
    missing.remove("traceability")
    assert missing_keys(traceable.config, traceable.origins) == missing
    assert "Traceability to the SI by K-1" in words_of(traceable)
    nothing = missing_keys(Config(), one.origins)
    assert nothing == [*REQUIRED, "instruments"]
    # The files have dates.
    assert "date" not in missing_keys(Config(), many(one, 2).origins)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("2024-04-30", '"soon"', naming("report: received", "'soon'", "2024-05-03")),
        ("humidity = 45.4", "humidity = 145", naming("report: humidity", "145", "100")),
        ("humidity = 45.4", "humidity = 0.454", naming("report: humidity", "0.454", "1 to 100")),
        ("pressure = 101325.0", "pressure = 1013", naming("report: pressure", "1013", "50000")),
        ("number =", "nummer =", naming("report", "'nummer'", "number")),
        ("certificate =", "zertifikat =", naming("instruments", "'zertifikat'", "certificate")),
        ("diameter = 0.1803", "diameter = 180.3", naming("properties: diameter", "180.3")),
    ],
)
def test_wrong_fields_of_the_report_are_refused(
    one: Recording, tmp_path: Path, old: str, new: str, words: str
) -> None:
    with pytest.raises(thud.InputError, match=words):
        stated(one, tmp_path, STATED.replace(old, new))


@pytest.mark.parametrize(
    ("mark", "words"), [("none.svg", (".svg", ".png", "300 kB")), ("lab.toml", ("no picture",))]
)
def test_marks_that_are_no_pictures_are_refused(
    one: Recording, tmp_path: Path, mark: str, words: tuple[str, ...]
) -> None:
    recording = stated(one, tmp_path, STATED.replace("mark.svg", mark))
    with pytest.raises(thud.InputError, match=naming("accreditation_mark", mark, *words)):
        write_report(recording, tmp_path / "report")


def test_budgets_combine_to_the_uncertainty(one: Recording, tmp_path: Path) -> None:
    recording = stated(one, tmp_path)
    data = data_of(recording)
    words = words_of(recording)
    for entry in data["criteria"]:
        parts = [part for part in entry["contributions"] if part["counted"]]
        if not entry["uncertainty"]:
            continue
        combined = np.sqrt(sum(part["uncertainty"] ** 2 for part in parts))
        assert combined == pytest.approx(entry["uncertainty"])
        for part in entry["contributions"]:
            # Size, divisor and sensitivity give the contribution again.
            size = part["uncertainty"] * part["divisor"] if part["size"] is None else part["size"]
            product = size / part["divisor"] * part["sensitivity"]
            assert product == pytest.approx(part["uncertainty"])
    (level,) = [entry for entry in data["criteria"] if entry["name"] == "octave_31_5"]
    parts = {part["name"]: part for part in level["contributions"]}
    assert [parts[name]["kind"] for name in ("repeatability", "noise", "calibration")] == [
        "A", "A", "B"
    ]  # fmt: skip
    assert parts["repeatability"]["divisor"] == pytest.approx(np.sqrt(5))
    assert parts["calibration"]["size"] == 0.01
    # One percent of the force is 20 lg(e)/100 dB.
    assert parts["calibration"]["sensitivity"] == pytest.approx(20 / np.log(10))
    share = 100 * (parts["calibration"]["uncertainty"] / level["uncertainty"]) ** 2
    assert f"calibration B 0.010 1 8.7 dB 0.087 dB ∞ {share:.1f} %" in words
    k = level["coverage_factor"]
    assert f"degrees of freedom {level['freedom']:.4g}; k = {k:.2f}" in words
    (mass,) = [entry for entry in data["criteria"] if entry["name"] == "mass"]
    assert mass["contributions"][0]["uncertainty"] == 0.002
    assert "Mass: 2.5000 ± 0.0039 kg; u = 0.0020 kg; degrees of freedom ∞; k = 1.96" in words


def test_degrees_of_freedom_and_risks_are_bounds_where_they_round() -> None:
    for freedom in (1.0, 1.2345, 1.9876, 2.71828, 4.0, 8.4999, 17.777, 234.56):
        k = stdtrit(freedom, 0.975)
        assert stdtrit(float(freedom_text(freedom)), 0.975) == pytest.approx(k, abs=0.01)
    assert (freedom_text(2000.0), freedom_text(np.inf)) == ("> 1000", "∞")
    assert [risk_text(p) for p in (0.0, 4e-4, 6e-4)] == ["> 99.9 %", "> 99.9 %", "99.9 %"]


def excluded(recording: Recording) -> dict[str, list[str]]:
    """Return what the uncertainties exclude, by criterion."""
    return {entry["name"]: entry["excluded"] for entry in data_of(recording)["criteria"]}


SCATTER = "scatter between drops"


def test_uncertainties_that_lack_contributions_are_marked(one: Recording) -> None:
    # Of one drop nothing is stated, and the scatter is unknown.
    lacking = excluded(one)
    assert lacking["octave_63"] == ["calibration", SCATTER]
    assert lacking["contact_time"] == [SCATTER]
    assert lacking["restitution"] == ["calibration", "mass", "drop height", SCATTER]
    assert lacking["mass"] == ["mass"]
    assert lacking["drop_height"] == ["drop height"]
    assert lacking["peak_count"] == []
    note = excluded_text(report_criteria(one))
    assert note.startswith(
        "† U excludes calibration, mass, drop height (uncertainty not stated: undecided); scatter "
        "between drops (unknown from one drop). Stated standard uncertainties that decide:"
    )
    assert note in words_of(one)
    assert "U is incomplete where it is marked †" in words_of(one)
    marked = [row[0] for row in table(report_criteria(one))[1:] if row[2].endswith(" †")]
    assert len(marked) == 9
    assert "Force peaks" not in marked


def test_complete_uncertainties_are_not_marked(one: Recording, tmp_path: Path) -> None:
    recording = stated(one, tmp_path)
    assert not any(excluded(recording).values())
    assert excluded_text(report_criteria(recording)) == ""
    assert "†" not in report_page(report_data(recording))
    # An effective mass has the uncertainties of its origins.
    effective = replace(many(one, 1), config=replace(LAB, mass=None), calibration_uncertainty=None)
    assert set(excluded(effective)["mass"]) <= {"calibration", "drop height", SCATTER}
    plate = Plate(f0=1600.0, Q=20.0)
    assert excluded(many(one, 5, plate=plate))["octave_500"] == ["resonance of the plate"]


def test_rectangular_distributions_have_their_half_width_and_divisor() -> None:
    folder = REPOSITORY / "inputs/recordings"
    drops = read_recording(folder / "three_drops.flac", config=read_config(folder / "lab.toml"))
    (entry,) = [e for e in data_of(drops)["criteria"] if e["name"] == "restitution"]
    parts = {part["name"]: part for part in entry["contributions"]}
    for name, size, unit in (("slow release", 5e-4, "s"), ("deformed ball", 4e-3, "m")):
        part = parts[name]
        assert (part["size"], part["unit"]) == (size, unit)
        assert part["divisor"] == pytest.approx(np.sqrt(3))
        product = part["size"] / part["divisor"] * part["sensitivity"]
        assert product == pytest.approx(part["uncertainty"])


@pytest.mark.parametrize(
    ("config", "words"),
    [
        # The index of L_FE is in an element of its own.
        (LAB, ("Verdict Force exposure level L FE , dB re 1 N, 1 s 31.5 Hz, dB",
               "the repeatability in the budgets is that of the mean energy",
               "guard bands w = U (ILAC-G8:09/2019", "JCGM 106:2012", "JIS A 1418-2:2019",
               "ISO 10140-5:2021 (table F.1)", "ISO 16283-2:2020", "published transcription",
               "more than 10 % of its greatest value", "probability of a false acceptance",
               "1 outlier (Grubbs, 5 %), marked but not excluded")),
        (replace(LAB, plate=Plate(full_scale=6000.0)), ("the plate reads up to 6000 N",)),
    ],
)  # fmt: skip
def test_page_names_measurand_rules_standards_plate_and_outliers(
    one: Recording, config: Config, words: tuple[str, ...]
) -> None:
    recording = replace(many(one, 60), config=config)
    assert recording.outliers
    page = words_of(recording)
    assert not [text for text in (*words, *map(str, recording.outliers)) if text not in page]


def criterion(
    value: float,
    expanded: float,
    name: str = "octave_63",
    limits: tuple[float, float] = (29.5, 90.0),
    **stated: Any,  # noqa: ANN401
) -> Criterion:
    """Return a criterion with an expanded uncertainty, whose budget has one contribution."""
    standard = expanded / NORMAL_FACTOR
    budget = {"contributions": (Contribution("noise", standard),), **stated}
    unit = criterion_quantity(name).unit
    return Criterion(name, Estimate(value, standard, unit, **budget), *limits)


@pytest.mark.parametrize(
    ("entry", "column", "text"),
    [
        # Value and margin have the digits of the uncertainty.
        (criterion(38.8104, 0.08637), slice(None), ("63 Hz, dB", "38.810", "0.086", "29.5 to 90",
         "9.310", "< 0.01 %", "0.12", "−3.46", "conforms")),
        (criterion(28.26544, 0.08637), 4, "−1.235"),
        (criterion(38.8104, 0.0996), slice(1, 3), ("38.81", "0.10")),
        (criterion(38.8104, 0.00996), slice(1, 3), ("38.810", "0.010")),
        (criterion(38.8104, 1.234), slice(1, 3), ("38.8", "1.2")),
        (criterion(138.4, 12.34), slice(1, 3), ("138", "12")),
        (criterion(1384.0, 123.4), slice(1, 3), ("1380", "120")),
        (criterion(38.8104, 0.0), slice(1, 3), ("38.81", "0")),
        (criterion(-0.0004, 0.12), slice(1, 3), ("0.00", "0.12")),
        (criterion(np.nan, 0.1), slice(1, 3), ("not known", "–")),
        (criterion(38.8104, 0.08637, upper_bound=True), 1, "at most 38.810"),
        (criterion(38.8104, 0.08637, upper_bound=True), 4, "–"),
        (criterion(38.8104, 0.08637, contributions=()), 2, "not stated"),
        (criterion(38.8104, 0.08637, contributions=()), 5, "–"),
        (criterion(1.0, 0.0, "peak_count", (1.0, 1.0)), slice(2, 5), ("–", "1", "–")),
        (criterion(0.01934, 1.1e-4, "contact_time"), slice(3),
         ("Contact time, ms", "19.34", "0.11")),
    ],
)  # fmt: skip
def test_criterion_is_a_row_of_text(
    entry: Criterion, column: int | slice, text: str | tuple[str, ...]
) -> None:
    row = criterion_row(ReportCriterion(entry, 0.1234, -3.456, "", (), has_own_limits=False))
    assert row[column] == text
    own = ReportCriterion(entry, np.nan, np.nan, "", ("mass",), has_own_limits=True)
    marked = criterion_row(own)
    assert marked[2:4] == (f"{row[2]} †", f"{row[3]} *")
    assert marked[6:8] == ("–", "–")


def test_report_lists_single_drops_and_units_stay_with_numbers(one: Recording) -> None:
    recording = many(one, 3)
    data = report_data(recording)
    head, *rows = drop_table(recording)
    levels = recording.average().drops.level
    assert [row[0] for row in rows] == [drop.name for drop in recording.drops]
    for row, drop, own in zip(rows, recording.drops, levels, strict=True):
        assert row[-5:] == tuple(f"{level:.2f}" for level in own)
        assert row[-6] == f"{drop.peak_force.value:.0f}"
        assert float(row[2].split()[0]) == pytest.approx(1e3 * drop.contact_time.value, abs=6e-3)
    words = words_of(recording)
    assert " ".join(head) in words
    assert " ".join(rows[1]) in words
    page = re.sub(r"<style>.*?</style>", "", report_page(data), flags=re.DOTALL)
    assert re.findall(r"\d (?:dB|Hz|N|ms|kHz|m|kg|%|°C)\b", page) == []


def test_warnings_and_drops_left_out_stand_before_the_table(one: Recording) -> None:
    note = Note("drop_left_out", value=2, others={"time": 1.0, "reason": "touched the rim"})
    overdue = Note("calibration_overdue", "amplifier", others={"due": "2020-01-01"})
    origin = replace(one.origins[0], notes=(note, overdue))
    words = words_of(replace(one, origins=(origin,)))
    before, _, after = words.partition("Criterion Value")
    assert "left out: drop 2 at 1.00 s, touched the rim" in before
    assert "its calibration was due on 2020-01-01" in before
    assert "left out" not in after


def test_contributions_of_nothing_are_no_rows_of_a_budget(one: Recording, tmp_path: Path) -> None:
    recording = stated(one, tmp_path)
    shares = re.findall(r'data-label="Share">([^<]*)<', report_page(report_data(recording)))
    assert shares
    assert "0.0\N{NO-BREAK SPACE}%" not in shares
    level = report_criteria(recording)[0].criterion.estimate
    sizes = [part.uncertainty / level.uncertainty for part in level.contributions]
    assert any(0 < size < 0.01 for size in sizes)


@pytest.mark.slow
def test_budgets_scroll_inside_a_narrow_page(one: Recording, tmp_path: Path) -> None:
    html = report_page(report_data(stated(one, tmp_path)))
    with open_in_browser(tmp_path / "report.html", html) as page:
        for width in (390, 1000):
            assert_scrolls_inside(page, page.locator(".budget"), width)


def test_notes_that_differ_in_numbers_are_one_sentence(one: Recording) -> None:
    first, second, third = many(one, 3).drops
    hum = [Note("hum_removed", value=x, unit="N", others={"frequency": 50.0}) for x in (12, -3.5)]
    drops = [
        replace(first, notes=(hum[0], Note("peaks_unknown"))),
        replace(second, notes=(hum[1], Note("offset_removed", value=4.0, unit="N"))),
        replace(third, notes=()),
    ]
    assert group_notes(drops, "drops", lambda note: not note.is_warning) == [
        "hum of 50 Hz, amplitude -3.5 to 12 N, was removed (2 of 3 drops)",
        f"an offset of 4 N was removed ({second.name})",
    ]
    assert len(group_notes(drops, "drops", lambda note: note.is_warning)) == 1


def test_drops_that_were_left_out_are_listed(one: Recording) -> None:
    notes = tuple(
        Note("drop_left_out", value=i, others={"time": i / 2, "reason": "touched"})
        for i in (2, 5, 6, 7)
    )
    origin = replace(one.origins[0], notes=notes)
    (text,) = group_notes([origin], "files", lambda _: True)
    assert text == "left out: drop 2, 5 to 7 at 1.00 to 3.50 s, touched"


@pytest.mark.parametrize(
    ("value", "expanded", "picture"),
    [
        # The limits lie at 25 and 75 of 100.
        (15.0, 2.0, (50.0, 40.0, 60.0, 0)),
        (20.0, 6.0, (75.0, 45.0, 99.0, 0)),
        (12.0, np.nan, (35.0, 35.0, 35.0, 0)),
        (1.0, 1.0, (2.0, 1.0, 1.0, -1)),
        (30.0, 1.0, (98.0, 99.0, 99.0, 1)),
        (np.nan, 1.0, None),
    ],
)
def test_picture_of_a_criterion_has_value_and_uncertainty_between_the_limits(
    value: float, expanded: float, picture: tuple[float, ...] | None
) -> None:
    entry = criterion(value, expanded, limits=(10.0, 20.0))
    found = range_picture(ReportCriterion(entry, 0.0, 0.0, "", (), has_own_limits=False))
    assert found == (picture and pytest.approx(picture))
