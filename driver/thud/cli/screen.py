"""What the commands print: results, messages and progress, for terminals and for logs."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING, TextIO

from tqdm import tqdm

from thud.base.tables import WIDTH, wrap

if TYPE_CHECKING:
    from collections.abc import Iterable

    from thud.base.note import Note

RED, YELLOW = 31, 33
# The library marks verdicts by these characters, which its own command shows as colors.
_MARKS = dict.fromkeys(range(1, 5))


def print_results(text: str) -> None:
    """Print results above any progress bar."""
    tqdm.write(wrap(text.translate(_MARKS)), file=sys.stdout)


def print_path(title: str, path: object) -> None:
    """Print a path in one piece, below its title if both are wider than a terminal."""
    line = f"{title}: {path}"
    tqdm.write(line if len(line) <= WIDTH else f"{title}:\n{path}", file=sys.stdout)


def print_notes(notes: Iterable[Note | str]) -> None:
    """Print notes, with their subjects, or texts above any progress bar."""
    for note in notes:
        _print_message(note if isinstance(note, str) else note.message, YELLOW)


def print_error(message: str) -> None:
    """Print an error above any progress bar."""
    _print_message(message, RED)


def print_status(text: str) -> None:
    """Print what is computed beside the results, above any progress bar."""
    tqdm.write(wrap(text) if is_terminal(sys.stderr) else text, file=sys.stderr)


def is_terminal(stream: TextIO) -> bool:
    """Whether a stream is a terminal; one that is closed is none."""
    return not stream.closed and stream.isatty()


def shows_progress(*, quiet: bool) -> bool:
    """Whether progress is shown: on terminals, but not in logs."""
    return not quiet and is_terminal(sys.stderr)


def _print_message(message: str, color: int) -> None:
    """Print a message; in a log it stays one line."""
    name = "thud-driver:"
    text = f"{name} {message}"
    if is_terminal(sys.stderr):
        text = wrap(text)
    # See no-color.org.
    wanted = not os.environ.get("NO_COLOR") and os.environ.get("TERM", "dumb") not in {"", "dumb"}
    if wanted and is_terminal(sys.stderr):
        text = text.replace(name, f"\033[{color}m{name}\033[0m", 1)
    tqdm.write(text, file=sys.stderr)
