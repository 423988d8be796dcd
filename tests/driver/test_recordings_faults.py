"""Damaged recordings: what the campaign of tests/faults has found."""

from __future__ import annotations

import errno
import logging
import os
import struct
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

import h5py
import numpy as np
import pytest
from conftest import REPOSITORY, naming, python
from recording_files import WRITERS, half_sine

from thud.base.errors import InputError
from thud.recordings import probe
from thud.recordings.signal_files import open_signals

if TYPE_CHECKING:
    from collections.abc import Callable

sys.path.insert(0, str(REPOSITORY / "tests/faults"))
from injection import can_inject, injecting
from mutate_recordings import mutate


def count_handles() -> int:
    """Return the number of open files."""
    return len(list(Path("/proc/self/fd").iterdir()))


@pytest.mark.skipif(not can_inject(), reason="there is no C compiler")
def test_recording_is_read_where_the_file_system_has_no_locks(tmp_path: Path) -> None:
    force = half_sine(44100)
    WRITERS["plate.h5"](tmp_path / "plate.h5", force, 44100, "N")
    read = "import thud; print(len(thud.read_recording('plate.h5').drops))"
    faults = injecting(calls="flock", action=errno.ENOLCK, at=1, **{"from": 1})
    done = python("-c", read, cwd=tmp_path, env=faults)
    assert (done.stderr, done.stdout) == ("", "1\n")


def hang(path: Path) -> None:
    del path
    while True:
        time.sleep(1)


def die(path: Path) -> None:
    del path
    os.abort()


def fill(path: Path) -> None:
    del path
    np.ones(2**34)


def stumble(path: Path) -> None:
    raise KeyError(path.name)


@pytest.mark.parametrize(
    ("action", "words"),
    [
        (hang, naming("p.h5", "0.5 s", "HDF5")),
        (die, naming("p.h5", "library", "HDF5")),
        (fill, naming("p.h5", "memory", "HDF5")),
        (stumble, naming("p.h5", "'p.h5'", "HDF5")),
    ],
)
def test_what_libraries_do_stays_in_the_first_look(
    action: Callable[[Path], None], words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(probe, "TIMEOUT", 0.5)
    handles, before = count_handles(), children()
    with pytest.raises(InputError, match=words):
        probe.probe_in_subprocess(action, tmp_path / "p.h5", "HDF5")
    assert count_handles() == handles
    assert children() == before


def children() -> set[str]:
    """Return the processes that this one has started and not yet waited for."""
    tasks = Path("/proc/self/task").glob("*/children")
    return {child for task in tasks for child in task.read_text().split()}


def test_length_of_a_text_in_hdf5_does_not_fill_memory(tmp_path: Path) -> None:
    """The library reserves what the length of a text claims before it looks for the text."""
    path = tmp_path / "plate.h5"
    with h5py.File(path, "w") as file:
        file["force"] = half_sine(8000.0)
        file["force"].attrs["units"] = "N" * 77
    data = path.read_bytes()
    assert data.count(struct.pack("<I", 77)) >= 1
    path.write_bytes(data.replace(struct.pack("<I", 77), struct.pack("<I", 2**32 - 1)))
    with pytest.raises(InputError, match=naming("plate.h5", "HDF5")):
        open_signals(path)


@pytest.mark.parametrize("number", [51359, 56588, 84959])
def test_damaged_matlab_files_do_not_crash(number: int, tmp_path: Path) -> None:
    """The compiled reader of scipy dies of these of the campaign's files."""
    path = tmp_path / "plain.mat"
    force = half_sine(8000.0, 0.02, 0.02)
    force += np.random.default_rng(1).normal(0, 3, force.size)
    WRITERS["plain.mat"](path, force, 8000.0, "N")
    path.write_bytes(mutate(path.read_bytes(), np.random.default_rng([1, number])))
    with pytest.raises(InputError, match=naming("plain.mat")):
        open_signals(path)


def test_library_of_tdms_writes_no_warnings(tmp_path: Path) -> None:
    path = tmp_path / "p.tdms"
    WRITERS["plate.tdms"](path, half_sine(8000.0, 0.02, 0.02), 8000.0, "N")
    open_signals(path)
    loggers = [name for name in logging.root.manager.loggerDict if name.startswith("nptdms.")]
    assert loggers
    assert not any(logging.getLogger(name).isEnabledFor(logging.WARNING) for name in loggers)
