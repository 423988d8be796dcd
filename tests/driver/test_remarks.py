"""Remarks on what is possible but not plausible."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import pytest

import thud
from thud import cli

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

# What each remark says, and input that earns it.
DOUBTFUL = {
    "the wall has a density of 11": "&ball mass = 25 / &sampling duration = 0.2 /",
    "youngs_modulus = 1.6 Pa, rubbers have": "&ball youngs_modulus = 1.6 / &drop height = 1e-6 /"
    " &sampling duration = 10, sample_rate = 2000 /",
    "the modulus of the paper's ball in the model 'hollow_sphere'; 'finite_element' needs 2.08 MPa":
    "&model name = 'finite_element' / &mesh radial_elements = 4, polar_elements = 32 /",
    "the modulus of the paper's ball in the model 'finite_element'; 'modal_ball' needs 1.60 MPa":
    "&ball youngs_modulus = 2.08e6 / &model name = 'modal_ball' /",
    "the force exposure level over all frequencies is -2": "&drop height = 1e-7 /"
    " &model name = 'hunt_crossley' / &hunt_crossley contact_time = 0.02 /",
}  # fmt: skip


@pytest.mark.parametrize("words", DOUBTFUL)
def test_doubtful_input_is_remarked_by_every_command(
    words: str,
    case_file: Callable[..., Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    path = case_file(DOUBTFUL[words])
    with pytest.warns(thud.PlausibilityWarning) as caught:
        impact = thud.solve_case(thud.read_case(path))
    assert [words in remark for remark in impact.remarks].count(True) == 1
    assert [str(warning.message) for warning in caught] == list(impact.remarks)
    assert {warning.filename for warning in caught} == {__file__}
    assert cli.main(["run", "--no-figures", "-q", str(path)]) == 0
    assert f"thud-driver: {path}: " in (shown := capsys.readouterr().err)
    assert words in shown
    assert thud.read_results(tmp_path / "outputs/case").remarks == impact.remarks
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # the command prints remarks itself
        assert cli.main(["compare", "-q", str(path)]) == 0
    assert words in capsys.readouterr().err


@pytest.mark.parametrize(
    "text",
    [
        "&ball /",
        "&ball youngs_modulus = 2.1e6 / &model name = 'finite_element' / &mesh polar_elements=9 /",
        "&ball youngs_modulus = 1.75e6 / &model name = 'modal_ball' /",
        # The wall of a lumped source counts for nothing.
        "&ball mass = 7.3 / &model name = 'hunt_crossley' / &hunt_crossley contact_time = 0.02 /",
    ],
)
def test_plausible_input_earns_no_remark(text: str, case_file: Callable[..., Path]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert thud.solve_case(thud.read_case(case_file(text))).remarks == ()


def test_free_modes_with_the_modulus_of_the_shell_are_remarked() -> None:
    with pytest.warns(thud.PlausibilityWarning, match="'finite_element' needs 2.08 MPa"):
        found = thud.free_modes(radial_elements=4, polar_elements=16)
    assert len(found.remarks) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        thud.free_modes(thud.Ball.standard(), radial_elements=4, polar_elements=16)


def test_run_names_the_groups_that_are_left_out(
    case_file: Callable[..., Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.main(["run", "--no-figures", str(case_file("&drop height = 0.5 /"))]) == 0
    assert "Defaults hold for &ball &model, which the file leaves out." in capsys.readouterr().out
    assert cli.main(["run", "--no-figures", "-o", "m", str(case_file("&modes count = 1 /"))]) == 0
    assert "Defaults hold for &ball, which the file leaves out." in capsys.readouterr().out
    assert cli.main(["run", "--no-figures", "outputs/case/effective.nml"]) == 0
    assert "Defaults hold" not in capsys.readouterr().out
