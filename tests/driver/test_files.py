"""Files that are replaced in one step."""

from __future__ import annotations

import os
import threading
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

import pytest

from thud.files import replace_file

if TYPE_CHECKING:
    from pathlib import Path


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
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_what_a_killed_writer_left_is_taken_up(tmp_path: Path) -> None:
    (tmp_path / ".file.part").write_bytes(b"half of a longer one")
    replace_file(tmp_path / "file", b"whole")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
    assert (tmp_path / "file").read_bytes() == b"whole"


def test_link_of_the_temporary_name_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "other").write_bytes(b"kept")
    (tmp_path / ".file.part").symlink_to(tmp_path / "other")
    with pytest.raises(OSError, match="symbolic links"):
        replace_file(tmp_path / "file", b"new")
    assert (tmp_path / "other").read_bytes() == b"kept"
    (tmp_path / ".file.part").unlink()
    (tmp_path / ".file.part").hardlink_to(tmp_path / "other")
    with pytest.raises(OSError, match=r"\.file\.part is a link"):
        replace_file(tmp_path / "file", b"new")
    assert (tmp_path / "other").read_bytes() == b"kept"


def test_pipes_are_neither_opened_nor_replaced(tmp_path: Path) -> None:
    for name in ("file", ".file.part"):
        os.mkfifo(tmp_path / name)
        with pytest.raises(OSError, match="file"):
            replace_file(tmp_path / "file", b"new")
        assert (tmp_path / name).is_fifo()
        (tmp_path / name).unlink()
