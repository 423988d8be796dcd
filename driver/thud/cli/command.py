"""Type of the commands of ``thud-driver``, and the arguments and messages that they share."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from thud.errors import InputError, ThudError

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable

# Names or flags of an argument, and its settings for argparse.
Argument = tuple[tuple[str, ...], dict[str, Any]]


class Command(NamedTuple):
    """A row of the table of commands.

    Attributes
    ----------
    help : str
        What it does.
    arguments : tuple of Argument
        Its arguments.
    function : callable
        Runs it; returns the exit code.
    kept : str
        What remains after an interrupt, for its message.
    """

    help: str
    arguments: tuple[Argument, ...]
    function: Callable[[argparse.Namespace], int]
    kept: str = "finished results are kept"


def argument(*names: str, **settings: object) -> Argument:
    """Return an argument from the parameters of ``add_argument``."""
    return names, settings


def output(meaning: str, **settings: object) -> Argument:
    """Return the argument of the output directory."""
    return argument("-o", "--output", metavar="DIR", help=f"directory for {meaning}", **settings)


QUIET = argument("-q", "--quiet", action="store_true", help="show only errors and remarks")
NO_FIGURES = argument("--no-figures", action="store_true", help="results only")


def channel_of(text: str | None) -> int | str | None:
    """Return the number or the name of a channel."""
    return int(text) if text is not None and text.isdecimal() else text


def exit_code(error: Exception) -> int:
    """Return the exit code of an error; an OSError counts as bad input."""
    return error.exit_code if isinstance(error, ThudError) else InputError.exit_code


def sentence(error: Exception) -> str:
    """Return an error as one sentence."""
    if isinstance(error, OSError):
        place = error.filename or "standard output"
        return f"{place}: {error.strerror}; allowed: a place that you may write to"
    return str(error)
