"""What a command of ``thud-driver`` is, and the arguments and messages that several share."""

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
        What an interruption leaves.
    """

    help: str
    arguments: tuple[Argument, ...]
    function: Callable[[argparse.Namespace], int]
    kept: str = "what was finished is kept"


def argument(*names: str, **settings: object) -> Argument:
    """Return an argument."""
    return names, settings


def output(meaning: str, **settings: object) -> Argument:
    """Return the argument of a directory."""
    return argument("-o", "--output", metavar="DIR", help=f"directory for {meaning}", **settings)


QUIET = argument("-q", "--quiet", action="store_true", help="show nothing but errors and remarks")
NO_FIGURES = argument("--no-figures", action="store_true", help="results only")


def exit_code(error: Exception) -> int:
    """Return the exit code of an error; a file that cannot be written is bad input."""
    return error.exit_code if isinstance(error, ThudError) else InputError.exit_code


def sentence(error: Exception) -> str:
    """Return an error as one sentence."""
    if isinstance(error, OSError):
        place = error.filename or "standard output"
        return f"{place}: {error.strerror}; allowed: a place that you may write to"
    return str(error)
