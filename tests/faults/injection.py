"""Runs of the executable in which one call of the system goes wrong on purpose; see `inject.c`."""

from __future__ import annotations

import errno
import os
import shutil
import subprocess
import sysconfig
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import NamedTuple

KILLS = ("kill", "term", "int")
ERRORS = tuple(str(number) for number in (errno.ENOSPC, errno.EIO, errno.EINTR, errno.EMFILE))
# Seconds that a run may take.
PATIENCE = 60


class Run(NamedTuple):
    """What a run left: its exit code, its words, and the calls that were counted."""

    code: int
    said: str
    calls: list[str]


def executable() -> str:
    """Return the path of the installed executable."""
    return str(Path(sysconfig.get_path("scripts")) / "thud")


@cache
def library() -> str:
    """Return the path of the compiled library of faults."""
    target = Path(mkdtemp(prefix="thud_faults_")) / "inject.so"
    source = Path(__file__).with_name("inject.c")
    command = [
        os.environ.get("CC", "cc"),
        "-shared",
        "-fPIC",
        "-O1",
        "-o",
        str(target),
        str(source),
    ]
    subprocess.run([*command, "-ldl"], check=True)
    return str(target)


def can_inject() -> bool:
    """Return whether a compiler is here."""
    return shutil.which(os.environ.get("CC", "cc")) is not None


def run(arguments: list[str], folder: Path, at: int = 0, action: str = "", calls: str = "") -> Run:
    """Run the executable in a folder; its call of that number goes wrong, none for 0.

    `calls` are the names of those that count, by default all that change files.
    """
    log = folder.parent / f"calls_{os.getpid()}"
    log.unlink(missing_ok=True)
    faults = {"FAULT_AT": str(at), "FAULT_ACTION": action, "FAULT_LOG": str(log)}
    if calls:
        faults["FAULT_CALLS"] = calls
    done = subprocess.run(
        [executable(), *arguments],
        cwd=folder,
        env={**os.environ, "LC_ALL": "C", "LD_PRELOAD": library(), **faults},
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    counted = log.read_text("utf-8", "replace").splitlines() if log.exists() else []
    log.unlink(missing_ok=True)
    return Run(done.returncode, done.stderr, counted)
