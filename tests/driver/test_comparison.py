"""Comparison of models and recordings."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import REPOSITORY, SHELL, recorded

import thud
from thud import cli
from thud.base._schema import QUANTITIES
from thud.base.errors import PlausibilityWarning
from thud.base.tables import format_rows
from thud.comparison.comparison import _cell, read_all
from thud.level.assessment import Criterion
from thud.recordings.config import Config

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

STEPS = sorted((REPOSITORY / "inputs/comparison").glob("*.nml"))


def test_paper_s_argument_from_end_to_end() -> None:
    comparison = thud.compare(read_all(STEPS))
    levels = {name: impact.levels(force="floor") for name, impact in comparison.impacts.items()}
    lower = np.array([38, 29.5, 21.5, 15, 10.5])
    upper = np.array([40, 32.5, 24.5, 19, 14.5])
    met = {name: ((lower <= v) & (v <= upper)).tolist() for name, v in levels.items()}
    assert met["1_shell"] == [True, True, False, False, False]
    assert met["3_modes"] == [True, True, True, True, False]
    assert all(met["4_standard_ball"])
    assert all(met["5_elements"])
    # Without moving modes the levels from 250 Hz on are far below even those of the shell.
    assert (levels["2_modes_at_rest"][3:] < levels["1_shell"][3:] - 5).all()


def column(comparison: thud.Comparison, number: int = 1) -> dict[str, str]:
    return {row[0]: row[number] for row in comparison.rows()}


def test_table_has_every_criterion_beside_its_limits(approved: Callable[[str, str], None]) -> None:
    comparison = thud.compare({"shell": SHELL}, force="elastic")
    rows = [row for row in comparison.rows() if row[0] != "computing time, ms"]
    assert len(rows) == len(comparison.rows()) - 1
    approved("comparison.txt", format_rows(rows))


def test_page_and_table_have_the_levels_of_the_case() -> None:
    case = thud.Case(levels=thud.Levels(method="fft", force="elastic"), model=thud.HollowSphere())
    comparison = thud.compare({"shell": case})
    expected = thud.solve(model="hollow_sphere").levels("octave", "fft", "elastic")
    octaves = comparison.plot().axes[1]
    drawn = next(line for line in octaves.lines if len(line.get_ydata()) == len(expected))
    np.testing.assert_array_equal(drawn.get_ydata(), expected)
    assert column(comparison)["31.5 Hz, dB"] == f"{expected[0]:.2f}"


def test_impacts_in_a_row_have_the_names_of_their_cases() -> None:
    impact = thud.solve(model="hollow_sphere")
    comparison = thud.compare([impact, replace(SHELL, name="shell"), impact, impact])
    assert list(comparison.impacts) == ["python", "shell", "python (2)", "python (3)"]
    assert list(thud.compare(impact).impacts) == ["python"]


def test_limits_are_those_of_cases_and_recordings(shell: thud.Impact) -> None:
    case, ball = replace(SHELL, name="tyre", limits=thud.Limits("tyre")), recorded(shell)
    tyre = replace(ball, config=Config(source="tyre"))
    assert tyre.assess().source == "tyre"
    # Those of a recording count where it states a source.
    for impacts, source in (([case], "tyre"), ([tyre], "tyre"), ([tyre, ball], "tyre"),
                            ([ball], "rubber_ball"), ([case, ball], "tyre")):  # fmt: skip
        assert thud.compare(impacts).source == source
    assert thud.compare([SHELL, case], source="rubber_ball").source == "rubber_ball"


def test_recordings_say_what_is_doubtful_and_have_their_names(shell: thud.Impact) -> None:
    ball = replace(recorded(shell), name="plate 7")
    with pytest.warns(PlausibilityWarning, match="plate 7: "):
        comparison = thud.compare([ball, ball])
    assert list(comparison.impacts) == ["plate 7", "plate 7 (2)"]
    for name in comparison.impacts:
        expected = [note for note in ball.notes if note.is_warning]
        found = [note for note in comparison.notes if note.subject.partition(",")[0] == name]
        assert [note.code for note in found] == [note.code for note in expected]
        assert all(note.subject in own.subject for note, own in zip(expected, found, strict=True))


@pytest.mark.usefixtures("working_directory")
def test_command_writes_the_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record = REPOSITORY / "inputs/recordings/drop_1.csv"
    assert cli.main(["compare", str(STEPS[0]), str(record)]) == 0
    assert "Results: outputs/comparison" in capsys.readouterr().out
    assert (tmp_path / "outputs/comparison/comparison.html").stat().st_size < 1e6


@pytest.mark.parametrize(
    ("name", "value", "uncertainty", "cell"),
    [
        ("octave_31_5", 38.1, 0, "38.10"), ("octave_31_5", 37.9, 0, "37.90 low"),
        ("octave_31_5", 40.1, 0, "40.10 high"), ("octave_31_5", 40.1, 1, "40.10 undecided"),
        ("octave_31_5", 38.0, 0.1, "38.00 undecided"), ("octave_31_5", np.nan, 0, "unknown"),
        ("mass", 38.12345, 0, "38.123"), ("contact_time", 38.5, 0, "38500.00"),
        ("margin", -0.001, 0, "0.00 low"),
    ],
)  # fmt: skip
def test_cells_of_missed_criteria(name: str, value: float, uncertainty: float, cell: str) -> None:
    assert _cell(Criterion(name, thud.Estimate(value, uncertainty), 38.0, 40.0)) == cell


def test_small_values_have_three_digits() -> None:
    peak = QUANTITIES["peak_force"]
    values = (0.012345, 0.9999, 1574.26, float("nan"))
    assert [peak.show(value) for value in values] == ["0.0123", "1", "1574", ""]


def test_drops_of_one_speed_are_compared_and_times_are_those_of_cases(shell: thud.Impact) -> None:
    # Recordings are of one drop within the limits of its height.
    low, high = (recorded(shell, height=height) for height in (0.99, 1.01))
    assert len(thud.compare([shell, low, high, recorded(shell)]).impacts) == 4
    # The same speed by another height.
    same = replace(SHELL, drop=thud.Drop(0.5, 2 * 9.81), name="heavy")
    found = thud.compare([shell, same, same])
    assert list(found.impacts) == [shell.case.name, "heavy", "heavy (2)"]
    assert set(found.run_times) == {"heavy", "heavy (2)"}
    assert all(seconds > 0 for seconds in found.run_times.values())
    assert found.impacts[shell.case.name] is shell
    rows = {row[0]: row[1:] for row in found.rows()}
    expected = f"{1e3 * found.run_times['heavy']:.3g}"
    assert rows["computing time, ms"][:2] == ("", expected)
    assert rows["peak force, N"][0] == QUANTITIES["peak_force"].show(shell.peak())


def test_impact_and_recording_answer_the_same_questions(shell: thud.Impact) -> None:
    record = recorded(shell, height=1.0, mass=2.5)
    assert record.contact_time == pytest.approx(shell.contact_time, abs=0.3e-3)
    assert record.levels() == pytest.approx(shell.levels(force="floor"), abs=0.1)
    for one in (shell, record):
        assert one.mass == 2.5
        assert one.impact_velocity == pytest.approx(4.429, abs=1e-3)
        assert one.peak("floor") == one.peak_force == pytest.approx(1574, abs=3)
        assert one.quantity("impulse") == pytest.approx(shell.impulse, rel=0.01)
        assert one.limits_source in (None, "rubber_ball")
        drop = thud.blocked_force(one)
        assert drop.force.max() == pytest.approx(one.peak_force, rel=0.01)
        assert drop.time[0] <= one.touch_time <= drop.time[-1]
        dataset = one.to_xarray()
        assert dataset["floor_octave"].to_numpy() == pytest.approx(one.levels(force="floor"))
        assert dataset["floor_third"].size == 15
    plate = column(thud.compare({"plate": recorded(shell)}))
    assert plate["restitution"] == plate["mass, kg"] == "unknown"
    assert "computing time, ms" not in plate
