"""Directories of results: the old or the new ones as a whole; files of the user stay."""

from __future__ import annotations

import errno
import os
import re
import shutil
import stat
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import MINIMAL, REPOSITORY, contents, names_in, naming

import thud
from thud import cli
from thud.base.files import Results, replace_file

sys.path.insert(0, str(REPOSITORY / "tests/faults"))
from injection import can_inject, injecting

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import CaseFile, Run

    TwoInputs = dict[str, dict[str, bytes]]

OTHER = "&ball mass = 2.4 / &drop / &model / &modes count = 1 /"


@pytest.fixture
def two_inputs(run: Run, case_file: CaseFile, tmp_path: Path) -> TwoInputs:
    """Return the files of two inputs of one name, a/case.nml and b/case.nml."""
    result = {}
    for name, text in (("a", MINIMAL), ("b", OTHER)):
        (tmp_path / name).mkdir()
        case_file(text, f"{name}/case.nml")
        assert run(f"{name}/case.nml", "-o", f"only_{name}").returncode == 0
        result[name] = contents(tmp_path / f"only_{name}")
    # One of them has a file that the other one has not.
    assert set(result["a"]) < set(result["b"])
    return result


@pytest.mark.parametrize(
    "place", ["deep/er/out", "out/", ".//out///", "link", "link/", "Böller 1", "new/."]
)
def test_results_of_the_last_input_stand_alone(
    run: Run, two_inputs: TwoInputs, tmp_path: Path, place: str
) -> None:
    (tmp_path / "behind/it").mkdir(parents=True)
    (tmp_path / "link").symlink_to("behind/it")
    for name in "abba":
        assert run(f"{name}/case.nml", "-q", "-o", place).returncode == 0
        assert contents(tmp_path / place) == two_inputs[name]
    assert (tmp_path / "link").is_symlink()
    assert not list(tmp_path.rglob(".*"))


@pytest.mark.parametrize("place", ["/dev/null/out", "case.nml/out", "case.nml", "/proc/out", "."])
@pytest.mark.parametrize("replace", [[], ["--replace"]])
def test_unsuitable_targets_are_refused(
    run: Run, case_file: CaseFile, tmp_path: Path, place: str, replace: list[str]
) -> None:
    result = run(case_file(MINIMAL), "-o", place, *replace)
    assert result.returncode == 1
    assert place in result.stderr
    assert result.stderr.count("\n") == 1
    assert names_in(tmp_path) == ["case.nml"]


@pytest.mark.parametrize("mode", [0o700, 0o755, 0o2775])
def test_permissions_of_the_directory_stay(
    run: Run, case_file: CaseFile, tmp_path: Path, mode: int
) -> None:
    run(case_file(MINIMAL), "-o", "out")
    (tmp_path / "out").chmod(mode)
    assert run("case.nml", "-o", "out").returncode == 0
    assert stat.S_IMODE((tmp_path / "out").stat().st_mode) == mode


def test_figures_and_reports_belong_to_the_results(
    case_file: CaseFile, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case, out = str(tmp_path / case_file(MINIMAL)), tmp_path / "out"
    for figures in (True, False, True):
        more = [] if figures else ["--no-figures"]
        assert cli.main(["run", "-q", case, "-o", str(out), *more]) == 0
        assert ("force.svg" in names_in(out)) is figures
    (out / "report.pdf").write_bytes(b"signed")
    before = contents(out)
    for more in ([], ["--replace"]):
        assert cli.main(["run", "-q", case, "-o", str(out), *more]) == 1
        assert re.search(naming("out/report.pdf", "in the way"), capsys.readouterr().err)
        assert contents(out) == before
    assert names_in(tmp_path) == ["case.nml", "out"]


def test_page_is_removed_only_by_a_command_that_writes_it(tmp_path: Path) -> None:
    results = Results(tmp_path / "out", "measure")
    results.write({"levels.csv": b"1", "report.html": b"1"})
    for check in (
        lambda: results.require(["levels.csv"]),
        lambda: results.write({"levels.csv": b"2"}),
    ):
        with pytest.raises(thud.InputError, match=naming("out/report.html", "in the way")):
            check()
    results.require()
    results.write({"levels.csv": b"2", "report.html": b"2"})
    assert (tmp_path / "out/report.html").read_bytes() == b"2"
    # Another command, before it knows its files.
    with pytest.raises(thud.InputError, match=naming("out/levels.csv", "in the way")):
        Results(tmp_path / "out", "fit", replace=True).require()


def test_error_leaves_the_old_results(tmp_path: Path) -> None:
    results = Results(tmp_path / "out", "fit")
    results.write({"a": b"1"})
    with pytest.raises(OSError, match=re.escape(f"{tmp_path}/out/no/such")):
        results.write({"b": b"2", "no/such": b"2"})
    with pytest.raises(KeyboardInterrupt), results.new_folder():
        raise KeyboardInterrupt
    assert names_in(tmp_path) == ["out"]
    assert names_in(tmp_path / "out") == ["a", "thud.txt"]


def test_runs_into_one_directory_do_not_mix(
    executable: str, two_inputs: TwoInputs, tmp_path: Path
) -> None:
    for _ in range(12):
        running = [
            subprocess.Popen([executable, f"{name}/case.nml", "-q", "-o", "o"], cwd=tmp_path)
            for name in "aba"
        ]
        assert [process.wait() for process in running] == [0, 0, 0]
        assert contents(tmp_path / "o") in two_inputs.values()
        assert not list(tmp_path.rglob(".*"))


@pytest.mark.skipif(not can_inject(), reason="there is no C compiler")
@pytest.mark.parametrize("exchange", [True, False], ids=["exchange", "two renames"])
@pytest.mark.parametrize(
    "action", ["kill", *(pytest.param(a, marks=pytest.mark.slow) for a in ("int", errno.ENOSPC))]
)
def test_old_or_new_results_are_whole_whichever_call_fails(  # noqa: PLR0913
    run: Run, two_inputs: TwoInputs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    action: str | int, *, exchange: bool,
) -> None:  # fmt: skip
    """All calls that make, write, rename or remove a file, one after the other."""
    assert run("a/case.nml", "-o", "o").returncode == 0
    at, status = 0, 1
    while status:
        at += 1
        with monkeypatch.context() as patch:
            for name, value in injecting(action=action, at=at, under=tmp_path).items():
                patch.setenv(name, value)
            if not exchange:
                patch.setenv("FAULT_NO_EXCHANGE", "1")
            done = run("b/case.nml", "-q", "-o", "o")
        status = done.returncode
        whole = tmp_path / ("o" if (tmp_path / "o").exists() else "o.old")
        assert contents(whole) in two_inputs.values()
        if whole.name == "o.old":
            whole.rename(tmp_path / "o")
        shutil.rmtree(tmp_path / "o.old", ignore_errors=True)
        if isinstance(action, int):
            assert not status or "No space left on device" in done.stderr
            # What cannot be removed may stay.
            assert len(list(tmp_path.glob(".o.*.new"))) <= 1
        for path in tmp_path.glob(".o.*.new"):
            shutil.rmtree(path)
        assert run("a/case.nml", "-o", "o").returncode == 0
    assert at > 10


def test_results_are_read_back(run: Run, case_file: CaseFile, tmp_path: Path) -> None:
    run(case_file("&case name = 'it''s' /\n" + MINIMAL), "-o", "out")
    out = tmp_path / "out"
    assert thud.read_results(out).case.name == "it's"
    rng = np.random.default_rng(0)
    for name in ("effective.nml", "summary.nml"):
        content = (out / name).read_bytes()
        ends = set(rng.integers(len(content), size=100).tolist())
        # Behind a quotation mark, a sign and an exponent, too.
        for end in sorted(ends | {content.find(mark) + 1 for mark in (b"'", b"-", b"e")}):
            for damaged in (content[:end], content[:end] + b"'" + content[end:]):
                (out / name).write_bytes(damaged)
                with suppress(thud.InputError):
                    thud.read_results(out)
        (out / name).write_bytes(content)
    (out / "force.csv").unlink()
    os.mkfifo(out / "force.csv")
    with pytest.raises(thud.InputError, match=naming("out")):
        thud.read_results(out)


def test_threads_that_write_the_same_file_do_not_disturb_each_other(tmp_path: Path) -> None:
    texts = [bytes([number]) * 100_000 for number in range(4)]

    def write(content: bytes) -> None:
        for _ in range(100):
            replace_file(tmp_path / "file", content)
            assert (tmp_path / "file").read_bytes() in texts

    with ThreadPoolExecutor(len(texts)) as threads:
        list(threads.map(write, texts))
    assert names_in(tmp_path) == ["file"]


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir])
def test_only_regular_files_are_replaced(tmp_path: Path, make: object) -> None:
    make(tmp_path / "file")  # type: ignore[operator]
    with pytest.raises(OSError, match="file"):
        replace_file(tmp_path / "file", b"new")
    assert names_in(tmp_path) == ["file"]
