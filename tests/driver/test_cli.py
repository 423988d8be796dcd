"""The command thud-driver."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from conftest import MINIMAL, REPOSITORY, RESULT_FILES, contents, names_in, naming, python

from thud import cli

if TYPE_CHECKING:
    from conftest import CaseFile, ErrorsOf, Run


pytestmark = pytest.mark.usefixtures("working_directory")


def test_run_writes_results_and_figures(
    case_file: CaseFile, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["run", str(case_file(MINIMAL, "ball.nml"))]) == 0
    written = names_in(tmp_path / "outputs/ball")
    assert written == sorted([*RESULT_FILES, "force.svg", "levels.svg"])
    output = capsys.readouterr().out
    assert re.search(r"level, 31\.5 Hz octave +38\.70 dB +38 to 40 +conforms +38\.53 dB", output)
    assert "does not conform" in output
    before = contents(tmp_path / "outputs/ball")
    assert cli.main(["run", "-q", "ball.nml"]) == 0
    assert capsys.readouterr().out == ""
    assert contents(tmp_path / "outputs/ball") == before


def test_run_agrees_with_the_executable(run: Run, case_file: CaseFile, tmp_path: Path) -> None:
    case = case_file(MINIMAL)
    assert cli.main(["run", "-q", "--no-figures", "-o", "driver", str(case)]) == 0
    run(case, "-o", "executable")
    assert contents(tmp_path / "executable") == contents(tmp_path / "driver")


def test_bad_case_does_not_stop_the_others(
    case_file: CaseFile, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bad, good, last = (
        str(case_file(text, f"{name}.nml"))
        for name, text in (("bad", "&ball"), ("good", MINIMAL), ("last", MINIMAL))
    )
    run = ["run", "-q", "--no-figures", "-o", "all"]
    assert cli.main([*run, bad, "nowhere.nml", good, last]) == 1
    assert names_in(tmp_path / "all") == ["good", "last"]
    assert (tmp_path / "all/good/summary.nml").exists()
    errors = capsys.readouterr().err
    assert re.search(naming(bad, "&ball", "line 1"), errors)
    assert "nowhere.nml" in errors


@pytest.mark.parametrize(
    ("text", "check", "code"),
    [
        (MINIMAL, False, 0), (MINIMAL, True, 3), ("&ball", True, 1),
        ("&ball / &drop height = 5000 / &model /", True, 2),
    ],
)  # fmt: skip
def test_exit_codes_are_those_of_the_executable(
    run: Run, case_file: CaseFile, text: str, code: int, *, check: bool
) -> None:
    arguments = ["--quiet", *(["--check"] if check else []), str(case_file(text))]
    assert cli.main(["run", "--no-figures", *arguments]) == code
    assert run(*arguments).returncode == code  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    "words", [["concrete 140"], ["inputs.toml"], ["no ending", "Concrete 140"]]
)
def test_name_of_a_construction_is_a_floor(words: list[str], tmp_path: Path) -> None:
    source = next((REPOSITORY / "inputs/constructions").glob("*15.toml"))
    (tmp_path / "inputs.toml").write_bytes(source.read_bytes())
    (tmp_path / "no ending").write_text(f"{MINIMAL}&room volume = 40 /")
    assert cli.main(["predict", "-q", *words]) == 0
    assert (tmp_path / "outputs/prediction").is_dir()


def test_unsaved_file_is_named(case_file: CaseFile, tmp_path: Path, errors_of: ErrorsOf) -> None:
    case = str(case_file(MINIMAL))
    assert cli.main(["run", "-q", "-o", "old", case]) == 0
    (tmp_path / "old/force.svg").unlink()
    (tmp_path / "old/force.svg").mkdir()
    assert "old/force.svg" in errors_of("run", "-q", case, "-o", "old")


# All of them write to standard output; runs of two cases are told once.
@pytest.mark.parametrize(
    ("arguments", "unbuffered"),
    [("--version", "1"), ("fit --help", ""), *(("run --no-figures a.nml b.nml", u) for u in "01")],
)
def test_full_screen_is_told_in_one_sentence(
    arguments: str, unbuffered: str, case_file: CaseFile, tmp_path: Path
) -> None:
    for name in ("a.nml", "b.nml"):
        case_file(MINIMAL, name)
    environment = {**os.environ, "PYTHONUNBUFFERED": unbuffered.strip("0")}
    command = [sys.executable, "-m", "thud", *arguments.split()]
    with Path("/dev/full").open("w", encoding="utf-8") as screen:
        done = subprocess.run(
            command, cwd=tmp_path, env=environment, check=False, text=True, stdout=screen,
            stderr=subprocess.PIPE,
        )  # fmt: skip
    assert done.returncode == 1
    assert done.stderr.count("standard output") == 1
    assert "Traceback" not in done.stderr
    assert "ignored" not in done.stderr


@pytest.mark.parametrize("start", [["thud-driver"], [sys.executable, "-P", "-m", "thud"]])
def test_files_named_as_modules_of_python_are_not_imported(
    start: list[str], case_file: CaseFile, executable: str, tmp_path: Path
) -> None:
    case = case_file(MINIMAL)
    for name in ("types", "numpy", "signal", "f90nml"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit(9)")
    if start == ["thud-driver"]:
        start = [str(Path(executable).with_name("thud-driver"))]
    command = [*start, "run", "-q", "--no-figures", str(case)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "outputs/case/force.csv").exists()


def test_screen_without_letters_shows_their_codes(case_file: CaseFile, tmp_path: Path) -> None:
    case_file(MINIMAL, "é.nml")
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    done = python("-m", "thud", "run", "é.nml", "--no-figures", cwd=tmp_path, env=environment)
    assert (done.returncode, done.stderr.count("Traceback")) == (0, 0)
    assert "Results: outputs/\\xe9" in done.stdout
