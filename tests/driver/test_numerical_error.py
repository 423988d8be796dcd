"""The numerical error that every impact states."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

import thud

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import CaseFile, Run

COARSE = "&ball / &drop / &model name = 'modal_ball' /"
COARSE += " &modal_ball rings = 10, highest_frequency = 300 /"


def test_results_keep_the_stated_error(case_file: CaseFile, run: Run, tmp_path: Path) -> None:
    path = case_file(COARSE)
    with pytest.warns(thud.PlausibilityWarning, match=r"numerical error .* 500 Hz .* dB"):
        impact = thud.solve(thud.read_case(path))
    error = impact.numerical_error
    assert error.level.shape == (5,)
    assert error.level[4] > 0.2
    assert error.level[0] < error.level[4]
    assert (*error.level, error.contact_time, error.restitution, error.peak_force) == (
        impact.octave_31_5_error, impact.octave_63_error, impact.octave_125_error,
        impact.octave_250_error, impact.octave_500_error, impact.contact_time_error,
        impact.restitution_error, impact.peak_force_error,
    )  # fmt: skip
    shown = run(path, "--output", "results").stdout
    lines = [line.split() for line in shown.splitlines() if "numerical error at 500" in line]
    assert lines == [["numerical", "error", "at", "500", "Hz", f"{error.level[4]:.2f}", "dB"]]
    read = thud.read_results(tmp_path / "results")
    assert read.numerical_error.level == pytest.approx(error.level)
    assert float(impact.to_xarray()["octave_500_error"]) == error.level[4]


def test_error_of_the_default_is_small_and_not_shown(case_file: CaseFile, run: Run) -> None:
    impact = thud.solve(model="modal_ball")
    assert 0 < impact.numerical_error.level.max() < 0.1
    assert impact.warnings == ()
    shown = run(case_file("&ball / &drop / &model name = 'modal_ball' /")).stdout
    assert "numerical error" not in shown
