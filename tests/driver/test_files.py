"""Files that are replaced in one step."""

from __future__ import annotations

import errno
import fcntl
import os
import platform
import re
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from conftest import names_in, naming, python

import thud
from thud.base.files import Results, locked, replace_file


@pytest.fixture(params=[True, False], ids=["locks", "no locks"])
def locks(request: pytest.FixtureRequest) -> None:
    """Have locks, or none."""
    if not request.param:
        request.getfixturevalue("no_locks")


@pytest.mark.usefixtures("locks")
def test_threads_that_write_the_same_file_do_not_disturb_each_other(tmp_path: Path) -> None:
    contents = [bytes([number]) * 100_000 for number in range(4)]
    start = threading.Barrier(len(contents))

    def write(content: bytes) -> None:
        start.wait()
        for _ in range(200):
            replace_file(tmp_path / "file", content)
            assert (tmp_path / "file").read_bytes() in contents

    with ThreadPoolExecutor(len(contents)) as threads:
        list(threads.map(write, contents))
    assert names_in(tmp_path) == ["file"]


def test_what_a_killed_writer_left_is_taken_up(tmp_path: Path) -> None:
    (tmp_path / ".file.part").write_bytes(b"half of a longer one")
    replace_file(tmp_path / "file", b"whole")
    assert names_in(tmp_path) == ["file"]
    assert (tmp_path / "file").read_bytes() == b"whole"


@pytest.mark.usefixtures("no_locks")
def test_leftovers_without_locks_are_removed_where_their_writer_has_ended(tmp_path: Path) -> None:
    ended = python("-c", "import os; print(os.getpid())").stdout.strip()
    names = {
        "ended": f".file.part.1.{platform.node()}.{ended}",
        "running": f".file.part.2.{platform.node()}.{os.getppid()}",
        "elsewhere": ".file.part.3.other-host.1",
        "old": ".file.part.4.other-host.1",
        "another file": f".file2.part.5.{platform.node()}.{ended}",
    }
    for name in names.values():
        (tmp_path / name).write_bytes(b"half")
    os.utime(tmp_path / names["old"], (0, 0))
    replace_file(tmp_path / "file", b"whole")
    left = set(names_in(tmp_path))
    assert left == {"file", names["running"], names["elsewhere"], names["another file"]}


def test_failure_of_a_lock_is_no_file_system_without_locks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr("fcntl.flock", fail)
    with pytest.raises(OSError, match=os.strerror(errno.EIO)), locked(tmp_path):
        pass


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
def test_lock_that_is_not_had_leaves_no_open_file(tmp_path: Path) -> None:
    before = len(list(Path("/proc/self/fd").iterdir()))
    with locked(tmp_path):
        for _ in range(10):
            with pytest.raises(BlockingIOError), locked(tmp_path, fcntl.LOCK_EX | fcntl.LOCK_NB):
                pass
    assert len(list(Path("/proc/self/fd").iterdir())) == before


@pytest.mark.usefixtures("no_locks")
def test_results_without_locks_are_added_with_a_warning(tmp_path: Path) -> None:
    with pytest.warns(thud.LockWarning, match=re.escape(str(tmp_path))):
        Results(tmp_path).write({"force.png": b"figure"})
    assert names_in(tmp_path) == [".thud", "force.png"]


def test_link_of_the_temporary_name_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "other").write_bytes(b"kept")
    (tmp_path / ".file.part").symlink_to(tmp_path / "other")
    with pytest.raises(OSError, match=naming(tmp_path / "file")):
        replace_file(tmp_path / "file", b"new")
    assert (tmp_path / "other").read_bytes() == b"kept"
    (tmp_path / ".file.part").unlink()
    (tmp_path / ".file.part").hardlink_to(tmp_path / "other")
    with pytest.raises(OSError, match=naming("file.part", "link")):
        replace_file(tmp_path / "file", b"new")
    assert (tmp_path / "other").read_bytes() == b"kept"


def test_pipes_are_neither_opened_nor_replaced(tmp_path: Path) -> None:
    for name in ("file", ".file.part"):
        os.mkfifo(tmp_path / name)
        with pytest.raises(OSError, match="file"):
            replace_file(tmp_path / "file", b"new")
        assert (tmp_path / name).is_fifo()
        (tmp_path / name).unlink()


def test_interrupt_behind_the_last_step_is_raised_as_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rename = Path.replace

    def rename_and_stop(self: Path, target: Path) -> None:
        rename(self, target)
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", rename_and_stop)
    with pytest.raises(KeyboardInterrupt):
        replace_file(tmp_path / "file", b"new")
    assert (tmp_path / "file").read_bytes() == b"new"


@pytest.mark.parametrize("replace", [False, True])
def test_directory_of_the_name_of_the_manifest_is_named_as_such(
    tmp_path: Path, *, replace: bool
) -> None:
    (tmp_path / ".thud").mkdir()
    with pytest.raises(thud.InputError, match=naming(".thud", "directory")) as caught:
        Results(tmp_path, replace=replace).write({"force.png": b"figure"})
    assert "--replace" not in str(caught.value)


def test_stale_file_may_vanish_meanwhile(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    results = Results(tmp_path)
    results.write({"old": b"1"})
    put = Results._put  # noqa: SLF001

    def put_and_remove(self: Results, contents: dict[str, bytes]) -> None:
        put(self, contents)
        (tmp_path / "old").unlink(missing_ok=True)

    monkeypatch.setattr(Results, "_put", put_and_remove)
    results.write({"new": b"2"}, stale=["old"])
    assert names_in(tmp_path) == [".thud", "new"]
