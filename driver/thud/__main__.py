"""The process ``thud-driver``, also ``python -m thud``."""

from __future__ import annotations

import os
import signal
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from types import FrameType


def main() -> int:
    """Run the command line of this process; return the exit code."""
    # SIGTERM ends a command as Ctrl-C does: unfinished directories are removed.
    signal.signal(signal.SIGTERM, _interrupt)
    # Figures are written to files, even if the environment states another backend.
    os.environ["MPLBACKEND"] = "agg"
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            # Names may have characters that the encoding of the output lacks.
            stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]
    from thud.cli import main as run

    return run()


def _interrupt(number: int, _: FrameType | None) -> None:
    raise KeyboardInterrupt(number)


if __name__ == "__main__":
    sys.exit(main())
