"""The executable, and the library that lets a call of the system go wrong; see `inject.c`."""

from __future__ import annotations

import errno
import os
import shutil
import subprocess
import sysconfig
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

KILLS = ("kill", "term", "int")
ERRORS = tuple(str(number) for number in (errno.ENOSPC, errno.EIO, errno.EINTR, errno.EMFILE))
# Seconds that a run may take.
PATIENCE = 60


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
