"""Directories of results: one whole set of files at a time; other files are the user's."""

from __future__ import annotations

import errno
import os
import random
import re
import resource
import shutil
import signal
import stat
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from typing import TYPE_CHECKING

import pytest
from conftest import MINIMAL, REPOSITORY, RESULT_FILES, contents, names_in, naming

import thud
from thud.base.errors import PlausibilityWarning
from thud.base.files import FIRST_LINE, TEMPORARY, Results, locked, unique_path

sys.path.insert(0, str(REPOSITORY / "tests/faults"))
from injection import can_inject, injecting

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from conftest import CaseFile, Run

    TwoInputs = dict[str, dict[str, bytes]]

OTHER = "&ball mass = 2.4 / &drop / &model / &modes count = 1 /"


@pytest.fixture
def two_inputs(run: Run, case_file: CaseFile, tmp_path: Path) -> TwoInputs:
    """Return the sets of files of two inputs of one name, a/case.nml and b/case.nml."""
    found = {}
    for name, text in (("a", MINIMAL), ("b", OTHER)):
        (tmp_path / name).mkdir()
        case_file(text, f"{name}/case.nml")
        assert run(f"{name}/case.nml", "-o", f"only_{name}").returncode == 0
        found[name] = contents(tmp_path / f"only_{name}")
    # One of them has a file that the other one has not.
    assert set(found["a"]) < set(found["b"])
    return found


@pytest.fixture
def out(run: Run, two_inputs: TwoInputs, tmp_path: Path) -> Path:
    """Return the directory of the results of a/case.nml."""
    del two_inputs  # it writes the inputs
    assert run("a/case.nml").returncode == 0
    return tmp_path / "outputs/case"


def test_case_of_another_name_is_not_overwritten(
    run: Run, case_file: CaseFile, tmp_path: Path
) -> None:
    run(case_file(MINIMAL, "one.nml"), "-o", "out")
    before = contents(tmp_path / "out")
    result = run(case_file(MINIMAL, "two.nml"), "-o", "out")
    assert result.returncode == 1
    assert "--output out" in result.stderr
    assert contents(tmp_path / "out") == before


def test_files_of_somebody_else_are_not_joined(
    run: Run, case_file: CaseFile, tmp_path: Path
) -> None:
    result = run(case_file(MINIMAL), "-o", ".")
    assert result.returncode == 1
    assert names_in(tmp_path) == ["case.nml"]


def test_changed_input_of_the_same_case_replaces_its_results(
    run: Run, two_inputs: TwoInputs, tmp_path: Path
) -> None:
    for name in "abba":
        result = run(f"{name}/case.nml")
        assert result.returncode == 0
        assert contents(tmp_path / "outputs/case") == two_inputs[name]
    # Not silently: another input of the same name may have been meant.
    assert "a/case.nml" in result.stderr


@pytest.mark.parametrize("place", ["/dev/null/out", "case.nml/out", "case.nml", "/proc/out"])
def test_directory_that_cannot_be_made_is_told(run: Run, case_file: CaseFile, place: str) -> None:
    result = run(case_file(MINIMAL), "-o", place)
    assert result.returncode == 1
    assert f"--output {place}" in result.stderr


@pytest.mark.parametrize("place", ["deep/er/out", "out/", ".//out///", "link", "link/", "link/out"])
def test_any_path_of_a_directory_works(
    run: Run, two_inputs: TwoInputs, tmp_path: Path, place: str
) -> None:
    (tmp_path / "behind/it").mkdir(parents=True)
    (tmp_path / "link").symlink_to("behind/it")
    for name in "ab":
        assert run(f"{name}/case.nml", "-q", "-o", place).returncode == 0
        assert contents(tmp_path / place) == two_inputs[name]
    assert (tmp_path / "link").is_symlink()
    assert not list(tmp_path.rglob("*.part"))


def test_working_directory_works(
    run: Run, executable: str, two_inputs: TwoInputs, tmp_path: Path
) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    before = folder.stat().st_ino
    for name in "abba":
        command = [executable, tmp_path / f"{name}/case.nml", "-q", "-o", "."]
        assert subprocess.run(command, cwd=folder, check=False).returncode == 0
        assert contents(folder) == two_inputs[name]
    # Whoever stands in it still does.
    assert folder.stat().st_ino == before
    assert run("a/case.nml", "-q", "-o", "out").returncode == 0


@pytest.mark.parametrize("folder", [False, True], ids=["exchanged", "moved"])
def test_files_of_the_user_survive(
    run: Run, two_inputs: TwoInputs, out: Path, *, folder: bool
) -> None:
    mine = {"notes.txt": b"mine", "force.png": b"drawn by hand"}
    for name, content in mine.items():
        (out / name).write_bytes(content)
    if folder:
        (out / "more/notes").mkdir(parents=True)
    for name in "baab":
        assert run(f"{name}/case.nml").returncode == 0
        if folder:
            (out / "more/notes").rmdir()
            (out / "more").rmdir()
        assert contents(out) == {**two_inputs[name], **mine}
        if folder:
            (out / "more/notes").mkdir(parents=True)
    assert names_in(out.parent) == ["case"]


@pytest.mark.parametrize("mode", [0o700, 0o755, 0o2775, 0o1777])
def test_permissions_of_the_directory_stay(
    run: Run, case_file: CaseFile, tmp_path: Path, mode: int
) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out").chmod(mode)
    for _ in range(2):
        assert run(case_file(MINIMAL), "-o", "out").returncode == 0
        assert stat.S_IMODE((tmp_path / "out").stat().st_mode) == mode


def test_stale_figures_do_not_stand_beside_new_results(
    run: Run, two_inputs: TwoInputs, out: Path
) -> None:
    Results(out).write({"force.png": b"drawn from the old results"})
    # A kill has left half a figure.
    (out / ".thud.new").write_bytes(b"ha")
    for _ in range(2):
        run("a/case.nml")
        assert names_in(out) == sorted([*two_inputs["a"], "force.png"])
    run("b/case.nml")
    assert contents(out) == two_inputs["b"]


def test_figures_are_not_added_to_results_of_another_input(
    run: Run, two_inputs: TwoInputs, tmp_path: Path
) -> None:
    out = tmp_path / "outputs/case"
    run("b/case.nml")
    with pytest.raises(thud.InputError, match=naming(out)):
        Results(out).write({"force.png": b""}, marker=two_inputs["a"]["effective.nml"])
    assert contents(out) == two_inputs["b"]
    Results(out).write({"force.png": b""}, marker=two_inputs["b"]["effective.nml"])
    assert names_in(out) == sorted([*two_inputs["b"], "force.png"])


def test_unfinished_figures_go_where_there_are_no_locks(
    run: Run, two_inputs: TwoInputs, out: Path
) -> None:
    part = unique_path(out / TEMPORARY)
    mine = out / f"{TEMPORARY}s"
    part.write_bytes(b"half a figure")
    mine.write_bytes(b"mine")
    assert run("a/case.nml").returncode == 0
    assert names_in(out) == sorted([*two_inputs["a"], mine.name])


@pytest.mark.parametrize("more", [[], ["--replace"]])
def test_directory_of_the_name_of_the_manifest_is_named_as_such(
    run: Run, case_file: CaseFile, tmp_path: Path, more: list[str]
) -> None:
    (tmp_path / "out/.thud").mkdir(parents=True)
    result = run(case_file(MINIMAL), "-o", "out", *more)
    assert result.returncode == 1
    assert re.search(naming("out/.thud", "directory"), result.stderr)
    assert "--replace" not in result.stderr


@pytest.mark.skipif(not can_inject(), reason="there is no C compiler")
def test_signal_during_a_checksum_changes_nothing(
    run: Run, case_file: CaseFile, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = case_file(MINIMAL)
    assert run(case, "-o", "out").returncode == 0
    before = contents(tmp_path / "out")
    levels = tmp_path / "out/levels.csv"
    for number in range(1, 9):
        faults = injecting(calls="read", action=errno.EINTR, under=levels, log="calls", at=number)
        for name, value in faults.items():
            monkeypatch.setenv(name, value)
        result = run(case, "-o", "out")
        assert result.returncode == 0, result.stderr
        assert contents(tmp_path / "out") == before
    assert (tmp_path / "calls").read_text()


def test_killed_run_does_not_lock_its_directory(
    run: Run, case_file: CaseFile, tmp_path: Path
) -> None:
    left = tmp_path / "outputs/.case.part"
    left.mkdir(parents=True)
    (left / ".thud").write_text(f"{FIRST_LINE}\nforce.csv\n")
    (left / "force.csv").write_text("half a fi")
    assert run(case_file(MINIMAL)).returncode == 0
    assert names_in(tmp_path / "outputs/case") == RESULT_FILES
    assert names_in(tmp_path / "outputs") == ["case"]


def test_runs_into_one_directory_do_not_mix(
    executable: str, two_inputs: TwoInputs, tmp_path: Path
) -> None:
    mine: dict[str, bytes] = {}
    for i in range(15):
        running = [
            subprocess.Popen([executable, f"{name}/case.nml", "-q", "-o", "o"], cwd=tmp_path,
                             stderr=subprocess.DEVNULL)
            for name in "aba"
        ]  # fmt: skip
        assert [process.wait() for process in running] == [0, 0, 0]
        found = contents(tmp_path / "o")
        assert found in [{**files, **mine} for files in two_inputs.values()]
        mine[f"notes_{i}"] = b"mine"
        (tmp_path / f"o/notes_{i}").write_bytes(b"mine")
    assert not (tmp_path / ".o.part").exists()


def test_figures_are_added_while_others_write(
    executable: str, two_inputs: TwoInputs, tmp_path: Path
) -> None:
    subprocess.run([executable, "a/case.nml", "-q", "-o", "o"], cwd=tmp_path, check=True)
    command = f"for i in 1 2 3 4 5 6 7 8 9; do {executable} a/case.nml -q -o o; done"
    added = 0
    with subprocess.Popen(["/bin/sh", "-c", command], cwd=tmp_path) as process:
        while process.poll() is None:
            Results(tmp_path / "o").write({f"{added}.png": b"figure"})
            added += 1
    assert process.returncode == 0
    figures = [f"{i}.png" for i in range(added)]
    assert names_in(tmp_path / "o") == sorted([*two_inputs["a"], *figures])


@pytest.fixture
def chance() -> random.Random:
    return random.Random(1)  # noqa: S311 - nothing secret


@pytest.mark.parametrize("place", ["exchanged", "moved"])
def test_killed_runs_leave_files_of_one_input(
    executable: str, two_inputs: TwoInputs, tmp_path: Path, place: str, chance: random.Random
) -> None:
    out = tmp_path / "o"
    out.mkdir()
    where = tmp_path if place == "exchanged" else out
    command = [executable, "", "-q", "-o", os.path.relpath(out, where)]
    command[1] = os.path.relpath(tmp_path / "a/case.nml", where)
    start = time.perf_counter()
    subprocess.run(command, cwd=where, check=True)
    usual = time.perf_counter() - start
    for i in range(80):
        command[1] = os.path.relpath(tmp_path / f"{'ab'[i % 2]}/case.nml", where)
        with subprocess.Popen(command, cwd=where, stderr=subprocess.DEVNULL) as process:
            time.sleep(usual * chance.random())
            process.kill()
        found = contents(out) if place == "exchanged" else results_of(out)
        if place == "exchanged":
            assert found in two_inputs.values()
        else:
            assert any(found.items() <= files.items() for files in two_inputs.values())
    subprocess.run(command, cwd=where, check=True)
    assert contents(out) == two_inputs["b"]
    assert not list(tmp_path.rglob("*.part"))


def results_of(folder: Path) -> dict[str, bytes]:
    """Return the files of a directory without the manifest and the workspace."""
    return {
        path.name: path.read_bytes()
        for path in folder.iterdir()
        if path.is_file() and path.name != ".thud"
    }


def test_full_disk_leaves_nothing(run: Run, case_file: CaseFile, tmp_path: Path) -> None:
    def limit_file_size() -> None:
        # Files may grow to 100 kB, force.csv needs more; the write fails as on a full disk.
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))

    result = run(case_file(MINIMAL), preexec_fn=limit_file_size)
    assert result.returncode == 1
    words = naming("--output outputs/case", "force.csv", "File too large")
    assert re.search(words, result.stderr)
    assert names_in(tmp_path / "outputs") == []


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """Return a disk of 600 kB, enough for one set of files."""
    place = tmp_path / "disk"
    place.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=600k", "tmpfs", str(place)]
    if (
        os.geteuid() != 0
        or not shutil.which("mount")
        or subprocess.run(command, capture_output=True, check=False).returncode
    ):
        pytest.skip("no disk can be mounted here")
    yield place
    subprocess.run(["umount", str(place)], check=True)  # noqa: S607


def test_full_disk_keeps_the_results_before(
    run: Run, two_inputs: TwoInputs, small_disk: Path
) -> None:
    assert run("a/case.nml", "-o", small_disk / "out").returncode == 0
    result = run("b/case.nml", "-o", small_disk / "out")
    assert result.returncode == 1
    assert "No space left on device" in result.stderr
    assert contents(small_disk / "out") == two_inputs["a"]
    assert names_in(small_disk) == ["out"]


def test_mounted_disk_works_as_directory(run: Run, two_inputs: TwoInputs, small_disk: Path) -> None:
    assert run("a/case.nml", "-o", small_disk).returncode == 0
    assert contents(small_disk) == two_inputs["a"]
    assert run("b/case.nml", "-o", small_disk).returncode == 1
    assert contents(small_disk) == two_inputs["a"]
    assert not (small_disk.parent / ".disk.part").exists()


@pytest.mark.skipif(os.geteuid() == 0, reason="everything is writable for root")
def test_unwritable_directories_are_told(run: Run, case_file: CaseFile, tmp_path: Path) -> None:
    case = case_file(MINIMAL)
    assert run(case, "-o", "locked/out").returncode == 0
    before = contents(tmp_path / "locked/out")
    (tmp_path / "locked").chmod(0o500)
    result = run(case, "-o", "locked/new")
    assert result.returncode == 1
    assert "--output locked/new" in result.stderr
    # The directory itself may be written to.
    assert run(case, "-o", "locked/out").returncode == 0
    (tmp_path / "locked").chmod(0o700)
    (tmp_path / "locked/out").chmod(0o500)
    result = run(case, "-o", "locked/out")
    assert result.returncode == 1
    assert "--output locked/out" in result.stderr
    assert contents(tmp_path / "locked/out") == before
    assert names_in(tmp_path / "locked") == ["out"]


def test_results_without_their_manifest_are_replaced_on_request(
    run: Run, two_inputs: TwoInputs, out: Path
) -> None:
    (out / ".thud").unlink()
    (out / "force.png").write_bytes(b"figure")
    before = contents(out)
    result = run("b/case.nml")
    assert result.returncode == 1
    assert "outputs/case/effective.nml" in result.stderr
    assert "--replace" in result.stderr
    assert contents(out) == before
    assert run("b/case.nml", "--replace").returncode == 0
    assert contents(out) == {**two_inputs["b"], "force.png": b"figure"}


@pytest.mark.parametrize("folder", [False, True], ids=["exchanged", "moved"])
def test_edited_results_are_the_users(
    run: Run, two_inputs: TwoInputs, tmp_path: Path, *, folder: bool
) -> None:
    out = tmp_path / "outputs/case"
    run("b/case.nml")
    if folder:
        (out / "more").mkdir()
    (out / "levels.csv").write_text("with my warnings")
    result = run("a/case.nml")
    assert result.returncode == 1
    assert "outputs/case/levels.csv" in result.stderr
    assert (out / "levels.csv").read_text() == "with my warnings"
    (out / "levels.csv").write_bytes(two_inputs["b"]["levels.csv"])
    # What the next input does not write is not in its way.
    (out / "modes.csv").write_text("with my warnings")
    assert run("a/case.nml").returncode == 0
    if folder:
        (out / "more").rmdir()
    assert contents(out) == {**two_inputs["a"], "modes.csv": b"with my warnings"}


def test_results_of_other_commands_stay_beside_those_of_any_input(
    run: Run, two_inputs: TwoInputs, out: Path
) -> None:
    measured = {"report.json": b"{}", "measured.png": b"figure"}
    Results(out, "measure").write(measured)
    for name in "bab":
        assert run(f"{name}/case.nml").returncode == 0
        found = contents(out)
        assert measured.items() <= found.items()
        assert found.keys() == {*two_inputs[name], *measured}
    assert [p.name for p in Results(out, "measure").write(measured)] == list(measured)


def test_results_are_repeated_from_their_own_input(
    run: Run, two_inputs: TwoInputs, out: Path
) -> None:
    assert run("outputs/case/effective.nml").returncode == 0
    assert contents(out) == two_inputs["a"]
    text = two_inputs["a"]["effective.nml"] + b"! mine\n"
    (out / "effective.nml").write_bytes(text)
    for more in ([], ["--replace"]):
        result = run("outputs/case/effective.nml", *more)
        assert result.returncode == 1
        assert "outputs/case/effective.nml" in result.stderr
        assert (out / "effective.nml").read_bytes() == text


def test_files_of_two_inputs_are_not_read_as_one(
    run: Run, two_inputs: TwoInputs, tmp_path: Path
) -> None:
    out = tmp_path / "outputs/case"
    for name in ("force.csv", "summary.nml", "effective.nml"):
        run("a/case.nml")
        assert thud.read_results(out).case.ball.mass == 2.5
        (out / name).write_bytes(two_inputs["b"][name])
        with pytest.raises(thud.InputError, match=naming(name)):
            thud.read_results(out)
        run("a/case.nml", "--replace")
    Results(out).write({"force.png": b"figure"})
    thud.read_results(out)


def test_results_without_their_manifest_are_read_with_a_warning(
    run: Run, case_file: CaseFile, tmp_path: Path
) -> None:
    run(case_file(MINIMAL))
    out = tmp_path / "outputs/case"
    whole = thud.read_results(out)
    (out / ".thud").unlink()
    with pytest.warns(PlausibilityWarning, match=naming("files")):
        found = thud.read_results(out)
    assert len(found.warnings) == len(whole.warnings) + 1


@pytest.mark.parametrize("excess", [0, 1])
def test_path_longer_than_the_system_allows_makes_nothing(
    run: Run, case_file: CaseFile, tmp_path: Path, excess: int
) -> None:
    # The zero at its end counts.
    length = os.pathconf("/", "PC_PATH_MAX") - 1 + excess
    path = "made/" + "/" * (length - 8) + "out"
    assert run(case_file(MINIMAL), "-q", "-o", path).returncode == excess
    assert (tmp_path / "made/out").exists() == (tmp_path / "made").exists() == (not excess)


def test_damaged_results_are_refused(run: Run, case_file: CaseFile, tmp_path: Path) -> None:
    run(case_file("&case name = 'it''s' /\n" + MINIMAL), "-o", "out")
    out = tmp_path / "out"
    assert thud.read_results(out).case.name == "it's"
    (out / ".thud").unlink()
    for name in ("effective.nml", "summary.nml"):
        content = (out / name).read_bytes()
        ends = {random.Random(0).randrange(len(content)) for _ in range(100)}  # noqa: S311
        # Behind a quotation mark, a sign and an exponent, too.
        for end in sorted(ends | {content.find(mark) + 1 for mark in (b"'", b"-", b"e")}):
            for damaged in (content[:end], content[:end] + b"'" + content[end:]):
                (out / name).write_bytes(damaged)
                with suppress(thud.InputError):
                    thud.read_results(out)
        (out / name).write_bytes(content)


def test_reader_waits_for_a_writer(run: Run, case_file: CaseFile, tmp_path: Path) -> None:
    run(case_file(MINIMAL))
    out = tmp_path / "outputs/case"
    with ThreadPoolExecutor(1) as reader:
        with locked(out):
            reading = reader.submit(thud.read_results, out)
            time.sleep(0.1)
            assert not reading.done()
        assert reading.result(20).contact_time > 0
