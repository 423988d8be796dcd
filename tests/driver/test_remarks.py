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
        "&ball youngs_modulus = 2.1e6 / &model name = 'finite_element' / &mesh polar_elements=32 /",
        "&ball youngs_modulus = 1.75e6 / &model name = 'modal_ball' /",
        # The wall of a lumped source counts for nothing.
        "&ball mass = 7.3 / &model name = 'hunt_crossley' / &hunt_crossley contact_time = 0.02 /",
    ],
)
def test_plausible_input_earns_no_remark(text: str, case_file: Callable[..., Path]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert thud.solve_case(thud.read_case(case_file(text))).remarks == ()


OUTSIDE = {
    "&ball: wall_thickness over outer_radius is 0.5, the theory holds up to 0.4": "&ball"
    " wall_thickness = 0.0445 /",
    "&ball: poisson_ratio = 0.3, rubbers have 0.45 to 0.50": "&ball poisson_ratio = 0.3 /",
    "&drop: deflection over outer_radius is 0.": "&drop height = 3 /",
    "&drop: deflection over wall_thickness is 4.0": "&ball wall_thickness = 0.01, mass = 1 /",
    "&drop: velocity at first touch over sqrt(youngs_modulus/density) is 0.3": "&drop height = 7 /",
    "&ball: stress of the wall by gauge_pressure over youngs_modulus is 0.1": "&ball"
    " gauge_pressure = 3e5 /",
    "&drop: gravity times contact time over velocity at first touch is 0.4": "&drop"
    " height = 0.01 /",
    "&sampling: sample_rate in Hz is 4000.0, the theory holds from 8000.0": "&sampling"
    " sample_rate = 4000 /",
    "octaves from 63 Hz on hold less than 1e-12 of the energy": "&drop height = 10 / &sampling"
    " duration = 2 / &model name = 'hunt_crossley' /"
    " &hunt_crossley contact_time = 1, exponent = 3 /",
    "&mesh: sqrt(outer_radius wall_thickness) over the length of an element is 3.05": "&ball"
    " youngs_modulus = 2.08e6 / &model name = 'finite_element' / &mesh polar_elements = 16 /",
    "&mesh: radius of the contact over the length of an element is 2.2": "&drop height = 0.01 /"
    " &ball youngs_modulus = 2.08e6 / &model name = 'finite_element' / &mesh polar_elements = 32 /",
    "&modal_ball: rings in contact is 1": "&drop height = 0.03 / &model name = 'modal_ball' /",
    "&sampling: sample_rate in Hz times substeps is 12000.0, the theory holds from 1": "&sampling"
    " sample_rate = 12000 / &model name = 'modal_ball' /",
    "&modal_ball: radial_modes is 4.0, the theory holds from 5.0": "&model name = 'modal_ball' /"
    " &modal_ball radial_modes = 4 /",
    "&modal_ball: harmonics times the angle of the contact is 6": "&model name = 'modal_ball' /"
    " &modal_ball harmonics = 12 /",
    "&modal_ball: harmonics times wall_thickness over outer_radius is 1": "&ball mass = 0.2,"
    " wall_thickness = 0.002 / &drop height = 0.1 / &sampling duration = 0.3 /"
    " &model name = 'modal_ball' /",
    "&floor: restitution is -": "&model name = 'hunt_crossley' /"
    " &hunt_crossley contact_time = 0.02 / &floor name = 'oscillator' /"
    " &oscillator mass = 0.5, stiffness = 0, damping = 0 / &sampling duration = 0.2 /",
    "&model: restitution less 1 is 4.4e-5": "&hollow_sphere momentum_flux = 'none' / &floor"
    " name = 'oscillator' / &oscillator mass = 30, stiffness = 1.70549e7,"
    " damping = 0 / &sampling duration = 0.2 /",
}


@pytest.mark.parametrize("words", OUTSIDE)
def test_answer_outside_the_theory_is_remarked(words: str, case_file: Callable[..., Path]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        remarks = thud.solve_case(thud.read_case(case_file(OUTSIDE[words]))).remarks
    assert [remark.startswith(words) for remark in remarks].count(True) == 1, remarks


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
