"""The process ``thud-driver``, also ``python -m thud``."""

from __future__ import annotations

import os
import signal
import sys
from glob import glob
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from types import FrameType


def main() -> int:
    """Run the command line of this process; return the exit code."""
    # SIGTERM ends a command as Ctrl-C does: unfinished directories are removed.
    signal.signal(signal.SIGTERM, _interrupt)
    # Figures are written to files, even if the environment states another backend.
    os.environ["MPLBACKEND"] = "agg"
    # Windows gives redirected output a code page that lacks most characters, and leaves wildcards
    # to programs.
    encoding = None
    if sys.platform == "win32":
        encoding = "utf-8"
        sys.argv = [file for one in sys.argv for file in _files(one)]
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            # Names may have characters that the encoding of the output lacks.
            stream.reconfigure(encoding=encoding, errors="backslashreplace")  # type: ignore[union-attr]
    from thud.cli import main as run

    return run()


def _files(argument: str) -> list[str]:
    """Return the files that an argument with wildcards names, or the argument."""
    return ("*" in argument and sorted(glob(argument))) or [argument]  # noqa: PTH207 - of any path


def _interrupt(number: int, _: FrameType | None) -> None:
    raise KeyboardInterrupt(number)


if __name__ == "__main__":
    sys.exit(main())
