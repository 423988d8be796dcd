"""Files and tables of a measured recording: they say the same, and belong to one recording."""

from __future__ import annotations

import csv
import html
import json
import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from conftest import REPOSITORY, names_in

import thud
from thud import cli
from thud.base.files import Results
from thud.recordings.signal import Signal
from thud.report import recording_files
from thud.report.contents import report_data
from thud.report.recording_files import PDF
from thud.report.rows import HEAD

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import ErrorsOf

FOLDER = REPOSITORY / "inputs/recordings"
FILES = {"levels.csv", "criteria.csv", "report.json"}
FIGURES = {"report.html", "force.svg", "levels.svg"}


@pytest.fixture(scope="module")
def noisy() -> thud.Recording:
    """Return a recording whose level at 500 Hz lies in the background."""
    impact = thud.solve(model="hollow_sphere")
    force = np.pad(impact.floor_force, int(0.1 * impact.sample_rate))
    force += np.random.default_rng(1).normal(scale=100, size=len(force))
    recording = thud.read_recording(
        Signal.from_array(force, impact.sample_rate), height=1.0, mass=2.5
    )
    assert recording.average().flag[-1] == "background"
    return replace(recording, calibration_uncertainty=0.01)


def rows_of(path: Path) -> list[dict[str, str]]:
    """Return the rows of a table without its comments."""
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    return list(csv.DictReader(lines))


def names(folder: Path) -> set[str]:
    """Return the names of the files, with or without the PDF that an extra makes."""
    return set(names_in(folder)) - {PDF, "thud.txt"}


def test_screen_files_and_page_say_the_same(noisy: thud.Recording, tmp_path: Path) -> None:
    recording_files.save(report_data(noisy), Results(tmp_path, "measure"))
    head, *screen = recording_files.table(report_data(noisy).criteria)
    table = rows_of(tmp_path / "criteria.csv")
    data = json.loads((tmp_path / "report.json").read_text())
    rows = re.findall(
        r'<tr class="[a-z-]+">(.*?)</tr>', (tmp_path / "report.html").read_text(), re.DOTALL
    )
    page = [
        [
            html.unescape(re.sub(r"<svg.*?</svg>|<[^>]*>", "", cell, flags=re.DOTALL)).replace(
                "\N{NO-BREAK SPACE}", " "
            )
            for cell in row.split("</td>")
        ]
        for row in rows
    ]
    columns = [HEAD.index(title) for title in head[:-1]]
    keys = ("value", "expanded_uncertainty", "margin")
    for shown, row, one, cells in zip(screen, table, data["criteria"], page, strict=True):
        assert [cells[i] for i in columns] == list(shown[:-1])
        assert shown[-1] == row["verdict"] == one["verdict"]
        assert shown[-1] in cells
        assert row["upper_bound"] == str(one["upper_bound"])
        assert one["upper_bound"] == shown[1].startswith("at most ")
        scale = 1e3 if row["name"] == "contact_time" else 1.0
        for text, key in zip((shown[1], shown[2], shown[4]), keys, strict=True):
            number = text.removeprefix("at most ").removesuffix(" †").replace("−", "-")
            if number in ("–", "not stated", "not known"):
                assert row[key] == ""
                assert one[key] is None
            else:
                decimals = len(number.partition(".")[2])
                assert float(row[key]) == one[key]
                assert f"{scale * one[key]:z.{decimals}f}" == number
    by_name = {row["name"]: row for row in table}
    bound = by_name["octave_500"]
    assert bound["upper_bound"] == "True"
    assert bound["value"]
    assert bound["margin"] == ""
    assert by_name["peak_count"]["expanded_uncertainty"] == ""
    assert by_name["octave_63"]["margin"]
    assert by_name["octave_63"]["upper_bound"] == "False"


def test_levels_and_criteria_agree_on_uncertainty(noisy: thud.Recording, tmp_path: Path) -> None:
    recording_files.save(report_data(noisy), Results(tmp_path, "measure"), figures=False)
    rows = rows_of(tmp_path / "levels.csv")
    data = json.loads((tmp_path / "report.json").read_text())
    criteria = rows_of(tmp_path / "criteria.csv")[:5]
    for row, criterion in zip(rows, criteria, strict=False):
        assert row["level_dB"] == criterion["value"]
        assert row["expanded_dB"] == criterion["expanded_uncertainty"]
    found = [one for bands in data["levels"].values() for one in bands["uncertainty"]]
    assert [float(row["standard_uncertainty_dB"]) for row in rows] == found
    # 1 % of the force is 0.086 dB.
    assert min(found) > 0.086


@pytest.mark.usefixtures("working_directory")
def test_report_of_another_recording_does_not_stay_beside_new_numbers(
    tmp_path: Path, errors_of: ErrorsOf
) -> None:
    for name, drop in (("a", 1), ("b", 2)):
        (tmp_path / name).mkdir()
        content = (FOLDER / f"drop_{drop}.csv").read_bytes()
        (tmp_path / name / "drop.csv").write_bytes(content)
    out = tmp_path / "outputs/drop"
    assert cli.main(["measure", "a/drop.csv", "-q"]) == 0
    assert names(out) == FILES | FIGURES
    # The report is removed only by a new one.
    assert "report.html" in errors_of("measure", "b/drop.csv", "-q", "--no-figures")
    assert names(out) == FILES | FIGURES
    assert cli.main(["measure", "b/drop.csv", "-q"]) == 0
    (origin,) = thud.read_recording("b/drop.csv").origins
    (file,) = json.loads((out / "report.json").read_text())["files"]
    assert file["sha256"] == origin.checksum


def test_page_that_fails_leaves_the_earlier_results(
    noisy: thud.Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> Any:  # noqa: ANN401
        raise MemoryError

    results = Results(tmp_path / "out", "measure")
    results.write({"levels.csv": b"earlier"})
    monkeypatch.setattr(recording_files, "page_contents", fail)
    with pytest.raises(MemoryError):
        recording_files.save(report_data(noisy), results)
    assert names(results.folder) == {"levels.csv"}


@pytest.mark.usefixtures("working_directory")
def test_screen_lists_what_the_report_misses(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "lab.toml").write_text('[report]\nnumber = "1"\nclient = "Client"\n')
    command = ["measure", str(FOLDER / "drop_1.csv"), "--config", "lab.toml"]
    assert cli.main(command) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert shown.count("Missing in the report") == 1
    line = shown.partition("Missing in the report")[2].partition("Results")[0]
    assert "ISO/IEC 17025:2017" in line
    assert "procedure" in line
    assert "client" not in line
    assert "number of the report" not in line
    assert cli.main([*command, "--no-figures", "-o", "without"]) == 0
    assert "Missing in the report" not in capsys.readouterr().out
