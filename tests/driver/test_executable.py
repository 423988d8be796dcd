"""The executable: results, exit codes, and a clear sentence for every bad input."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

import f90nml
import numpy as np
import pytest
from conftest import INPUTS, MINIMAL

import thud

if TYPE_CHECKING:
    from collections.abc import Callable

    Run = Callable[..., subprocess.CompletedProcess[str]]
    CaseFile = Callable[..., Path]

FILES = ["effective.nml", "force.csv", "levels.csv", "summary.nml"]


def read_bytes(directory: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in directory.iterdir()}


IMPACTS = [path for path in INPUTS if "&model" in path.read_text()]


@pytest.mark.parametrize("path", IMPACTS, ids=lambda path: path.stem)
def test_every_input_runs_and_agrees_with_the_driver(run: Run, tmp_path: Path, path: Path) -> None:
    result = run(path)
    assert result.returncode == 0, result.stderr
    directory = tmp_path / "outputs" / path.stem
    impact = thud.solve_case(thud.read_case(path))
    more = ["channels.csv"] if impact.channels else []
    frames = len(impact.motion.time) if impact.motion else 0
    shots = [f"motion_{i + 1:05}.vtu" for i in range(frames)]
    shots += ["motion.pvd", "pressure.csv"] if frames else []
    assert sorted(file.name for file in directory.iterdir()) == sorted(FILES + more + shots)
    for name in more:
        table = np.genfromtxt(directory / name, delimiter=",", names=True)
        for channel, values in impact.channels.items():
            assert np.array_equal(table[channel], values)

    columns = np.genfromtxt(directory / "force.csv", delimiter=",", names=True)
    # The same library: not one bit may differ.
    assert np.array_equal(columns["elastic_force_N"], impact.elastic_force)
    assert np.array_equal(columns["floor_force_N"], impact.floor_force)
    assert impact.parts
    for name, part in impact.parts.items():
        assert np.array_equal(columns[f"{name}_N"], part)
    assert np.array_equal(columns["deflection_m"], impact.deflection)
    assert np.array_equal(columns["velocity_m_per_s"], impact.velocity)
    assert np.array_equal(columns["time_s"], impact.time)
    summary = f90nml.read(directory / "summary.nml")
    for key in ("contact_time", "peak_force", "restitution", "impulse", "max_deflection"):
        assert summary["summary"][key] == getattr(impact, key)
    criteria = impact.conformity().criteria
    assert summary["verdict"]["value"] == [criterion.value for criterion in criteria]
    assert summary["verdict"]["met"] == [criterion.conforms for criterion in criteria]
    levels = np.genfromtxt(directory / "levels.csv", delimiter=",", names=True, dtype=None)
    assert np.array_equal(levels["elastic_level_dB"], impact.levels(force="elastic"))
    assert np.array_equal(levels["floor_level_dB"], impact.levels(force="floor"))


def test_effective_input_gives_the_same_bytes(
    run: Run, case_file: CaseFile, tmp_path: Path
) -> None:
    case = case_file("&ball mass = 2.47 /\n&drop /\n&model /\n&levels bands = 'both' /\n")
    assert run(case, "--output", "first").returncode == 0
    assert run("first/effective.nml", "--output", "second").returncode == 0
    assert read_bytes(tmp_path / "first") == read_bytes(tmp_path / "second")
    # And in its own place, which belongs to the same case.
    before = read_bytes(tmp_path / "first")
    assert run("first/effective.nml", "--output", "first").returncode == 0
    assert read_bytes(tmp_path / "first") == before


@pytest.mark.parametrize(("bands", "count"), [("octave", 5), ("third", 15), ("both", 20)], ids=str)
def test_bands_are_those_asked_for(
    run: Run, case_file: CaseFile, tmp_path: Path, bands: str, count: int
) -> None:
    assert run(case_file(f"{MINIMAL}&levels bands = '{bands}' /"), "-o", "out").returncode == 0
    lines = (tmp_path / "out/levels.csv").read_text().splitlines()[1:]
    assert len(lines) == count
    assert sum(line.startswith("octave") for line in lines) == count % 15
    assert sum(line.endswith("no limit") for line in lines) == count - count % 15


def test_verdict_is_on_the_force_asked_for(run: Run, case_file: CaseFile, tmp_path: Path) -> None:
    run(case_file(f"{MINIMAL}&levels force = 'floor' /"), "-o", "out")
    verdict = f90nml.read(tmp_path / "out/summary.nml")["verdict"]
    assert verdict["level_force"] == "floor"
    expected = thud.solve().levels(force="floor")
    assert verdict["value"][:5] == expected.tolist()


def test_check_tells_by_the_exit_code(run: Run, case_file: CaseFile) -> None:
    assert run(case_file(MINIMAL), "--check").returncode == 3
    assert run(case_file(MINIMAL)).returncode == 0


def test_quiet_shows_nothing(run: Run, case_file: CaseFile) -> None:
    result = run(case_file(MINIMAL), "--quiet")
    assert (result.returncode, result.stdout, result.stderr) == (0, "", "")


def test_help_version_and_keys(run: Run, case_file: CaseFile) -> None:
    assert "Usage: thud CASE.nml" in run("--help").stdout
    assert run("--version").stdout.strip() == f"thud {thud.__version__}"
    keys = run("--keys")
    assert keys.returncode == 0
    # The description is itself a valid input.
    assert run(case_file(keys.stdout)).returncode == 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "no case is given"),
        (["--what"], "'--what' is not a known option"),
        (["a.nml", "b.nml"], "'b.nml' is a second case"),
        (["a.nml", "--output"], "--output has no value"),
        (["a.nml", "--output", ""], "--output has no value"),
        (["missing.nml"], "missing.nml: there is no such file"),
        ([""], "there is no such file"),
        (["."], ".: this is a directory"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_bad_usage_is_told(run: Run, arguments: list[str], words: str) -> None:
    result = run(*arguments)
    assert result.returncode == 1
    assert words in result.stderr
    assert result.stdout == ""


BAD_CASES = {
    "missing group": ("&ball /\n&drop /", "&model is missing"),
    "unterminated group": ("&ball /\n&drop\n&model /", "&drop in line 2 is not terminated"),
    "unterminated last group": ("&ball /\n&drop /\n&model", "&model in line 3 is not terminated"),
    "unknown group": (f"{MINIMAL}&floor /", "&floor in line 4 is not a known group"),
    "unknown key": (f"{MINIMAL}&sampling rate = 1 /", "&sampling: rate in line 4 is not a known"),
    "wrong type": ("&ball mass = 'heavy' / &drop / &model /", "&ball: mass = 'heavy' is not a num"),
    "two values": ("&ball mass = 1 2 / &drop / &model /", "&ball: mass = 1 2 is not a number"),
    "unit in the value": ("&ball mass = 2.5 kg / &drop / &model /", "&ball: mass = 2.5 kg is not"),
    "decimal comma": ("&ball mass = 2,5 / &drop / &model /", "&ball: mass = 2,5 is not a number"),
    "nan": ("&ball mass = nan / &drop / &model /", "&ball: mass = NaN is not allowed"),
    "infinite": ("&ball mass = 1e999 / &drop / &model /", "&ball: mass = "),
    "zero radius": ("&ball outer_radius = 0 / &drop / &model /", "&ball: outer_radius = 0.0 is"),
    "negative mass": ("&ball mass = -2.5 / &drop / &model /", "&ball: mass = -2.5 is not allowed"),
    "zero modulus": ("&ball youngs_modulus = 0 / &drop / &model /", "&ball: youngs_modulus = 0.0"),
    "zero height": ("&ball / &drop height = 0 / &model /", "&drop: height = 0.0 is not allowed"),
    "thick wall": (
        "&ball wall_thickness = 0.1 / &drop / &model /",
        "&ball: wall_thickness = 0.1 is not allowed; allowed: 0 < wall_thickness < 0.089 m",
    ),
    "poisson": (
        "&ball poisson_ratio = 0.6 / &drop / &model /",
        "&ball: poisson_ratio = 0.6 is not allowed; allowed: -1 < poisson_ratio <= 0.5",
    ),
    "sample rate": (
        f"{MINIMAL}&sampling sample_rate = 1e12 /",
        "&sampling: sample_rate = 1.0e12 is not allowed; allowed: 2000 <= sample_rate",
    ),
    "duration": (f"{MINIMAL}&sampling duration = -1 /", "&sampling: duration = -1.0 is not"),
    "short record": (f"{MINIMAL}&sampling duration = 0.01 /", "&sampling: duration = 0.01 s ends"),
    "memory": (
        f"{MINIMAL}&sampling sample_rate = 1e7 duration = 10 /",
        "&sampling: duration = 10.0 s at sample_rate",
    ),
    "time": (
        f"{MINIMAL}&sampling sample_rate = 1e6 duration = 4 substeps = 9999 /",
        "&sampling: substeps = 9999",
    ),
    "unknown model": ("&ball / &drop / &model name = 'cube' /", "allowed: 'hollow_sphere'"),
    "empty file": ("", "the file is empty"),
    "null value": ("&ball mass = 1* / &drop / &model /", "&ball: mass = 1* is not a number"),
    "bare exponent": ("&ball / &drop height = 1+3 / &model /", "&drop: height = 1+3 is not a num"),
    "long name": (f"&case name = '{'x' * 129}' / {MINIMAL}", "is not short text in quotes"),
    "foreign options": (f"{MINIMAL}&hunt_crossley /", "&hunt_crossley in line 4 does nothing"),
    "huge file": ("! " + 70000 * "x", "the file is too large"),
    "binary file": ("\x7fELF\x00\x01", "line 1"),
    "text": ("Dear Sir or Madam,", "line 1 stands outside a group"),
}


@pytest.mark.parametrize(("text", "words"), BAD_CASES.values(), ids=BAD_CASES)
def test_bad_input_is_told(
    run: Run, case_file: CaseFile, tmp_path: Path, text: str, words: str
) -> None:
    result = run(case_file(text))
    assert result.returncode == 1
    assert f"thud: {tmp_path}/case.nml: " in result.stderr
    assert words in result.stderr
    assert "; allowed: " in result.stderr
    assert len(result.stderr.splitlines()) == 1
    assert not (tmp_path / "outputs").exists()


def test_closing_shell_is_a_numerical_failure(run: Run, case_file: CaseFile) -> None:
    result = run(case_file("&ball / &drop height = 5000 / &model /"))
    assert result.returncode == 2
    assert "&drop: height = 5000.0 m closes the shell" in result.stderr


def test_case_of_another_name_is_not_overwritten(
    run: Run, case_file: CaseFile, tmp_path: Path
) -> None:
    run(case_file(MINIMAL, "one.nml"), "-o", "out")
    before = read_bytes(tmp_path / "out")
    result = run(case_file(MINIMAL, "two.nml"), "-o", "out")
    assert result.returncode == 1
    assert "--output out holds files of something else" in result.stderr
    assert read_bytes(tmp_path / "out") == before


def test_files_of_somebody_else_are_not_joined(
    run: Run, case_file: CaseFile, tmp_path: Path
) -> None:
    result = run(case_file(MINIMAL), "-o", ".")
    assert result.returncode == 1
    assert [path.name for path in tmp_path.iterdir()] == ["case.nml"]


def test_changed_input_of_the_same_case_replaces_its_results(
    run: Run, case_file: CaseFile, tmp_path: Path
) -> None:
    run(case_file(MINIMAL))
    result = run(case_file("&ball mass = 2.4 / &drop / &model /"))
    assert result.returncode == 0
    assert "mass" in (tmp_path / "outputs/case/effective.nml").read_text()
    assert "2.4 " in (tmp_path / "outputs/case/effective.nml").read_text()
    # Not silently: another input of the same name may have been meant.
    assert "replaces" in result.stderr


@pytest.mark.parametrize("place", ["/dev/null/out", "case.nml/out", "case.nml", "/proc/out"])
def test_directory_that_cannot_be_made_is_told(run: Run, case_file: CaseFile, place: str) -> None:
    result = run(case_file(MINIMAL), "-o", place)
    assert result.returncode == 1
    assert f"--output {place}" in result.stderr
    assert "; allowed: " in result.stderr


def test_stale_figures_do_not_stand_beside_new_results(
    run: Run, case_file: CaseFile, tmp_path: Path
) -> None:
    run(case_file(MINIMAL))
    figure = tmp_path / "outputs/case/force.png"
    figure.write_text("drawn from the old results")
    run(case_file(MINIMAL))
    assert figure.exists()
    run(case_file("&ball mass = 2.4 / &drop / &model /"))
    assert not figure.exists()


def test_killed_run_does_not_lock_its_directory(
    run: Run, case_file: CaseFile, tmp_path: Path
) -> None:
    left = tmp_path / "outputs/case/.force.csv.part"
    left.parent.mkdir(parents=True)
    left.write_text("half a fi")
    assert run(case_file(MINIMAL)).returncode == 0
    assert sorted(path.name for path in left.parent.iterdir()) == FILES


def test_runs_into_one_directory_do_not_mix(
    executable: str, case_file: CaseFile, tmp_path: Path
) -> None:
    for height in ("1.0", "0.3"):
        (tmp_path / height).mkdir()
        case_file(f"&ball / &drop height = {height} / &model /", f"{height}/case.nml")
    for _ in range(20):
        running = [
            subprocess.Popen([executable, f"{height}/case.nml", "-q", "-o", "o"], cwd=tmp_path)
            for height in ("1.0", "0.3")
        ]
        assert [process.wait() for process in running] == [0, 0]
        height = f90nml.read(tmp_path / "o/effective.nml")["drop"]["height"]
        summary = f90nml.read(tmp_path / "o/summary.nml")
        assert summary["verdict"]["value"][-1] == height


def test_pipe_as_input_is_told(run: Run, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    result = run("pipe")
    assert result.returncode == 1
    assert "pipe: the file is empty or not a regular file" in result.stderr


def test_closed_pipe_is_an_error_without_a_crash(executable: str, tmp_path: Path) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    result = subprocess.run([executable, "--keys"], stdout=writer, cwd=tmp_path, check=False)
    os.close(writer)
    assert result.returncode == 1


def test_full_disk_leaves_nothing(run: Run, case_file: CaseFile, tmp_path: Path) -> None:
    def limit_file_size() -> None:
        # Files may grow to 100 kB, force.csv needs more; the write fails as on a full disk.
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))

    result = run(case_file(MINIMAL), preexec_fn=limit_file_size)
    assert result.returncode == 1
    assert "cannot be written" in result.stderr
    assert not (tmp_path / "outputs/case").exists()


@pytest.mark.skipif(os.geteuid() == 0, reason="everything is writable for root")
def test_unwritable_directory_is_told(run: Run, case_file: CaseFile, tmp_path: Path) -> None:
    (tmp_path / "locked").mkdir(mode=0o500)
    result = run(case_file(MINIMAL), "-o", "locked/out")
    assert result.returncode == 1
    assert "--output locked/out cannot be made" in result.stderr


def test_full_screen_is_an_error_without_a_crash(
    executable: str, case_file: CaseFile, tmp_path: Path
) -> None:
    with Path("/dev/full").open("w") as full:
        result = subprocess.run(
            [executable, str(case_file(MINIMAL))],
            cwd=tmp_path,
            stdout=full,
            stderr=subprocess.PIPE,
            check=False,
        )
    assert result.returncode == 1


def test_characters_that_no_screen_shows_are_replaced(run: Run, case_file: CaseFile) -> None:
    path = case_file(MINIMAL.replace("&model", "&model name = 'a\x00b\x07'"))
    result = run(path)
    assert result.returncode == 1
    assert "&model: name = 'a?b?' is not allowed; allowed: 'hollow_sphere'" in result.stderr
    with pytest.raises(thud.InputError, match=r"'a\?b\?' is not allowed; allowed: "):
        thud.read_case(path)
