"""Warnings on what is possible but not plausible."""

from __future__ import annotations

import re
import tomllib
import warnings
from typing import TYPE_CHECKING

import pytest
from conftest import REPOSITORY

import thud
from thud import cli

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import CaseFile


# A case that is possible and not plausible.
DOUBTFUL = "&ball mass = 25 / &sampling duration = 0.2 /"


@pytest.mark.usefixtures("working_directory")
def test_doubtful_input_raises_a_warning_by_every_command(
    case_file: CaseFile, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = case_file(DOUBTFUL)
    with pytest.warns(thud.PlausibilityWarning) as caught:
        impact = thud.solve(thud.read_case(path))
    assert impact.notes
    assert [warning.message.args for warning in caught] == [(note,) for note in impact.notes]  # type: ignore[union-attr]
    assert {warning.filename for warning in caught} == {__file__}
    assert cli.main(["run", "--no-figures", "-q", str(path)]) == 0
    printed = capsys.readouterr().err
    assert all(f"{path}: {note}" in printed for note in impact.notes)
    assert thud.read_results(tmp_path / "outputs/case").notes == impact.notes
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # the command prints warnings itself
        assert cli.main(["compare", "-q", str(path)]) == 0
    printed = capsys.readouterr().err
    assert all(str(note) in printed for note in impact.notes)


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
        assert thud.solve(thud.read_case(case_file(text))).notes == ()


def test_drop_without_a_finer_one_is_not_verified(case_file: CaseFile) -> None:
    # At 1.4 times the frequency there are too many modes.
    text = "&ball wall_thickness = 0.01, mass = 0.8, youngs_modulus = 4e5 / &drop height = 0.003 /"
    text += " &model name = 'modal_ball' / &modal_ball highest_frequency = 9500, rings = 20 /"
    text += " &sampling duration = 0.3, verify = .true. /"
    with pytest.warns(thud.PlausibilityWarning):
        impact = thud.solve(thud.read_case(case_file(text)))
    assert "finer_contact_time" not in impact.model_quantities
    assert [note.subject for note in impact.notes].count("sampling.verify") == 1


def test_values_at_the_limits_of_rubbers_raise_no_warning(case_file: CaseFile) -> None:
    text = "&ball poisson_ratio = {}, youngs_modulus = 3e9 / &sampling sample_rate = 1e6 /"
    for ratio, number in ((0.45, 0), (0.4499, 1)):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            impact = thud.solve(thud.read_case(case_file(text.format(ratio))))
        assert sum(note.subject.startswith("ball") for note in impact.notes) == number


@pytest.mark.parametrize(
    ("text", "subject", "value", "limit"),
    tomllib.loads((REPOSITORY / "tests/driver/implausible.toml").read_text("utf-8"))["rows"],
)
@pytest.mark.slow
def test_answer_outside_the_theory_raises_a_warning(
    text: str, subject: str, value: float, limit: float, case_file: CaseFile
) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        notes = thud.solve(thud.read_case(case_file(text))).notes
    found = [
        (note.subject, note.value, note.low if note.value < note.low else note.high)
        for note in notes
        if note.code == "outside_limits"
    ]
    assert found.count((subject, pytest.approx(value, rel=0.01), limit)) == 1, found


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
