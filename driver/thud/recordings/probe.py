"""A first look at a file in a process of its own, where a library hangs, dies or fills memory."""

from __future__ import annotations

import faulthandler
import os
import resource
import select
import signal
import time
from pathlib import Path
from typing import TYPE_CHECKING

from thud.base.checks import refuse
from thud.base.errors import InputError
from thud.recordings.channel import guarded, shown_path

if TYPE_CHECKING:
    from collections.abc import Callable

# Seconds and bytes that the first look may take.
PATIENCE = 10.0
MEMORY = 2**29


def look(action: Callable[[Path], object], path: Path, kind: str) -> None:
    """Do something with a file in a forked process.

    Raises
    ------
    InputError
        What the action raises there, or that the process hung, died or ran out of memory.
    """
    reader, writer = os.pipe()
    with guarded(path, kind):  # Python warns of forks beside threads; the child starts none
        child = os.fork()
    if not child:
        _report(action, path, kind, writer)
    os.close(writer)
    ended = False
    try:
        message, ended = _listen(reader)
    finally:
        os.close(reader)
        if not ended:
            os.kill(child, signal.SIGKILL)
        _, status = os.waitpid(child, 0)
    if message:
        raise InputError(message.decode("utf-8", "replace"))
    if status:
        what = "makes its library fail" if ended else f"is not read within {PATIENCE:g} s"
        refuse(f"{shown_path(path)}: {what}", f"an undamaged {kind} file")


def _report(action: Callable[[Path], object], path: Path, kind: str, writer: int) -> None:
    """Do something, write what it raises to a pipe, and end the process."""
    code = 1
    # Ends a process whose parent was killed meanwhile.
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.alarm(2 * int(PATIENCE))
    try:
        size = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
        most = size * resource.getpagesize() + MEMORY
        _, hard = resource.getrlimit(resource.RLIMIT_AS)
        allowed = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.setrlimit(resource.RLIMIT_AS, (allowed, hard))
        # What dies here leaves no dump and no words.
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        faulthandler.disable()
        with guarded(path, kind):
            action(path)
        code = 0
    except InputError as error:
        os.write(writer, str(error).encode("utf-8", "replace")[:4096])
        code = 0
    finally:
        os._exit(code)


def _listen(reader: int) -> tuple[bytes, bool]:
    """Return what a process writes until it ends, and whether it ends in time."""
    message = b""
    until = time.monotonic() + PATIENCE
    while (left := until - time.monotonic()) > 0:
        if select.select([reader], [], [], left)[0]:
            piece = os.read(reader, 4096)
            if not piece:
                return message, True
            message += piece
    return message, False
