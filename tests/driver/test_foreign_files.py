"""No command replaces an input or a file that thud has not written, whatever it writes."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pytest
from conftest import MINIMAL, REPOSITORY, names_in
from refusals.core import write

import thud
from thud import cli

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

DROP = REPOSITORY / "inputs/recordings/drop_1.csv"
MINE = b"of the user, and of nobody else"
# Seconds after which a command hangs.
PATIENCE = 300
FLOOR = MINIMAL + "&floor name = 'plate' / &plate / &room volume = 40 /"
RANGES = "parameters = {height = {low = 0.9, high = 1.1}, mass = {low = 2.4, high = 2.6}}\n"


class Writer(NamedTuple):
    """A command that writes results, and its inputs by their names."""

    words: list[str]
    inputs: dict[str, str | bytes]
    output: str = "out"


def _study(kind: str, text: str) -> Writer:
    return Writer([kind, "s.toml"], {"s.toml": f"case = 'case.nml'\n{text}", "case.nml": MINIMAL})


def _mobility() -> str:
    """Return the mobility of one mass on a spring."""
    omega = 2 * np.pi * np.linspace(20, 200, 100)
    values = 1j * omega / (50 * (300.0**2 * (1 + 0.1j) - omega**2))
    rows = zip(omega / (2 * np.pi), values.real, values.imag, strict=True)
    return "frequency,real,imaginary\n" + "".join(f"{f},{x},{y}\n" for f, x, y in rows)


# By command of `thud-driver`; below them the executable.
WRITERS = {
    "run": Writer(["run", "case.nml"], {"case.nml": MINIMAL}),
    "compare": Writer(["compare", "case.nml"], {"case.nml": MINIMAL}),
    "measure": Writer(["measure", "drop.csv", "--config", "lab.toml"],
                      {"drop.csv": DROP.read_bytes(), "lab.toml": 'laboratory = "Lab"'}),
    "export": Writer(["export", "drop.csv", "--csv", "--spectrum", "--mat"],
                     {"drop.csv": DROP.read_bytes()}),
    "history": Writer(["history", "report.json"], {"report.json": b""}),
    "rate": Writer(["rate", "levels.csv", "--volume", "40"],
                   {"levels.csv": (REPOSITORY / "inputs/floors/field_levels.csv").read_bytes()}),
    "floor": Writer(["floor", "case.nml"], {"case.nml": FLOOR}),
    "listen": Writer(["listen", "case.nml"], {"case.nml": FLOOR}, "out/listen.wav"),
    "predict": Writer(["predict", "case.nml", "--report"], {"case.nml": FLOOR}),
    "mobility": Writer(["mobility", "table.csv"], {"table.csv": _mobility()}),
    "sweep": _study("sweep", "parameters.height.values = [0.9, 1.1]"),
    "sensitivity": _study("sensitivity", RANGES + "design.size = 8"),
    "design": _study("design", RANGES.replace("}, mass", ", count = 2}, mass").replace(
        "2.6}", "2.6, count = 2}")),
    "uncertainty": _study("uncertainty", RANGES + "design.size = 8"),
    "surrogate": _study("surrogate", "parameters.height = {low = 0.99, high = 1.01}\n"
                        "design.size = 64"),
    "fit": _study("fit", "target.levels = [39, 31, 23, 17, 12]\nparameters.mass = {}"),
    "thud": Writer(["thud", "case.nml"], {"case.nml": MINIMAL}),
    "sets": Writer(["thud", "case.nml", "--samples", "table.csv"],
                   {"case.nml": MINIMAL, "table.csv": "height\n1\n0.5\n"}),
}  # fmt: skip
# They write no results, but `examples` a directory of its own and `assess` a table as others do.
OTHERS = {"explore", "calibrate", "examples", "assess"}
# Their directories grow: they replace files by their names.
STUDIES = {"sweep", "sensitivity", "design", "uncertainty", "surrogate"}


def test_no_command_escapes() -> None:
    options = {
        name: {word for words, _ in command.arguments for word in words}
        for name, command in cli.COMMANDS.items()
    }
    all_writing = {name for name, words in options.items() if "--output" in words}
    assert all("--replace" in options[name] for name in all_writing - {"listen"})
    writing = all_writing - OTHERS
    assert writing | {"thud", "sets"} == WRITERS.keys()
    assert writing | OTHERS == cli.COMMANDS.keys()


@pytest.fixture(autouse=True)
def impatient() -> Iterator[None]:
    """End what hangs."""
    signal.alarm(PATIENCE)
    yield
    signal.alarm(0)


@pytest.fixture
def command(executable: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., int]:
    """Run a command of the table."""
    monkeypatch.chdir(tmp_path)
    # To draw them takes long, and is tested elsewhere.
    for name, value in (
        ("plot.save_figures._content", lambda *_: b"figure"),
        ("report.recording_files.page_contents", lambda *_: {"report.html": b"page"}),
        ("report.predicted_floor.PredictedFloor.changes", ()),
        ("report.floor_files.page_contents", lambda floor, _: {f"{floor.file}.html": b"page"}),
    ):
        monkeypatch.setattr(f"thud.{name}", value)

    def run(name: str, *more: str) -> int:
        words = [*WRITERS[name].words, "-q", "-o", WRITERS[name].output, *more]
        if words[0] != "thud":
            return cli.main(words)
        return subprocess.run([executable, *words[1:]], check=False, timeout=PATIENCE).returncode

    return run


# `listen` writes a single file, which it replaces.
@pytest.fixture(params=[name for name in WRITERS if name != "listen"])
def name(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """Return the name of a command whose inputs lie in the directory of the test."""
    name: str = request.param
    for path, content in WRITERS[name].inputs.items():
        write(tmp_path / path, _report() if path == "report.json" else content)
    return name


def _report() -> str:
    from thud.report.contents import json_bytes, report_data

    data = report_data(thud.read_recording(DROP, height=1.0, mass=2.5))
    return json_bytes(replace(data, date="2024-05-03")).decode()


def names_written(out: Path) -> list[str]:
    """Return the names of a directory of results, and empty it."""
    names = names_in(out)
    assert names
    shutil.rmtree(out)
    return names


@pytest.mark.slow
def test_nothing_but_own_results_is_replaced_or_opened(
    name: str, command: Callable[..., int], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    out, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    elsewhere.write_bytes(MINE)
    inputs = {path: (tmp_path / path).read_bytes() for path in WRITERS[name].inputs}
    assert command(name) in (0, 2)
    assert command(name) in (0, 2)  # over its own results
    written = names_written(out)
    others: list[Callable[[Path], object]] = [
        lambda path: path.mkdir(),
        lambda path: path.symlink_to(elsewhere),
        lambda path: path.symlink_to(tmp_path / "nowhere"),
    ]
    for i, path in enumerate(written):
        source = tmp_path / [*inputs, "elsewhere"][i % max(1, len(inputs))]
        link = os.link if i % 2 else os.symlink
        for make, options in (
            (lambda path: path.write_bytes(MINE), ()),
            (os.mkfifo, ()),
            (others[i % 3], ()),
            (partial(link, source), ("--replace",)),
        ):
            out.mkdir()
            make(out / path)
            before = (out / path).lstat()
            capfd.readouterr()
            assert command(name, *options) == 1
            assert capfd.readouterr().err
            after = (out / path).lstat()
            assert (before.st_ino, before.st_mode) == (after.st_ino, after.st_mode), path
            if (out / path).is_file():
                assert (out / path).read_bytes() in {MINE, source.read_bytes()}
            shutil.rmtree(out)
    # What a study may read, too.
    for path in ("s.nc", "s.partial") if "s.toml" in inputs else ():
        out.mkdir()
        os.mkfifo(out / path)
        command(name)
        assert (out / path).is_fifo()
        shutil.rmtree(out)
    # Nothing that thud has not made is replaced on request either, but for files of studies.
    out.mkdir()
    (out / written[-1]).write_bytes(MINE)
    code = command(name, "--replace")
    assert ((out / written[-1]).read_bytes() == MINE) == (code == 1) == (name not in STUDIES)
    shutil.rmtree(out)
    assert command(name) in (0, 2)
    (out / "notes.txt").write_bytes(MINE)
    capfd.readouterr()
    if command(name, "--replace") == 1:
        assert "notes.txt" in capfd.readouterr().err
    assert (out / "notes.txt").read_bytes() == elsewhere.read_bytes() == MINE
    assert not (tmp_path / "nowhere").exists()
    assert {path: (tmp_path / path).read_bytes() for path in inputs} == inputs


def test_pipe_among_checkpoints_is_not_opened(command: Callable[..., int], tmp_path: Path) -> None:
    for path, content in WRITERS["sweep"].inputs.items():
        write(tmp_path / path, content)
    (tmp_path / "out/s.partial").mkdir(parents=True)
    os.mkfifo(tmp_path / "out/s.partial/block_000000000000.nc")
    for more in ([], ["--replace"]):
        assert command("sweep", *more) == 1


@pytest.mark.parametrize("words", [["sweep"], ["fit"], ["run"], ["measure"], ["history"], ["rate"]])
def test_pipe_is_no_input(words: list[str], tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    assert cli.main([*words, str(tmp_path / "pipe"), "-q", "-o", str(tmp_path / "out")]) == 1
