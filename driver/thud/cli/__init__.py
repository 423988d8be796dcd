"""The command ``thud-driver``: cases with figures, recordings, floors, fits and studies."""

from __future__ import annotations

import argparse
import os
import re
import signal
import sys
from typing import TYPE_CHECKING, NoReturn

from thud.base.bridge import version
from thud.base.checks import suggestion
from thud.base.errors import InputError, NumericalError, ThudError
from thud.base.tables import wrap
from thud.cli.case_commands import (
    ASSESS,
    EXAMPLES,
    EXPORT,
    compare_cases,
    run_cases,
)
from thud.cli.command import (
    FORMAT,
    NO_FIGURES,
    QUIET,
    Command,
    argument,
    exit_code,
    file_of,
    message_of,
    output,
    print_immediately,
)
from thud.cli.explore_command import EXPLORE
from thud.cli.floor_commands import FLOOR, LISTEN, MOBILITY, PREDICT, RATE
from thud.cli.recording_commands import CALIBRATE, MEASURE, run_history
from thud.cli.screen import is_terminal, print_error
from thud.cli.study_commands import study_commands
from thud.cli.surrogate_command import SURROGATE
from thud.level.levels import FORCES, SOURCES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from _typeshed import SupportsWrite

# Exit code after a signal: this plus the number of the signal.
INTERRUPTED = 128

COMMANDS = {
    "run": Command(
        "run cases, write their results and figures",
        (
            argument(
                "cases", nargs="+", type=file_of("case"), metavar="CASE.nml", help="namelist files"
            ),
            *output(
                "the results; several cases have a subdirectory each (default: outputs/<case name>)"
            ),
            argument(
                "--check",
                action="store_true",
                help="exit with 3 unless all sources conform with the values of their cases "
                "(assess --check: over what is not known)",
            ),
            NO_FIGURES,
            FORMAT,
            argument(
                "--all",
                action="store_true",
                help="also write quantities of the model against time (model_histories.csv) and "
                "every figure",
            ),
            argument(
                "--animation",
                action="store_true",
                help="also write motion.gif of cases with snapshots",
            ),
            argument(
                "-v",
                "--verbose",
                action="store_true",
                help="also show numbers of the solver: resolution, quantities of the model",
            ),
            QUIET,
        ),
        run_cases,
    ),
    "assess": ASSESS,
    "compare": Command(
        "compare models and recordings of the same drop on one page",
        (
            argument(
                "cases",
                nargs="+",
                type=file_of("case", "recording"),
                metavar="CASE.nml|RECORD.csv",
                help="namelist files, and recordings with columns of time, s, and force, N",
            ),
            *output("the page (default: outputs/comparison)"),
            argument(
                "--force",
                choices=FORCES,
                help="force to compare (default: &levels force of each case)",
            ),
            argument(
                "--source",
                choices=SOURCES,
                help="source of the limits (default: &limits source of the cases)",
            ),
            QUIET,
        ),
        compare_cases,
        "nothing is written",
    ),
    "explore": EXPLORE,
    "measure": MEASURE,
    "calibrate": CALIBRATE,
    "export": EXPORT,
    "history": Command(
        "control chart of a ball from its calibration reports",
        (
            argument(
                "reports",
                nargs="+",
                metavar="REPORT",
                help="report.json files, or directories with such files",
            ),
            *output("the chart (default: outputs/history)"),
            argument(
                "--different-balls", action="store_true", help="allow reports of different balls"
            ),
            QUIET,
        ),
        run_history,
    ),
    "rate": RATE,
    "floor": FLOOR,
    "listen": LISTEN,
    "predict": PREDICT,
    "mobility": MOBILITY,
    **study_commands(),
    "surrogate": SURROGATE,
    "examples": EXAMPLES,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command with arguments, by default those of this process; return the exit code."""
    after_interrupt = Command._field_defaults["after_interrupt"]
    try:
        options = _parse(arguments)
        if isinstance(options, int):
            code = options
        else:
            command = COMMANDS[options.name]
            after_interrupt = command.after_interrupt
            folder = getattr(options, "output", None)
            if folder is not None and not folder.strip():
                message = "--output has no value; allowed: a path"
                raise InputError(message)
            with print_immediately():
                code = command.function(options)
        print(end="", flush=True)
    except BrokenPipeError:
        # The reader of the output has ended, such as `head`.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = InputError.exit_code
    except KeyboardInterrupt as interrupt:
        print_error(f"interrupted; {after_interrupt}")
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


def _parse(arguments: Sequence[str] | None) -> argparse.Namespace | int:
    """Return the options, or an exit code if argparse has printed help or an error."""
    try:
        return new_parser().parse_args(arguments)
    except SystemExit as stop:
        # argparse exits with 2 for bad usage; here 2 means a numerical failure.
        return InputError.exit_code if stop.code else 0


class _Parser(argparse.ArgumentParser):
    """Parser that suggests a similar word, and raises if its output cannot be written."""

    def error(self, message: str) -> NoReturn:
        match = re.search(r"(?:invalid choice: '|unrecognized arguments: )([\w-]+)", message)
        super().error(message + (_hint(match[1]) if match else ""))

    def _print_message(self, message: str, file: SupportsWrite[str] | None = None) -> None:
        to_screen = file in {None, sys.stderr} and is_terminal(sys.stderr)
        print(wrap(message) if to_screen else message, end="", file=file or sys.stderr)


def _hint(word: str) -> str:
    """Return the commands that have an option, or the suggestion of a similar word."""
    owners = [
        name
        for name, command in COMMANDS.items()
        if any(word in names for names, _ in command.arguments)
    ]
    if owners:
        return f" ({word} is an option of {', '.join(owners)})"
    return suggestion(word, _words())


def _words() -> list[str]:
    """Return all commands, options, and choices of options."""
    arguments = [entry for command in COMMANDS.values() for entry in command.arguments]
    options = [name for names, _ in arguments for name in names if name.startswith("--")]
    choices = [choice for _, settings in arguments for choice in settings.get("choices", ())]
    return [*COMMANDS, *options, *choices]


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
