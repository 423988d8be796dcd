"""The calibration report: all numbers of the table, any names, any number of drops."""

from __future__ import annotations

import base64
import html
import itertools
import json
import re
import sys
import textwrap
from dataclasses import fields, replace
from html.parser import HTMLParser
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from conftest import REPOSITORY, naming
from hypothesis import given, settings, strategies as st
from matplotlib import font_manager
from scipy.special import stdtrit
from synthetic import make_recording, with_force
from test_comparison_page import assert_scrolls_inside, open_in
from test_figure_look import assert_clean

import thud
from thud.base.errors import ReportWarning
from thud.base.note import Note
from thud.level.assessment import Criterion, criterion_quantity
from thud.level.estimate import NORMAL_FACTOR, Contribution, Estimate
from thud.level.levels import low_pass
from thud.plot.recording_figures import recording_forces, recording_levels
from thud.plot.templates import plain
from thud.recordings.config import Config, Instrument, Properties, ReportConfig, read_config
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
from thud.report.page import range_picture, report_page
from thud.report.pdf import html_to_pdf, missing_characters
from thud.report.recording_files import file_names, read_picture, verdict_text, write_report
from thud.report.rows import criterion_row, drop_table, freedom_text, risk_text

if TYPE_CHECKING:
    from collections.abc import Callable

    from playwright.sync_api import Browser

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
MARK = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9"><path d="M0 0h9v9z"/></svg>'


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


def test_background_does_not_count(one: Recording) -> None:
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


@pytest.fixture(scope="module")
def laboratory(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """Return the recording of the laboratory of the repository, with all that it can state."""
    mark = tmp_path_factory.mktemp("laboratory") / "mark.svg"
    mark.write_text(MARK)
    folder = REPOSITORY / "inputs/recordings"
    config = read_config(folder / "lab.toml")
    report = replace(
        config.report, address=("Street 1", "Town"), state="no cracks", place="Hall 3",
        traceability="to the SI by K-1", deviations="three drops only", accreditation="Body, no. 1",
        accreditation_mark=str(mark), authorized_by="E. Muster",
    )  # fmt: skip
    properties = replace(
        config.properties, wall_thickness=0.0301, hardness="41 Shore A", surface="clean",
        temperature=20.8,
    )  # fmt: skip
    instruments = (
        Instrument("Force plate", "123", "K-1", calibrated="2026-01-02", due="2027-01-02"),
        Instrument("Amplifier", due="2026-01-05"),
    )
    stated = {"report": report, "properties": properties, "instruments": instruments}
    stated["limits"] = {"octave_500": (10.0, 14.5)}
    return read_recording(folder / "three_drops.flac", config=replace(config, **stated))


def noted(parts: tuple[Any, ...], *notes: tuple[Note, ...]) -> tuple[Any, ...]:
    """Return drops or files with notes of the first of them."""
    return (*map(lambda part, own: replace(part, notes=own), parts, notes), *parts[len(notes) :])


def sixty_drops(one: Recording) -> Recording:
    """Return a recording of heavy drops with an outlier, notes and a plate, and files left out."""
    base = many(one, 60, mass=2.8, height=0.9, plate=Plate(f0=1600.0, Q=20.0, full_scale=6000.0))
    hum = [Note("hum_removed", value=x, unit="N", others={"frequency": 50.0}) for x in (12, -3.5)]
    offset = Note("offset_removed", value=4.0, unit="N")
    left_out = tuple(
        Note("drop_left_out", value=i, others={"time": i / 2, "reason": "touched the rim"})
        for i in (2, 5, 6, 7)
    )
    overdue = Note("calibration_overdue", "amplifier", others={"due": "2020-01-01"})
    drops = noted(base.drops, (hum[0], Note("peaks_unknown")), (hum[1], offset), ())
    return replace(base, drops=drops, origins=noted(base.origins, (*left_out, overdue)))


# Keys that are dates, or a file.
NO_TEXTS = {"date", "received", "issued", "calibrated", "due", "accreditation_mark"}
MARKUP = ["</", "<", ">", '"', "'", "&lt;", "script", "style", "{{", "}}", "{%", "-->", "\\"]


def filled(kind: type, text: str) -> Any:  # noqa: ANN401 - of the kind
    """Return what a laboratory states, with a text in every key that takes one."""
    kinds = {"str": text, "tuple[str, ...]": (text, text)}
    texts = [f for f in fields(kind) if f.type in kinds and f.name not in NO_TEXTS]
    keys = {f.name: kinds[f.type] for f in texts}
    return kind(**keys)


def hostile(one: Recording, text: str = HOSTILE) -> Recording:
    """Return a recording with a text wherever a user can state one."""
    # A configuration refuses characters that no page shows; files may hold them.
    line = "".join(filter(str.isprintable, text)).strip() or "x"
    parts = {"report": filled(ReportConfig, line), "properties": filled(Properties, line)}
    config = replace(filled(Config, line), instruments=(filled(Instrument, line),) * 2, **parts)
    notes = (Note("plate_unknown", text, others={"what": text, "keys": text}),)
    (drop,), (origin,) = one.drops, one.origins
    drops = (replace(drop, name=text, notes=notes, restitutions={text: drop.restitution}),)
    origins = (replace(origin, name=text, calibration=text, date=text, notes=notes),)
    return Recording(text, drops, origins, config)


def crowded(one: Recording) -> Recording:
    """Return a recording whose names, lists and sentences are as long as they can be."""
    base = many(one, 65, laboratory="W" * 500, ball="ball " * 100, serial="1 x" * 160,
                instruments=tuple(f"Instrument {i} " + "y" * 300 for i in range(12)))  # fmt: skip
    notes = tuple(
        Note(code, value=k, others={name: chr(97 + k) + " a long one" * 20, **rest})
        for k in range(20)
        for code, name, rest in (
            ("drop_left_out", "reason", {"time": k}),
            ("plate_unknown", "what", {"keys": ""}),
        )
    )
    drops = [
        replace(drop, name=f"a_long_name_of_a_file_{i}" + "z" * 200, notes=notes)
        for i, drop in enumerate(base.drops)
    ]
    origins = [
        replace(o, name=d.name, calibration="c" * 300, date=f"some day no. {i}")
        for i, (o, d) in enumerate(zip(base.origins, drops, strict=True))
    ]
    return replace(base, drops=tuple(drops), origins=tuple(origins))


def one_drop(one: Recording) -> Recording:
    """Return a recording of which nothing is known but the force."""
    drop = replace(one.drops[0], restitution=UNKNOWN, restitutions={})
    return Recording("one", (drop,), one.origins)


@pytest.fixture(scope="module")
def recordings(one: Recording, laboratory: Recording) -> dict[str, Recording]:
    makers = (one_drop, sixty_drops, hostile, crowded)
    return {"laboratory": laboratory, **{make.__name__: make(one) for make in makers}}


def three_digits(number: re.Match[str]) -> str:
    """Return a number whose digits behind the third are zeros, on which platforms may differ."""
    return f"{float(f'{float(number[0]):.3g}'):.{len(number[1])}f}"


def words_of(page: str) -> str:
    """Return the text of a page, a line for each paragraph and row, numbers to three digits."""
    page = re.sub("<style>.*?</style>|<svg.*?</svg>", "", " ".join(page.split()))
    page = re.sub("<br>|</(?:h[1-6]|li|p|title|tr)>", "\n", re.sub("</t[dh]>", "|", page))
    text = html.unescape(re.sub("<[^>]*>", " ", page)).replace(thud.__version__, "VERSION")
    text = re.sub(r"\b[0-9a-f]{64}\b", "CHECKSUM", text)
    text = re.sub(r"\d+\.(\d+)", three_digits, text)
    lines = (" ".join(line.split()).rstrip("| ") for line in text.split("\n"))
    return "\n".join(textwrap.fill(line, 100, subsequent_indent="  ") for line in lines if line)


@pytest.mark.parametrize("kind", ["one_drop", "laboratory", "sixty_drops", "hostile"])
def test_page_is_approved(
    kind: str, recordings: dict[str, Recording], approved: Callable[[str, str], None]
) -> None:
    data = report_data(recordings[kind])
    page = report_page(data)
    # With equal digests, which the approved text leaves out.
    assert report_page(report_data(recordings[kind])) == page
    approved(f"report_{kind}.txt", f"{verdict_text(data)}\n{words_of(page)}")
    text = re.sub("<style>.*?</style>", "", page, flags=re.DOTALL)
    assert not re.search(r"\b(?:nan|None|inf)\b", text)
    # Units stay with their numbers.
    assert not re.findall(r"\d (?:dB|Hz|N|ms|kHz|m|kg|%|°C)\b", text)


class Skeleton(HTMLParser):
    """The tags of a page, with the names of their attributes, but breaks of lines."""

    def __init__(self, page: str) -> None:
        """Read a page."""
        super().__init__()
        self.tags: list[tuple[str, ...]] = []
        self.feed(page)
        style = page.partition("<style>")[2].partition("</style>")[0]
        # A string of CSS has letters, digits, blanks and escapes.
        self.style = re.sub(r'"Report (?:[A-Za-z0-9 ]|\\[0-9a-f]+ )*"', "", style)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Keep a tag."""
        self.tags += [(tag, *(name for name, _ in attrs))] * (tag != "br")

    def handle_endtag(self, tag: str) -> None:
        """Keep the end of an element."""
        self.tags += [(f"/{tag}",)]


@pytest.fixture(scope="module")
def harmless(one: Recording) -> Skeleton:
    return Skeleton(report_page(report_data(hostile(one, "x"))))


@settings(max_examples=20, deadline=None)
@given(text=st.lists(st.sampled_from(MARKUP) | st.characters(), max_size=12).map("".join))
def test_no_text_is_markup(one: Recording, harmless: Skeleton, text: str) -> None:
    data = report_data(hostile(one, text))
    page = Skeleton(report_page(data))
    assert (page.tags, page.style) == (harmless.tags, harmless.style)
    assert json.loads(json_bytes(data))["name"] == text


@pytest.fixture(scope="module")
def weasyprint() -> None:
    pytest.importorskip(
        "weasyprint", reason="the extra report is not installed", exc_type=ImportError
    )


@pytest.fixture(scope="module", params=["one_drop", "laboratory", "hostile", "crowded"])
def written(
    request: pytest.FixtureRequest,
    recordings: dict[str, Recording],
    weasyprint: None,  # noqa: ARG001
    tmp_path_factory: pytest.TempPathFactory,
) -> tuple[Recording, Path]:
    recording = recordings[request.param]
    folder = tmp_path_factory.mktemp("written")
    paths = write_report(recording, folder)
    assert [path.name for path in paths] == file_names()
    return recording, folder


def open_pdf(path: Path) -> Any:  # noqa: ANN401 - of pypdfium2
    pdfium = pytest.importorskip("pypdfium2", reason="pypdfium2 is not installed")
    return pdfium.PdfDocument(path)


def data_of(recording: Recording) -> dict[str, Any]:
    data: dict[str, Any] = json.loads(json_bytes(report_data(recording)))
    return data


def test_pdf_holds_the_table_and_numbers_its_pages(written: tuple[Recording, Path]) -> None:
    recording, folder = written
    pages = [page.get_textpage().get_text_bounded() for page in open_pdf(folder / "report.pdf")]
    printed = " ".join(" ".join(pages).split())
    rows = [" ".join(criterion_row(entry)) for entry in report_criteria(recording)]
    for text in (*rows, recording.origins[0].checksum, thud.__version__, "Force on the floor"):
        assert text in printed
    for i, text in enumerate(pages, 1):
        assert f"page {i} of {len(pages)}" in text
        name = plain(recording.config.serial or recording.name)
        number = recording.config.report.number or f"of {name[:50]}"
        assert f"Report {number}" in " ".join(text.split())
    assert "end of report" in pages[-1]
    assert "Signature" in pages[-1]
    # Two drops fill two sheets; only crowded recordings need many.
    assert len(pages) <= min(max(2, len(recording.drops)), 15)


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
        assert row["limits_of_standard"] == (decision.name not in recording.config.limits)
    assert len(data["drops"]) == len(recording.drops)
    assert [one["sha256"] for one in data["files"]] == [o.checksum for o in recording.origins]
    np.testing.assert_array_equal(data["levels"]["third"]["level"], recording.levels("third"))
    for estimate, uncertainty in zip(
        recording.level_estimates("third"), data["levels"]["third"]["uncertainty"], strict=True
    ):
        parts = [part.uncertainty for part in estimate.contributions if part.counted]
        assert uncertainty == pytest.approx(np.hypot.reduce(parts))
        names = {part.name for part in estimate.contributions}
        assert ("noise" in names, "repeatability" in names) == (True, len(recording.drops) > 1)


def test_dates_of_many_kinds_are_read() -> None:
    assert read_date("3/5/24") is None
    for text in (
        "2024-05-03", "2024-05-03T10:11:12.123456Z", "03.05.2024 10:11", "2024/05/03",
        "03-MAY-24   10:11:12",
    ):  # fmt: skip
        found = read_date(text)
        assert found is not None, text
        assert found.date().isoformat() == "2024-05-03"


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
def test_absent_font_warns(one: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(font_manager, "findSystemFonts", list)
    recording = replace(one, config=replace(LAB, laboratory="建材 lab"))
    with pytest.warns(ReportWarning, match=naming("font", "建材")):
        write_report(recording, tmp_path)
    assert not missing_characters("µ − ± ≤ Ω ° … Институт Ελλάς Šč")
    # Those of any installed font are not missing.
    installed = [font_manager.findfont("DejaVu Sans")]
    monkeypatch.setattr(font_manager, "findSystemFonts", lambda: installed)
    assert missing_characters("a 建") == "建"


@pytest.mark.parametrize("count", [1, 3, 60])
def test_figures_show_every_drop_the_average_and_the_limits(one: Recording, count: int) -> None:
    recording = many(one, count)
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
        levels = recording_levels(recording, bands=bands)
        assert_clean(levels)
        bars = levels.axes[0].containers[0]
        np.testing.assert_allclose(bars.lines[0].get_ydata(), recording.levels(bands))
        half = [np.ptp(segment[:, 1]) / 2 for segment in bars.lines[2][0].get_segments()]
        np.testing.assert_allclose(half, [one.expanded for one in recording.level_estimates(bands)])


def test_mark_is_in_the_page_and_its_path_nowhere(laboratory: Recording) -> None:
    data, path = report_data(laboratory), Path(laboratory.config.report.accreditation_mark)
    page = report_page(data, [], read_picture(path))
    (image,) = re.findall(r'<img[^>]*src="data:image/svg\+xml;base64,([^"]*)"', page)
    assert base64.b64decode(image).decode() == MARK
    assert str(path.parent) not in page + json_bytes(data).decode()


def test_missing_keys_of_iso_17025_are_listed(one: Recording, laboratory: Recording) -> None:
    config, origins = laboratory.config, laboratory.origins
    assert missing_keys(config, origins) == ["instruments: certificate"]
    for key in ("traceability", "place"):
        lacking = replace(config, report=replace(config.report, **{key: ""}))
        assert missing_keys(lacking, origins) == [key, "instruments: certificate"]
    assert missing_keys(Config(), one.origins) == [*REQUIRED, "instruments"]
    # The files have dates.
    assert "date" not in missing_keys(Config(), many(one, 2).origins)


def test_budgets_combine_to_the_uncertainty(laboratory: Recording) -> None:
    criteria = {entry["name"]: entry for entry in data_of(laboratory)["criteria"]}
    for entry in filter(lambda entry: entry["uncertainty"], criteria.values()):
        parts = [part for part in entry["contributions"] if part["counted"]]
        combined = np.sqrt(sum(part["uncertainty"] ** 2 for part in parts))
        assert combined == pytest.approx(entry["uncertainty"])
        for part in entry["contributions"]:
            # Size, divisor and sensitivity give the contribution again.
            size = part["uncertainty"] * part["divisor"] if part["size"] is None else part["size"]
            product = size / part["divisor"] * part["sensitivity"]
            assert product == pytest.approx(part["uncertainty"])
    level = criteria["octave_31_5"]
    parts = {part["name"]: part for part in level["contributions"]}
    kinds = [parts[name]["kind"] for name in ("repeatability", "noise", "calibration")]
    assert kinds == ["A", "A", "B"]
    assert parts["repeatability"]["divisor"] == pytest.approx(np.sqrt(3))
    assert parts["calibration"]["size"] == 0.005
    # One percent of the force is 20 lg(e)/100 dB.
    assert parts["calibration"]["sensitivity"] == pytest.approx(20 / np.log(10))
    assert criteria["mass"]["contributions"][0]["uncertainty"] == 0.002
    # Rectangular distributions have their half width.
    parts = {part["name"]: part for part in criteria["restitution"]["contributions"]}
    for name, size, unit in (("slow release", 5e-4, "s"), ("deformed ball", 4e-3, "m")):
        assert (parts[name]["size"], parts[name]["unit"]) == (size, unit)
        assert parts[name]["divisor"] == pytest.approx(np.sqrt(3))


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


def test_uncertainties_that_lack_parts_are_marked(one: Recording, laboratory: Recording) -> None:
    # Of one drop nothing is stated, and the scatter is unknown.
    lacking = excluded(one)
    assert {name: lacking[name] for name in lacking if "octave" not in name} == {
        "contact_time": [SCATTER], "mass": ["mass"], "drop_height": ["drop height"],
        "restitution": ["calibration", "mass", "drop height", SCATTER], "peak_count": [],
    }  # fmt: skip
    assert lacking["octave_63"] == ["calibration", SCATTER]
    assert not any(excluded(laboratory).values())
    # An effective mass has the uncertainties of its origins.
    effective = replace(many(one, 1), config=replace(LAB, mass=None), calibration_uncertainty=None)
    assert set(excluded(effective)["mass"]) <= {"calibration", "drop height", SCATTER}
    plate = Plate(f0=1600.0, Q=20.0)
    assert excluded(many(one, 5, plate=plate))["octave_500"] == ["resonance of the plate"]


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


def test_criteria_are_rows_of_text(approved: Callable[[str, str], None]) -> None:
    """Value and margin have the digits of the uncertainty; marks of limits and uncertainties."""
    entries = [
        criterion(38.8104, 0.08637), criterion(28.26544, 0.08637), criterion(38.8104, 0.0996),
        criterion(38.8104, 0.00996), criterion(138.4, 12.34), criterion(1384.0, 123.4),
        criterion(38.8104, 0.0), criterion(-0.0004, 0.12), criterion(np.nan, 0.1),
        criterion(38.8104, 0.08637, upper_bound=True), criterion(38.81, 0.0864, contributions=()),
        criterion(1.0, 0.0, "peak_count", (1.0, 1.0)), criterion(0.01934, 1.1e-4, "contact_time"),
    ]  # fmt: skip
    rows = [
        criterion_row(ReportCriterion(entry, *numbers, "", excluded, has_own_limits=bool(excluded)))
        for entry in entries
        for numbers, excluded in (((0.1234, -3.456), ()), ((np.nan, np.nan), ("mass",)))
    ]
    approved("criterion_rows.txt", "\n".join(map(" | ".join, rows)))


def test_report_lists_single_drops(one: Recording) -> None:
    recording = many(one, 3)
    _, *rows = drop_table(recording)
    levels = recording.average().drops.level
    assert [row[0] for row in rows] == [drop.name for drop in recording.drops]
    for row, drop, own in zip(rows, recording.drops, levels, strict=True):
        assert row[-5:] == tuple(f"{level:.2f}" for level in own)
        assert row[-6] == f"{drop.peak_force.value:.0f}"
        assert float(row[2].split()[0]) == pytest.approx(1e3 * drop.contact_time.value, abs=6e-3)


@pytest.mark.slow
def test_budgets_scroll_in_a_page(browser: Browser, laboratory: Recording, tmp_path: Path) -> None:
    page = open_in(browser, tmp_path / "report.html", report_page(report_data(laboratory)))
    for width in (390, 1000):
        assert_scrolls_inside(page, page.locator(".budget"), width)


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
