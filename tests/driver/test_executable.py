"""The executable: results, exit codes, and a clear sentence for every bad input."""

from __future__ import annotations

import dataclasses
import os
import re
import shlex
import signal
import subprocess
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import f90nml
import numpy as np
import pytest
from conftest import INPUTS, MINIMAL, RESULT_FILES, contents, names_in, naming

import thud

if TYPE_CHECKING:
    from conftest import CaseFile, Run


ELEMENTS = "&model name = 'finite_element' /\n&mesh radial_elements = 2, polar_elements = 24 /\n"
CASES: list[Any] = [
    f"{ELEMENTS}&output snapshot_interval = 1e-3 /\n&floor name = 'oscillator' /\n",
    "&ball /\n&drop /\n&model /\n&floor name = 'infinite_plate' /\n",
    *(pytest.param(path, marks=pytest.mark.slow, id=path.stem)
      for path in INPUTS if "&model" in path.read_text()),
]  # fmt: skip


def same(one: object, other: object) -> bool:
    """Return whether two results agree in every bit."""
    if dataclasses.is_dataclass(one):
        names = [field.name for field in dataclasses.fields(one)]
        return all(same(getattr(one, name), getattr(other, name)) for name in names)
    if isinstance(one, dict):
        assert isinstance(other, dict)
        return one.keys() == other.keys() and all(same(one[key], other[key]) for key in one)
    return np.array_equal(one, other)  # type: ignore[arg-type]


@pytest.mark.parametrize("case", CASES)
def test_results_are_those_of_the_driver_to_the_last_bit(
    run: Run, case_file: CaseFile, tmp_path: Path, case: str | Path
) -> None:
    path = case_file(case) if isinstance(case, str) else case
    result = run(path, "--all")
    assert result.returncode == 0, result.stderr
    directory = tmp_path / "outputs" / path.stem
    impact = thud.solve(thud.read_case(path))
    more = ["model_histories.csv"] if impact.model_histories else []
    more += ["snapshots.csv"] if impact.motion else []
    if impact.on_floor:
        more += [f"floor_{name}" for name in ("force.csv", "levels.csv", *more)]
    assert names_in(directory) == sorted(RESULT_FILES + more)
    assert same(thud.read_results(directory), impact)
    summary = f90nml.read(directory / "summary.nml")
    assert summary["summary"]["peak_force"] == impact.peak_force
    criteria = impact.assess().criteria
    assert summary["verdict"]["value"] == [criterion.value for criterion in criteria]
    assert summary["verdict"]["met"] == [criterion.conforms == "conforms" for criterion in criteria]
    levels = np.genfromtxt(directory / "levels.csv", delimiter=",", names=True, dtype=None)
    assert np.array_equal(levels["elastic_level_dB"], impact.levels(force="elastic"))
    assert np.array_equal(levels["floor_level_dB"], impact.levels(force="floor"))


def test_effective_input_gives_the_same_bytes(
    run: Run, case_file: CaseFile, tmp_path: Path
) -> None:
    case = case_file("&ball mass = 2.47 /\n&drop /\n&model /\n&levels bands = 'both' /\n")
    assert run(case, "--output", "first").returncode == 0
    assert run("first/effective.nml", "--output", "second").returncode == 0
    assert contents(tmp_path / "first") == contents(tmp_path / "second")
    # An input is never replaced.
    assert run("first/effective.nml", "--output", "first").returncode == 1


@pytest.mark.parametrize(("bands", "count"), [("octave", 5), ("third", 15), ("both", 20)], ids=str)
def test_bands_are_those_asked_for(
    run: Run, case_file: CaseFile, tmp_path: Path, bands: str, count: int
) -> None:
    assert run(case_file(f"{MINIMAL}&levels bands = '{bands}' /"), "-o", "out").returncode == 0
    lines = (tmp_path / "out/levels.csv").read_text().splitlines()[1:]
    assert len(lines) == count
    assert sum(line.startswith("octave") for line in lines) == count % 15
    assert sum(line.endswith("no limit") for line in lines) == count - count % 15


# A ball so soft that the wall which comes to rest makes a force of its own, and a spring.
@pytest.mark.parametrize(("model", "title"), [
    ("&ball youngs_modulus = 1.6e5, ambient_pressure = 0 / &sampling duration = 0.3 /"
     + MINIMAL.partition("/")[2].partition("/")[2], ["elastic", "force"]),
    ("&ball / &model name = 'hunt_crossley' / &hunt_crossley contact_time = 0.02 /", []),
])  # fmt: skip
@pytest.mark.filterwarnings("ignore::thud.PlausibilityWarning")
def test_other_force_is_shown_where_it_differs(
    run: Run, case_file: CaseFile, tmp_path: Path, model: str, title: list[str]
) -> None:
    path = case_file(f"&drop / &levels force = 'floor' / {model}")
    table = run(path).stdout
    header, *rows = table.splitlines()[2:8]
    assert header.split()[7:] == title
    impact = thud.solve(thud.read_case(path))
    verdict = f90nml.read(tmp_path / "outputs/case/summary.nml")["verdict"]
    assert verdict["level_force"] == "floor"
    assert verdict["value"][:5] == impact.levels(force="floor").tolist()
    assert re.search(rf"peak force +{impact.peak_force:.0f} N", table)
    levels = [impact.levels(force="floor"), impact.levels(force="elastic")][: 1 + len(title) // 2]
    shown = [re.findall(r"(-?\d+\.\d\d) dB", row) for row in rows]
    assert shown == [[f"{level:.2f}" for level in pair] for pair in zip(*levels, strict=True)]


def test_help_version_and_keys(run: Run, case_file: CaseFile) -> None:
    result = run(case_file(MINIMAL), "--quiet")
    assert (result.returncode, result.stdout, result.stderr) == (0, "", "")
    assert "Usage: thud CASE.nml" in run("--help").stdout
    assert run("--version").stdout.strip() == f"thud {thud.__version__}"
    keys = run("--keys")
    assert keys.returncode == 0
    # The description is itself a valid input.
    assert run(case_file(keys.stdout)).returncode == 0


@pytest.mark.parametrize(
    ("line", "word"),
    [("", "case"), ("--what", "'--what'"), ("a.nml b.nml", "'b.nml'"), ("a.nml -o", "-o"),
     ("a.nml --output ''", "--output"), ("missing.nml", "missing.nml"), ("''", "file"),
     (".", "directory"), ("pipe", "pipe")],
)  # fmt: skip
def test_bad_usage_is_refused(run: Run, tmp_path: Path, line: str, word: str) -> None:
    os.mkfifo(tmp_path / "pipe")
    result = run(*shlex.split(line))
    assert result.returncode == 1
    assert word in result.stderr.splitlines()[0]
    assert result.stdout == ""


@pytest.mark.parametrize("arguments", [["--keys"], ["case.nml"], ["case.nml", "--check"]])
def test_pipe_that_nobody_reads_is_no_failure(
    executable: str, case_file: CaseFile, tmp_path: Path, arguments: list[str]
) -> None:
    case_file(MINIMAL)
    reader, writer = os.pipe()
    os.close(reader)
    result = subprocess.run(
        [executable, *arguments], stdout=writer, stderr=subprocess.PIPE, cwd=tmp_path, check=False
    )
    os.close(writer)
    assert result.returncode == (3 if "--check" in arguments else 0)
    assert result.stderr == b""
    assert (tmp_path / "outputs/case/force.csv").exists() == (arguments[0] != "--keys")


@pytest.mark.parametrize("argument", ["case.nml", "--help"])
def test_full_screen_is_reported(
    executable: str, case_file: CaseFile, tmp_path: Path, argument: str
) -> None:
    case_file(MINIMAL)
    with Path("/dev/full").open("w") as full:
        result = subprocess.run(
            [executable, argument], cwd=tmp_path, stdout=full, stderr=subprocess.PIPE, text=True,
            check=False,
        )  # fmt: skip
    assert result.returncode == 1
    assert re.match(naming("standard output", "No space left on device"), result.stderr)


def test_closed_screen_is_no_failure(run: Run, case_file: CaseFile, tmp_path: Path) -> None:
    result = run(case_file(MINIMAL), preexec_fn=lambda: os.close(1))
    assert (result.returncode, result.stderr) == (0, "")
    # No file of the results had its number.
    assert "Results" not in (tmp_path / "outputs/case/effective.nml").read_text()


@pytest.mark.parametrize("ignored", [False, True], ids=["usual", "in the background"])
def test_interrupted_run_says_so(
    executable: str, case_file: CaseFile, tmp_path: Path, *, ignored: bool
) -> None:
    case = case_file(f"{MINIMAL}&sampling sample_rate = 2e5 duration = 1 substeps = 40 /")
    trap = "trap '' INT;" if ignored else ""
    command = ["/bin/sh", "-c", f"{trap} exec {executable} {case} -q"]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as process:
        time.sleep(0.1)
        process.send_signal(signal.SIGINT)
        said = process.communicate()[1]
    assert ("interrupted" in said) != ignored
    assert said.count("\n") == (0 if ignored else 1)
    assert process.returncode == (0 if ignored else 130)
    assert (tmp_path / "outputs/case").exists() == ignored


def test_name_that_is_no_text_is_refused(run: Run, case_file: CaseFile, tmp_path: Path) -> None:
    odd = os.fsdecode(b"\xff.nml")
    case_file(MINIMAL, odd)
    result = run(odd, errors="surrogateescape")
    assert result.returncode == 1
    assert re.search(naming("&case: name", "'?'", "UTF-8"), result.stderr)
    assert not (tmp_path / "outputs").exists()
    # A name in the file is enough.
    case_file(f"&case name = 'ball' / {MINIMAL}", odd)
    assert run(odd, errors="surrogateescape").returncode == 0


def test_advice_for_a_heavily_damped_contact_helps(run: Run, case_file: CaseFile) -> None:
    def solve(sample_rate: float, substeps: int) -> subprocess.CompletedProcess[str]:
        case_file(
            f"&ball / &drop / &sampling sample_rate = {sample_rate} substeps = {substeps} / "
            "&model name = 'hunt_crossley' / &hunt_crossley damping = 100 stiffness = 1e12 /"
        )
        return run("case.nml")

    substeps, advice = 1, []
    while "substeps" in (done := solve(44100, substeps)).stderr:
        # No rate is named before the steps give the contact its true time.
        advice.append(re.sub(r": the (balance|motion).*", "", done.stderr))
        substeps *= 4
    assert re.search(naming("sample_rate", "44100.0 Hz"), done.stderr)
    assert solve(1e6, substeps).returncode == 0
    assert len(set(advice)) == 1
    assert "substeps" in advice[0]
