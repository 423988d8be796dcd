"""The command ``thud-driver``: cases with figures, recordings, floors, fits and studies."""

from __future__ import annotations

import argparse
import os
import signal
import sys
from typing import TYPE_CHECKING, NoReturn

from thud.base.bridge import version
from thud.base.checks import refuse, suggestion
from thud.base.errors import InputError, NumericalError, ThudError
from thud.base.tables import wrap
from thud.cli import (  # noqa: F401 - the modules of the commands
    case_commands,
    explore_command,
    floor_commands,
    recording_commands,
    study_commands,
)
from thud.cli.command import COMMANDS, FILE_KINDS, exit_code, kind_of, message_of, print_immediately
from thud.cli.screen import is_terminal, print_error

if TYPE_CHECKING:
    from collections.abc import Sequence

    from _typeshed import SupportsWrite

# Exit code after a signal: this plus the number of the signal.
INTERRUPTED = 128


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command with arguments, by default those of this process; return the exit code."""
    try:
        options = _parse(sys.argv[1:] if arguments is None else arguments)
        if isinstance(options, int):
            code = options
        else:
            folder = getattr(options, "output", None)
            if folder is not None and not folder.strip():
                refuse("--output has no value", "a path")
            with print_immediately():
                code = COMMANDS[options.name].function(options)
        print(end="", flush=True)
    except BrokenPipeError:
        # The reader of the output has ended, such as `head`.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = InputError.exit_code
    except KeyboardInterrupt as interrupt:
        print_error("interrupted")
        return INTERRUPTED + next(iter(interrupt.args), signal.SIGINT)
    except (ThudError, OSError) as error:
        if isinstance(error, OSError) and error.filename is None:
            # Standard output is full: discard what is still buffered.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        print_error(message_of(error))
        return exit_code(error)
    except MemoryError as error:
        cause = f" ({error})" if str(error) else ""
        print_error(f"not enough memory{cause}; allowed: a smaller task, or more memory")
        return NumericalError.exit_code
    return code


def _parse(arguments: Sequence[str]) -> argparse.Namespace | int:
    """Return the options, or an exit code if argparse has printed help or an error.

    Raise InputError for an unknown command, which may be a file of a known kind.
    """
    first = next(iter(arguments), "-")
    if not first.startswith("-") and first not in COMMANDS:
        if kind := kind_of(first):
            refuse(f"{first} is a {kind}, no command", f"thud-driver {FILE_KINDS[kind][1]}")
        refuse(f"{first} is no command{suggestion(first, COMMANDS)}", ", ".join(COMMANDS))
    try:
        return new_parser().parse_args(arguments)
    except SystemExit as stop:
        # argparse exits with 2 for bad usage; here 2 means a numerical failure.
        return InputError.exit_code if stop.code else 0


class _Parser(argparse.ArgumentParser):
    """Parser that wraps messages, and raises if its output cannot be written."""

    def _print_message(self, message: str, file: SupportsWrite[str] | None = None) -> None:
        to_screen = file in {None, sys.stderr} and is_terminal(sys.stderr)
        print(wrap(message) if to_screen else message, end="", file=file or sys.stderr)

    def error(self, message: str) -> NoReturn:
        """Print one sentence without the usage, which --help prints."""
        self.exit(InputError.exit_code, f"{self.prog}: {message} (usage: {self.prog} --help)\n")


def new_parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = _Parser(
        prog="thud-driver",
        description="Cases with figures, recordings, floors, fits and studies.",
        epilog="Exit codes: 0 done, 1 bad input or usage, 2 numerical failure, "
        "3 not conforming (--check), 130 interrupted, 143 terminated. Environment: NO_COLOR=1 "
        "shows no colors.",
    )
    parser.add_argument("--version", action="version", version=f"thud {version()}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND", dest="name")
    for name, command in COMMANDS.items():
        subparser = commands.add_parser(name, help=command.help)
        for names, settings in command.arguments:
            subparser.add_argument(*names, **settings)
    return parser
