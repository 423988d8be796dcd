"""Signals and standard streams of the process ``thud-driver``.

This module imports only small modules of the standard library, so that interrupts and closed
outputs are handled even while the other modules are imported.
"""

from __future__ import annotations

import errno
import os
import signal
import sys
import time
import warnings
from contextlib import suppress
from typing import TYPE_CHECKING, Any, TextIO, cast

if TYPE_CHECKING:
    from collections.abc import Callable
    from io import TextIOWrapper
    from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM)
# Errors of an output whose pipe or descriptor is closed.
_CLOSED = frozenset({errno.EPIPE, errno.EBADF})
# Time during which a second signal counts as a copy of the first, s: some callers signal both the
# process and its group.
_COPY_TIME = 1.0


def main() -> int:
    """Run the command line of this process; return the exit code."""
    _handle(_end)
    _open_streams()
    # Figures are written to files, even if the environment states another backend.
    os.environ["MPLBACKEND"] = "agg"
    try:
        from thud.cli import main as run
    except (ImportError, MemoryError) as error:  # such as under a limit of memory
        reason = " ".join(str(error).split())[:200] or "out of memory"
        sys.stderr.write(f"thud-driver: a library cannot be loaded ({reason})\n")
        return 1

    # After an interrupt, coroutines would warn that they were never awaited.
    warnings.filterwarnings("ignore", "coroutine ")
    interrupt = _Interrupt()
    sys.unraisablehook = interrupt.show_lost
    _handle(interrupt)
    try:
        code = run()
    except (Exception, KeyboardInterrupt):
        # Compiled modules, such as those of matplotlib, may turn an interrupt into another error.
        if not interrupt.number:
            raise
        code = _report_interrupt(interrupt.number)
    if interrupt.number and code != 128 + interrupt.number:
        # The interrupt became an error of a figure, which only raised a warning.
        code = _report_interrupt(interrupt.number)
    _handle(signal.SIG_IGN)
    return code


def _handle(handler: Any) -> None:  # noqa: ANN401 - as `signal.signal` takes it
    """Set the handler of the signals that end the process, except ignored signals."""
    for number in SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, handler)


def _end(number: int, _: FrameType | None) -> None:
    os._exit(_report_interrupt(number))


def _report_interrupt(number: int) -> int:
    """Report an interrupt; return the exit code."""
    with suppress(OSError):
        os.write(2, b"thud-driver: interrupted; finished results are kept\n")
    return 128 + number


class _Interrupt:
    """Handler of signals: the first raises KeyboardInterrupt, the next ends the process."""

    def __init__(self) -> None:
        self.number = 0
        self.time = 0.0

    def __call__(self, number: int, frame: FrameType | None) -> None:
        if not self.number:
            self.number, self.time = number, time.monotonic()
            raise KeyboardInterrupt(number)
        if time.monotonic() > self.time + _COPY_TIME:
            _end(number, frame)

    def show_lost(self, lost: sys.UnraisableHookArgs) -> None:
        """Print errors of destructors, except those of incomplete objects after an interrupt."""
        if not self.number:
            sys.__unraisablehook__(lost)


def _open_streams() -> None:
    """Open closed standard descriptors, so that no file gets their number; wrap the streams."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_WRONLY if number == 0 else os.O_RDONLY)
    stdout = sys.stdout or os.fdopen(1, "w", closefd=False)
    # Names may have characters that the encoding of the output lacks.
    cast("TextIOWrapper", stdout).reconfigure(errors="backslashreplace")
    sys.stdout = cast("TextIO", _Stream(stdout, _CLOSED))
    stderr = sys.stderr or os.fdopen(2, "w", closefd=False)
    sys.stderr = cast("TextIO", _Stream(stderr, frozenset(errno.errorcode)))


class _Stream:
    """Standard stream that discards text if writing fails with one of some error numbers."""

    def __init__(self, stream: TextIO, reasons: frozenset[int]) -> None:
        self._stream = stream
        self._reasons = reasons

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - whatever the stream has
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        self._try(lambda: self._stream.write(text))
        return len(text)

    def flush(self) -> None:
        self._try(self._stream.flush)

    def _try(self, write: Callable[[], object]) -> None:
        try:
            write()
        except OSError as error:
            if error.errno not in self._reasons:
                raise
            # Buffered text is discarded as well.
            os.dup2(os.open(os.devnull, os.O_WRONLY), self._stream.fileno())
