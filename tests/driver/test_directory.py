"""Directories of studies: no finished result is lost or mixed up, however a study ends."""

from __future__ import annotations

import errno
import os
import resource
import signal
import subprocess
import sys
import time
from contextlib import nullcontext, suppress
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from conftest import names_in, naming
from hypothesis import given, settings, strategies as st

import thud
from thud import cli
from thud.studies import run

if TYPE_CHECKING:
    from pathlib import Path

    import xarray as xr

HEIGHTS = {"parameters": {"height": {"values": [50, 100], "unit": "cm"}}}
# Several blocks of the modal ball, some seconds.
LONG = """
name = "long"
fixed = { model = "modal_ball", highest_frequency = 700, rings = 20 }
design = { kind = "random", size = 500, seed = 4 }
parameters = { height = { low = 0.9, high = 1.1 } }
"""


def values(dataset: xr.Dataset) -> xr.Dataset:
    """Return a dataset without the date of its making."""
    return dataset.drop_attrs(deep=False).load()


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> xr.Dataset:
    """Return the results of the long study, computed at a stretch."""
    path = tmp_path_factory.mktemp("whole") / "long.toml"
    path.write_text(LONG)
    return thud.sweep(path).dataset


def start(study: str, folder: Path, *more: str) -> subprocess.Popen[str]:
    """Start a study in a process of its own, and return when it has some samples."""
    (folder / "long.toml").write_text(study)
    command = [sys.executable, "-m", "thud", "sweep", "long.toml", "-q", "-o", "."]
    command += ["--workers", "1", *more]
    process = subprocess.Popen(command, cwd=folder, stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 30
    while not list(folder.glob("long.partial/block_*.nc")):
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.01)
    return process


@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGINT])
@pytest.mark.slow
def test_ended_study_goes_on_where_it_stopped(
    end: signal.Signals, whole: xr.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    process = start(LONG, tmp_path)
    process.send_signal(end)
    _, errors = process.communicate()
    if end == signal.SIGINT:
        assert process.returncode == 130
        assert "interrupted" in errors
    else:
        assert process.returncode == -signal.SIGKILL
    assert not (tmp_path / "long.nc").exists()
    finished = thud.read_sweep(tmp_path / "long.partial").dataset
    assert 0 < finished.sizes["sample"] < 500
    known = np.isin(whole["height"], finished["height"])
    assert values(finished).identical(values(whole.isel(sample=known)))

    computed = []
    evaluate = run.evaluate

    def count(case: thud.Case, columns: dict[str, Any], *more: Any) -> dict[str, Any]:  # noqa: ANN401
        computed.append(len(columns["height"]))
        return evaluate(case, columns, *more)

    monkeypatch.setattr(run, "evaluate", count)
    resumed = thud.sweep(tmp_path / "long.toml", tmp_path).dataset
    assert sum(computed) == 500 - finished.sizes["sample"]
    assert values(resumed).identical(values(whole))
    assert not (tmp_path / "long.partial").exists()
    again = thud.sweep(tmp_path / "long.toml", tmp_path).dataset
    assert again.identical(resumed)
    assert sum(computed) == 500 - finished.sizes["sample"]


@pytest.mark.slow
def test_full_disk_is_reported_and_loses_nothing(
    whole: xr.Dataset, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "long.toml").write_text(LONG)
    arguments = ["sweep", str(tmp_path / "long.toml"), "-q", "-o", str(tmp_path)]
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    size = thud.read_study(tmp_path / "long.toml").block_size
    blocks = -(-whole.sizes["sample"] // size)
    assert blocks > 1
    block, end = (
        len(bytes(part.to_netcdf(engine="h5netcdf")))
        for part in (whole.isel(sample=slice(0, size)), whole)
    )
    # The disk is full for the first block already, then for the end, which is larger.
    for limit, partial in ((block // 2, 0), ((block + end) // 2, blocks)):
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
        try:
            assert cli.main(arguments) == 1
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        errors = capsys.readouterr().err
        assert "File too large" in errors
        assert errors.count("\n") == 1
        assert len(list(tmp_path.glob("long.partial/*.nc"))) == partial
        assert not list(tmp_path.rglob(".*new"))
    assert values(thud.sweep(tmp_path / "long.toml", tmp_path).dataset).identical(values(whole))


@pytest.mark.parametrize(
    ("name", "words"),
    [("a.nc", ["[parameters] height", "(0.5, 1.0)", "(1.0,)"]), ("b.nc", []), ("c.nc", []),
     ("d.partial", ["height"])],
)  # fmt: skip
def test_results_of_another_study_are_not_touched(
    name: str, words: list[str], tmp_path: Path
) -> None:
    """Neither under their name or another one, nor a file of something else, nor a block."""
    path = thud.sweep({"name": "a", **HEIGHTS}, tmp_path) and tmp_path / "a.nc"
    place = tmp_path / name
    if name == "c.nc":
        path.write_text("a paper")
    if name == "d.partial":
        place.mkdir()
        place /= "block_000000000000.nc"
    path.rename(place)
    before = place.read_bytes()
    study = {"name": name[0], "parameters": {"height": {"values": [1]}}}
    with pytest.raises(thud.InputError, match=naming(name, *words, "--replace")):
        thud.sweep(study, tmp_path)
    assert place.read_bytes() == before
    assert thud.sweep(study, tmp_path, replace=True).dataset.sizes["height"] == 1


def test_half_a_block_is_no_result(tmp_path: Path) -> None:
    (tmp_path / "e.partial").mkdir()
    # Kills leave half a file.
    (tmp_path / "e.partial/.block_000000000000.nc.1.new").write_text("")
    with pytest.raises(thud.InputError, match=naming("e.partial", "samples")):
        thud.read_sweep(tmp_path / "e.partial")
    assert thud.sweep({"name": "e", **HEIGHTS}, tmp_path).dataset.sizes["height"] == 2
    assert not (tmp_path / "e.partial").exists()


def test_replace_leaves_nothing_of_an_older_version(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text("parameters.height.values = [0.5, 1]")
    sweep = ["sweep", "-q", str(path), "-o", str(tmp_path / "here")]
    assert cli.main(sweep) == 0
    path.write_text("parameters.height.values = [0.5, 1, 2]")
    assert cli.main(sweep) == 1
    assert cli.main([*sweep, "--no-figures", "--replace"]) == 0
    assert names_in(tmp_path / "here") == ["a.nc"]


@pytest.mark.parametrize("name", ["python.partial", "python.nc"])
def test_links_in_the_place_of_results_are_not_followed(name: str, tmp_path: Path) -> None:
    out, other = tmp_path / "out", tmp_path / "other"
    out.mkdir()
    other.mkdir()
    (out / name).symlink_to(other)
    with pytest.raises(thud.InputError, match=naming(out / name)):
        thud.sweep(HEIGHTS, out)
    assert list(other.iterdir()) == []
    thud.sweep(HEIGHTS, out, replace=True)
    assert list(other.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "content"),
    [("python.nc", "paper.txt"), ("python.nc", "block_000000000000.nc"),
     ("python.partial", "block_000000000000.nc"), ("python.partial", "paper.txt")],
)  # fmt: skip
def test_directories_of_something_else_stay(name: str, content: str, tmp_path: Path) -> None:
    (tmp_path / "mine").write_text("mine")
    (tmp_path / name).mkdir()
    (tmp_path / name / content).symlink_to(tmp_path / "mine")
    for replace in (False, True):
        # Other files beside blocks stay, too.
        is_refused = (name, content) != ("python.partial", "paper.txt")
        with pytest.raises(thud.InputError, match=naming(name)) if is_refused else nullcontext():
            thud.sweep(HEIGHTS, tmp_path, replace=replace)
    assert (tmp_path / name / content).read_text() == "mine"


def test_results_of_this_version_stay_with_replace(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where they cannot be read for now."""
    inodes = set()
    for _ in range(2):
        thud.sweep(HEIGHTS, tmp_path, replace=True)
        inodes.add((tmp_path / "python.nc").stat().st_ino)

    def fail(*_: object, **__: object) -> None:
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE), "python.nc")

    with monkeypatch.context() as patch:
        patch.setattr("thud.studies.dataset.require_regular", fail)
        with pytest.raises(OSError, match=os.strerror(errno.EMFILE)):
            thud.sweep(HEIGHTS, tmp_path, replace=True)
    assert inodes == {(tmp_path / "python.nc").stat().st_ino}


def test_two_runs_at_once_leave_the_whole_results(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While one run computes its block, the other ends and removes its blocks."""
    evaluate = run.evaluate

    def other_first(*block: Any) -> dict[str, Any]:  # noqa: ANN401
        monkeypatch.setattr(run, "evaluate", evaluate)
        thud.sweep(HEIGHTS, tmp_path)
        return evaluate(*block)

    monkeypatch.setattr(run, "evaluate", other_first)
    with suppress(OSError):
        thud.sweep(HEIGHTS, tmp_path)
    found = thud.read_sweep(tmp_path / "python.nc").dataset
    assert values(found).identical(values(thud.sweep(HEIGHTS).dataset))
    assert names_in(tmp_path) == ["python.nc"]


def test_blocks_of_another_version_are_never_joined(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They are of a run that replaces the results at the same time."""
    monkeypatch.setattr("thud.studies.study._BLOCK_SIZE", 1)
    write = run.write_dataset

    def replace_last(block: xr.Dataset, path: Path) -> None:
        is_last = path.name.endswith("1.nc")
        write(block.assign_attrs(identity="{}") if is_last else block, path)

    with monkeypatch.context() as patch:
        patch.setattr(run, "write_dataset", replace_last)
        with pytest.raises(thud.InputError, match=naming("python.partial", "another version")):
            thud.sweep(HEIGHTS, tmp_path)
    found = thud.sweep(HEIGHTS, tmp_path).dataset
    assert values(found).identical(values(thud.sweep(HEIGHTS).dataset))


@given(position=st.integers(0, 30_000), bit=st.integers(0, 7))
@settings(max_examples=50, deadline=None)
def test_flipped_bits_are_found(
    position: int, bit: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.getbasetemp() / "flipped.nc"
    if not path.exists():
        thud.sweep(HEIGHTS).save(path)
    content = bytearray(path.read_bytes())
    content[position % len(content)] ^= 1 << bit
    damaged = path.with_stem("damaged")
    damaged.write_bytes(content)
    with pytest.raises(thud.InputError, match=naming("damaged.nc")):
        thud.read_sweep(damaged)
