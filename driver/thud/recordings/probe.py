"""Probe of a file in a subprocess, because a library may hang, crash or fill memory."""

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

# Maximum time, s, and additional memory, bytes, of the subprocess.
TIMEOUT = 10.0
MEMORY = 2**29


def probe_in_subprocess(action: Callable[[Path], object], path: Path, kind: str) -> None:
    """Run an action on a file in a forked process.

    Raise InputError if the action does, or if the process hangs, crashes or runs out of memory.
    """
    reader, writer = os.pipe()
    with guarded(path, kind):  # Python warns of a fork with threads; the child starts none
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
        reason = "makes its library crash" if ended else f"cannot be read within {TIMEOUT:g} s"
        refuse(f"{shown_path(path)}: {reason}", f"an undamaged {kind} file")


def _report(action: Callable[[Path], object], path: Path, kind: str, writer: int) -> None:
    """Run an action, write its error to a pipe, and end the process."""
    code = 1
    # The alarm ends this process if its parent is killed.
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.alarm(2 * int(TIMEOUT))
    try:
        size = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
        limit = size * resource.getpagesize() + MEMORY
        _, hard = resource.getrlimit(resource.RLIMIT_AS)
        limit = limit if hard == resource.RLIM_INFINITY else min(limit, hard)
        resource.setrlimit(resource.RLIMIT_AS, (limit, hard))
        # A crash leaves no core dump and no output.
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
    """Return the output of a process until it ends, and whether it ends in time."""
    message = b""
    end = time.monotonic() + TIMEOUT
    while (remaining := end - time.monotonic()) > 0:
        if select.select([reader], [], [], remaining)[0]:
            piece = os.read(reader, 4096)
            if not piece:
                return message, True
            message += piece
    return message, False
