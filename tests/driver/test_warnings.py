"""Warnings on what is possible but not plausible."""

from __future__ import annotations

import re
import warnings
from typing import TYPE_CHECKING

import pytest
from conftest import naming

import thud
from thud import cli

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import CaseFile

# What each warning names, and input that earns it.
DOUBTFUL = {
    naming("&ball", "density", "mass", 2200.0): "&ball mass = 25 / &sampling duration = 0.2 /",
    naming("&ball: youngs_modulus", "Pa", 1.6, "10000.0"):
    "&ball youngs_modulus = 1.6 / &drop height = 1e-6 /"
    " &sampling duration = 10, sample_rate = 2000 / &model name = 'hollow_sphere' /",
    naming("&drop: force exposure level", "sources have", 4.0, "units"): "&drop height = 1e-7 /"
    " &model name = 'hunt_crossley' / &hunt_crossley contact_time = 0.02 /",
}  # fmt: skip


@pytest.mark.parametrize("words", DOUBTFUL)
@pytest.mark.slow
@pytest.mark.usefixtures("working_directory")
def test_doubtful_input_raises_a_warning_by_every_command(
    words: str, case_file: CaseFile, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = case_file(DOUBTFUL[words])
    with pytest.warns(thud.PlausibilityWarning) as caught:
        impact = thud.solve(thud.read_case(path))
    assert [bool(re.search(words, warning)) for warning in impact.warnings].count(True) == 1
    assert [str(warning.message) for warning in caught] == list(impact.warnings)
    assert {warning.filename for warning in caught} == {__file__}
    assert cli.main(["run", "--no-figures", "-q", str(path)]) == 0
    assert any(
        str(path) in line and re.search(words, line)
        for line in capsys.readouterr().err.splitlines()
    )
    assert thud.read_results(tmp_path / "outputs/case").warnings == impact.warnings
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # the command prints warnings itself
        assert cli.main(["compare", "-q", str(path)]) == 0
    assert any(re.search(words, line) for line in capsys.readouterr().err.splitlines())


@pytest.mark.parametrize(
    "text",
    [
        "&ball /",
        "&ball youngs_modulus = 2.1e6 / &model name = 'finite_element' / &mesh polar_elements=64 /",
        "&ball youngs_modulus = 1.75e6 / &model name = 'modal_ball' /",
        # The wall of a lumped source counts for nothing.
        "&ball mass = 7.3 / &model name = 'hunt_crossley' / &hunt_crossley contact_time = 0.02 /",
    ],
)
def test_plausible_input_raises_no_warning(text: str, case_file: CaseFile) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert thud.solve(thud.read_case(case_file(text))).warnings == ()


OUTSIDE = {
    naming("&ball: wall_thickness", "outer_radius", 0.5, 0.4): "&ball wall_thickness = 0.0445 /"
    " &model name = 'hollow_sphere' /",
    naming("&ball: poisson_ratio", 0.3, 0.45): "&ball poisson_ratio = 0.3 /",
    naming("&drop: deflection", "outer_radius", 0.5): "&drop height = 3 /"
    " &model name = 'hollow_sphere' /",
    naming(
        "&drop: deflection", "wall_thickness", 0.5, "thin wall", "9 dB off those of finite elements"
    ): "&ball"
    " wall_thickness = 0.016, mass = 1, youngs_modulus = 5e6, poisson_ratio = 0.49 /"
    " &model name = 'modal_ball' /",
    naming("&drop: deflection", "wall_thickness", 2.0, "buckles"): "&ball wall_thickness = 0.0272,"
    " youngs_modulus = 4e5 / &drop height = 1.6 / &sampling duration = 0.1 /"
    " &model name = 'hollow_sphere' /",
    naming("&drop: deflection", "twice outer_radius", 2.8, 1.0): "&drop height = 50 / &sampling"
    " duration = 0.1 / &model name = 'measured_modes' / &measured_modes frequency = 10,"
    " damping_ratio = 0, effective_mass = 2.5 /",
    naming("&drop: velocity", "youngs_modulus", "density", 0.25): "&drop height = 7 /",
    naming("&ball", "stress", "gauge_pressure", "youngs_modulus", 0.1): "&ball"
    " gauge_pressure = 3e5 /",
    naming("&drop: gravity", "contact time", "velocity", 0.2): "&drop height = 0.01 /",
    naming("&sampling: sample_rate", 4000.0, 8000.0): "&sampling sample_rate = 4000 /",
    naming("&levels: smallest fraction", "octave", "1.0e-12"): "&drop height = 10 / &sampling"
    " duration = 2 / &model name = 'hunt_crossley' /"
    " &hunt_crossley contact_time = 1, exponent = 3 /",
    naming("numerical error", "dB", "polar_elements = 32"): "&drop height = 0.01 /"
    " &ball youngs_modulus = 2.08e6 / &model name = 'finite_element' / &mesh polar_elements = 32 /",
    naming("numerical error", "dB", "500 Hz", "rings = 10"): "&model name = 'modal_ball' /"
    " &modal_ball rings = 10, highest_frequency = 300 /",
    naming("&floor: restitution", "-1.0e-6"): "&model name = 'hunt_crossley' /"
    " &hunt_crossley contact_time = 0.02 / &floor name = 'oscillator' /"
    " &oscillator mass = 0.5, stiffness = 0, damping = 0 / &sampling duration = 0.2 /",
    naming(
        "&model: restitution", 1, "1.0e-6"
    ): "&model name = 'hollow_sphere' / &hollow_sphere momentum_flux = 'none' / &floor"
    " name = 'oscillator' / &oscillator mass = 30, stiffness = 1.70549e7,"
    " damping = 0 / &sampling duration = 0.2 /",
}


def test_drop_without_a_finer_one_is_not_verified(case_file: CaseFile) -> None:
    # At 1.4 times the frequency there are too many modes.
    text = "&ball wall_thickness = 0.01, mass = 0.8, youngs_modulus = 4e5 / &drop height = 0.003 /"
    text += " &model name = 'modal_ball' / &modal_ball highest_frequency = 9500, rings = 20 /"
    text += " &sampling duration = 0.3, verify = .true. /"
    with pytest.warns(thud.PlausibilityWarning, match="is not verified"):
        impact = thud.solve(thud.read_case(case_file(text)))
    assert impact.finer is None
    assert sum("verify: the drop cannot be computed" in text for text in impact.warnings) == 1


def test_values_at_the_limits_of_rubbers_raise_no_warning(case_file: CaseFile) -> None:
    text = "&ball poisson_ratio = {}, youngs_modulus = 3e9 / &sampling sample_rate = 1e6 /"
    for ratio, number in ((0.45, 0), (0.4499, 1)):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            impact = thud.solve(thud.read_case(case_file(text.format(ratio))))
        found = impact.warnings
        assert sum("rubbers have" in warning for warning in found) == number, found


@pytest.mark.parametrize("words", OUTSIDE)
@pytest.mark.slow
def test_answer_outside_the_theory_raises_a_warning(words: str, case_file: CaseFile) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = thud.solve(thud.read_case(case_file(OUTSIDE[words]))).warnings
    assert [bool(re.search(words, warning)) for warning in found].count(True) == 1, found


@pytest.mark.usefixtures("working_directory")
def test_run_names_the_groups_that_are_left_out(
    case_file: CaseFile, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["run", "--no-figures", str(case_file("&drop height = 0.5 /"))]) == 0
    out = capsys.readouterr().out
    assert "&ball &model" in out
    assert "standard ball: youngs_modulus = 1560000.0 Pa" in out
    assert cli.main(["run", "--no-figures", "-o", "m", str(case_file("&modes count = 1 /"))]) == 0
    assert re.search(r"defaults.*&ball(?! &model)", capsys.readouterr().out, re.IGNORECASE)
    assert cli.main(["run", "--no-figures", "-o", "again", "outputs/case/effective.nml"]) == 0
    assert "default" not in capsys.readouterr().out.lower()
