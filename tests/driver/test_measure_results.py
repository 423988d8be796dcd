"""Files and tables of a measured recording: they say the same, and belong to one recording."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest
from conftest import REPOSITORY, names_in, recorded
from refusals.core import write

from thud import cli
from thud.base.files import Results
from thud.report import recording_files
from thud.report.contents import ReportData, report_data

if TYPE_CHECKING:
    from pathlib import Path

    import thud

FILES = ["criteria.csv", "levels.csv", "report.json", "thud.txt"]


@pytest.fixture(scope="module")
def noisy(shell: thud.Impact) -> ReportData:
    """Return the report of a recording whose level at 500 Hz lies in the background."""
    recording = recorded(shell, 100, height=1.0, mass=2.5)
    assert recording.average().flag[-1] == "background"
    return report_data(replace(recording, calibration_uncertainty=0.01))


@pytest.fixture(scope="module")
def folder(noisy: ReportData, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the directory of the files of the recording, without its page."""
    path = tmp_path_factory.mktemp("measure")
    recording_files.save(noisy, Results(path, "measure"), figures=False)
    assert names_in(path) == FILES
    return path


def rows_of(path: Path) -> list[dict[str, str]]:
    """Return the rows of a table without its comments."""
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    return list(csv.DictReader(lines))


def test_screen_and_files_say_the_same(noisy: ReportData, folder: Path) -> None:
    _, *screen = recording_files.table(noisy.criteria)
    table = rows_of(folder / "criteria.csv")
    data = json.loads((folder / "report.json").read_text())
    keys = ("value", "expanded_uncertainty", "margin")
    for shown, row, one in zip(screen, table, data["criteria"], strict=True):
        assert row == {key: "" if one[key] is None else str(one[key]) for key in row}
        assert shown[-1] == one["verdict"]
        assert one["upper_bound"] == shown[1].startswith("at most ")
        assert row["margin"] == "" or not one["upper_bound"]
        scale = 1e3 if row["name"] == "contact_time" else 1.0
        for text, key in zip((shown[1], shown[2], shown[4]), keys, strict=True):
            number = text.removeprefix("at most ").removesuffix(" †").replace("−", "-")
            if number in ("–", "not stated", "not known"):
                assert one[key] is None
            else:
                assert f"{scale * one[key]:z.{len(number.partition('.')[2])}f}" == number
    assert [row["name"] for row in table if row["upper_bound"] == "True"] == ["octave_500"]
    # The same of the levels.
    levels = rows_of(folder / "levels.csv")
    for row, criterion in zip(levels, table[:5], strict=False):
        assert row["level_dB"] == criterion["value"]
        assert row["expanded_dB"] == criterion["expanded_uncertainty"]
    found = [one for bands in data["levels"].values() for one in bands["uncertainty"]]
    assert [float(row["standard_uncertainty_dB"]) for row in levels] == found
    # 1 % of the force is 0.086 dB.
    assert min(found) > 0.086


def test_page_that_fails_leaves_the_earlier_results(
    noisy: ReportData, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> Any:  # noqa: ANN401
        raise MemoryError

    results = Results(tmp_path / "out", "measure")
    results.write({"levels.csv": b"earlier"})
    monkeypatch.setattr(recording_files, "draw_figures", lambda _: {})
    monkeypatch.setattr(recording_files, "page_contents", fail)
    with pytest.raises(MemoryError):
        recording_files.save(noisy, results)
    assert names_in(results.folder) == ["levels.csv", "thud.txt"]


@pytest.mark.usefixtures("working_directory")
def test_screen_lists_what_the_report_misses(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    write("lab.toml", '[report]\nnumber = "1"\nclient = "Client"\n')
    monkeypatch.setattr(recording_files, "draw_figures", lambda _: None)
    drop = REPOSITORY / "inputs/recordings/drop_1.csv"
    for options, count in (([], 1), (["--no-figures"], 0)):
        assert cli.main(["measure", str(drop), "--config", "lab.toml", "-o", "a", *options]) == 0
        shown = " ".join(capsys.readouterr().out.split())
        assert shown.count("Missing in the report") == count
        line = shown.partition("Missing in the report")[2].partition("Results")[0]
        assert ("procedure" in line) == bool(count)
        assert "client" not in line
        assert "number of the report" not in line
