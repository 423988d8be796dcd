"""Fits that files describe, and the command that runs them."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import REPOSITORY, load_script, names_in, naming

import thud
from thud import cli
from thud.studies.fit import read_fit_study, run_fit

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import ErrorsOf

STUDIES = REPOSITORY / "inputs/studies"
# What make_targets.py has put into the targets.
TRUTH = {"youngs_modulus": 1.75e6, "loss_factor": 0.18}
STUDY = """
[target]
file = "record.csv"

[parameters]
youngs_modulus = { start = 1.4, unit = "MPa" }
"""
FILES = ["fit.csv", "fit.json", "fit.svg", "fitted.nml", "thud.txt"]
FIT = ["fit", "-q", "--no-figures", "-o", "found", "study.toml"]


@pytest.fixture(autouse=True)
def in_directory_with_record(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    impact = thud.solve(duration=0.03)
    table = np.column_stack([impact.time + 0.2, impact.floor_force])
    np.savetxt("record.csv", table, delimiter=",")
    (tmp_path / "study.toml").write_text(STUDY)


@pytest.mark.parametrize("name", ["fit_force", "fit_levels"])
@pytest.mark.slow
def test_studies_of_the_repository(name: str, tmp_path: Path) -> None:
    assert cli.main(["fit", str(STUDIES / f"{name}.toml")]) == 0
    folder = tmp_path / "outputs" / name
    assert names_in(folder) == sorted([*FILES, "confidence.svg"])
    saved = json.loads((folder / "fit.json").read_text())
    case = thud.read_case(folder / "fitted.nml")
    for parameter, truth in TRUTH.items():
        entry = saved["parameters"][parameter]
        # A miss by four standard errors has a probability of 6e-5.
        assert abs(entry["value"] - truth) < 4 * entry["standard_error"]
        fitted = vars(case.ball) | vars(case.model)
        assert fitted[parameter] == pytest.approx(entry["value"], rel=1e-12)
    assert not saved["warnings"]
    assert saved["study"]["parameters"]["youngs_modulus"]["unit"] == "MPa"


def test_units_are_those_of_the_file(tmp_path: Path) -> None:
    limits = STUDY.replace("start = 1.4", "start = 1.4, low = 1, high = 5")
    (tmp_path / "study.toml").write_text(limits)
    study = read_fit_study("study.toml")
    (parameter,) = study.parameters
    assert parameter.table == {"start": 1.4e6, "low": 1e6, "high": 5e6, "unit": "MPa"}
    fit = run_fit(study)
    # The table of the record has times of its own.
    assert fit.values["time_shift"] == pytest.approx(0.2, abs=1e-6)
    assert fit.values["youngs_modulus"] == pytest.approx(1.56e6, rel=1e-6)
    np.testing.assert_allclose(fit.limits[0], [1e6, 5e6])
    assert fit.rows()[1][-1] == "MPa"


def test_doubts_are_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shell = 'case = { model = { name = "hollow_sphere" } }\n'
    (tmp_path / "study.toml").write_text(f"{shell}{STUDY}wall_thickness = {{ start = 0.03 }}")
    assert cli.main(["fit", "-q", "-o", "found", "study.toml"]) == 0
    captured = capsys.readouterr()
    assert captured.out == ""
    assert re.search(naming("study.toml", "youngs_modulus", "wall_thickness"), captured.err)
    saved = json.loads((tmp_path / "found/fit.json").read_text())
    assert saved["parameters"]["wall_thickness"]["standard_error"] is None


def test_search_without_an_end_is_a_failure(tmp_path: Path, errors_of: ErrorsOf) -> None:
    (tmp_path / "study.toml").write_text(f"max_steps = 1\n{STUDY}")
    assert "converged" in errors_of("fit", "--no-figures", "study.toml", code=2)


def test_window_without_an_end_is_saved(tmp_path: Path) -> None:
    (tmp_path / "study.toml").write_text(STUDY.replace("[target]", "[target]\nwindow = [0, inf]"))
    for _ in range(2):
        assert cli.main(FIT) == 0
    saved = json.loads((tmp_path / "found/fit.json").read_text())
    assert saved["study"]["target"]["window"] == [0, "Infinity"]


def test_useless_directory_is_reported_before_the_search(
    tmp_path: Path, errors_of: ErrorsOf, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delattr("thud.studies.fit.find_best")
    (tmp_path / "found").mkdir()
    (tmp_path / "found/notes.txt").touch()
    assert "found" in errors_of(*FIT)


def test_targets_are_those_of_their_script(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    script = load_script("inputs/studies/make_targets.py")
    monkeypatch.setattr(script, "__file__", str(tmp_path / "make_targets.py"))
    script.main()
    made, kept = (
        np.loadtxt(folder / "fit_force.csv", delimiter=",", skiprows=3)
        for folder in (tmp_path, STUDIES)
    )
    np.testing.assert_allclose(made, kept, atol=2e-3)
    first = capsys.readouterr().out.splitlines()[0]
    assert first in (STUDIES / "fit_levels.toml").read_text()


def test_fixed_keys_and_units_of_targets(tmp_path: Path) -> None:
    plain = STUDY.replace("[target]", "[target]\nnoise = 5\nbelow = 1000\nwindow = [0.2, 0.23]")
    units = """
fixed = { mass = { value = 2400, unit = "g" } }
[target]
file = "record.csv"
noise = { value = 0.005, unit = "kN" }
below = { value = 1, unit = "kHz" }
window = { value = [200, 230], unit = "ms" }
[parameters]
youngs_modulus = { start = 1400, unit = "kPa" }
"""
    (tmp_path / "ball.nml").write_text("&ball mass = 2.4 / &drop / &model /\n")
    (tmp_path / "plain.toml").write_text(f'case = "ball.nml"\n{plain}')
    (tmp_path / "units.toml").write_text(units)
    one, other = (run_fit(f"{name}.toml") for name in ("plain", "units"))
    assert other.case.ball.mass == 2.4
    assert one.values == other.values
    density = {"density": {"value": 1.0, "unit": "g/cm3"}}
    study = {"fixed": density, "target": {"levels": [39, 31, 23, 17, 12]}}
    found = read_fit_study({**study, "parameters": {"youngs_modulus": {}}})
    assert found.case.ball.mass == pytest.approx(1e3 * 4 / 3 * np.pi * (0.089**3 - 0.057**3))
