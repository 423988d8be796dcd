"""Comparison of models and recordings."""

from __future__ import annotations

import os
import re
from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import MINIMAL, REPOSITORY

import thud
from thud import cli

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

STEPS = sorted((REPOSITORY / "inputs/comparison").glob("*.nml"))


def write_recording(path: Path, impact: thud.Impact, header: str = "time_s,force_N") -> None:
    # A quarter of a second of noise before and after the impact, as a force plate has it.
    noise = np.random.default_rng(1).normal(scale=0.5, size=22050)
    noise[11025 : 11025 + len(impact.time)] += impact.floor_force
    table = np.column_stack([np.arange(len(noise)) / impact.sample_rate, noise])
    np.savetxt(path, table, delimiter=",", header=header, comments="", fmt="%.12g")


def test_paper_s_argument_from_end_to_end() -> None:
    comparison = thud.compare(thud.read_all(STEPS))
    levels = {name: impact.levels(force="floor") for name, impact in comparison.impacts.items()}
    lower = np.array([38, 29.5, 21.5, 15, 10.5])
    upper = np.array([40, 32.5, 24.5, 19, 14.5])
    met = {name: ((lower <= v) & (v <= upper)).tolist() for name, v in levels.items()}
    assert met["1_shell"] == [True, True, False, False, False]
    assert met["3_modes"] == [True, True, True, True, False]
    assert met["4_modes_rising_loss"] == [True, True, True, True, False]
    # Without moving modes the levels from 250 Hz on are far below even those of the shell.
    assert (levels["2_modes_at_rest"][3:] < levels["1_shell"][3:] - 5).all()
    # The loss factor of step 4 follows from the standard's restitution.
    assert comparison.impacts["4_modes_rising_loss"].restitution == pytest.approx(0.8, abs=0.01)


def test_page_is_complete_in_one_file(tmp_path: Path) -> None:
    paths = thud.compare({"shell <1>": thud.Case(), "again": thud.solve()}).save(tmp_path)
    assert [path.name for path in paths] == [
        "comparison.png",
        "comparison.svg",
        "comparison.html",
    ]
    page = paths[-1].read_text()
    assert "shell &lt;1&gt;" in page
    # Nothing is loaded from anywhere: the plots' own code stands in the page.
    body = re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)
    assert "http" not in body
    assert not re.search(r"<(script|link|img)[^>]*\b(src|href)=", page)
    assert "Plotly.newPlot" in page


def test_table_gives_deviations_from_the_nominal_levels() -> None:
    (row,) = thud.compare({"shell": thud.Case()}, force="elastic").table()
    assert row[:6] == (
        "shell",
        "20.43",
        "1574",
        "0.889",
        "-0.5  +0.1  -6.0  -9.1  -14.3",
        "2 of 5 octaves",
    )
    assert float(row[6]) > 0


def test_page_and_table_have_the_same_levels() -> None:
    case = thud.Case(levels=thud.Levels(method="fft"))
    comparison = thud.compare({"shell": case}, force="elastic")
    exact = thud.solve().levels("octave", "exact", "elastic")
    octaves = comparison.figure().axes[1]
    drawn = next(line for line in octaves.lines if len(line.get_ydata()) == len(exact))
    np.testing.assert_array_equal(drawn.get_ydata(), exact)
    assert comparison.table()[0][4].split()[0] == f"{exact[0] - 39:+.1f}"


def test_recording_stands_beside_its_model(tmp_path: Path) -> None:
    impact = thud.solve()
    write_recording(tmp_path / "plate.csv", impact)
    recording = thud.Recording.from_csv(tmp_path / "plate.csv")
    assert recording.sample_rate == pytest.approx(44100)
    # The first percent of the force takes a few samples at either end.
    assert recording.contact_time == pytest.approx(impact.contact_time, abs=0.3e-3)
    assert recording.peak_force == pytest.approx(impact.peak_force, abs=3)
    np.testing.assert_allclose(recording.levels(), impact.levels(force="floor"), atol=0.1)
    rows = thud.compare({"model": impact, "plate": recording}).table()
    assert rows[1][3] == "not known"
    assert rows[1][6] == ""


def test_nothing_and_different_drops_are_told(
    case_file: Callable[..., Path], tmp_path: Path
) -> None:
    with pytest.raises(thud.InputError, match="impacts is empty"):
        thud.compare({})
    with pytest.raises(
        thud.InputError, match=r"differs \(a falls with 4.429 m/s, b falls with 3.132"
    ):
        thud.compare({"a": thud.Case(), "b": thud.solve(drop=thud.Drop(0.5))})
    with pytest.raises(thud.InputError, match="allowed: an object of Case or Impact or Recording"):
        thud.compare({"a": 1})  # type: ignore[dict-item]
    (tmp_path / "other").mkdir()
    paths = [case_file(MINIMAL), case_file(MINIMAL, "other/case.nml")]
    with pytest.raises(thud.InputError, match="'case' also names another input"):
        thud.read_all(paths)


def test_command_writes_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    write_recording(tmp_path / "plate.csv", thud.solve())
    assert cli.main(["compare", str(STEPS[0]), "plate.csv"]) == 0
    output = capsys.readouterr().out
    assert "1_shell" in output
    assert "Page: outputs/comparison/comparison.html" in output
    assert (tmp_path / "outputs/comparison/comparison.html").stat().st_size > 1e6
    assert cli.main(["compare", "-q", "nowhere.nml"]) == 1
    assert "nowhere.nml: there is no such file" in capsys.readouterr().err
    assert cli.main(["compare", "-q", "-o", "", str(STEPS[0])]) == 1
    assert "--output has no value" in capsys.readouterr().err
    os.mkfifo(tmp_path / "pipe.csv")
    assert cli.main(["compare", "-q", "pipe.csv"]) == 1
    assert "pipe.csv: cannot be read" in capsys.readouterr().err
    assert cli.main(["compare", "-q", "-o", "plate.csv", str(STEPS[0])]) == 1
    assert "plate.csv: File exists; allowed: " in capsys.readouterr().err


def test_case_that_fails_is_named() -> None:
    low = thud.Case(sampling=thud.Sampling(duration=0.01))
    with pytest.raises(thud.InputError, match=r"^short: &sampling: duration"):
        thud.compare({"short": low})
