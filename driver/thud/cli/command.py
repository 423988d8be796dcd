"""Commands of ``thud-driver``: their type, shared arguments, results and messages."""

from __future__ import annotations

import argparse
import warnings
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from thud.base._schema import VERDICTS
from thud.base.display import draw_all, warn_if_not_drawn
from thud.base.errors import InputError, PlausibilityWarning, ReportWarning, ThudError
from thud.base.files import Results
from thud.cli.screen import print_notes, print_path, print_results
from thud.recordings.formats import FORMATS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    from matplotlib.figure import Figure

    from thud.base.note import Note
    from thud.level.assessment import Verdict

    Function = Callable[[argparse.Namespace], int]

# Exit code of `--check` if a source does not conform.
NOT_CONFORMING = 3
# Names or flags of an argument, and its keywords for `add_argument`.
Argument = tuple[tuple[str, ...], dict[str, Any]]


class Command(NamedTuple):
    """A command."""

    help: str
    arguments: tuple[Argument, ...]
    # Returns the exit code.
    function: Function


# All commands by their names, in the order of the help.
COMMANDS: dict[str, Command] = {}


def command(name: str, meaning: str, *arguments: Argument) -> Callable[[Function], Function]:
    """Make a function the command of a name; see `Command`."""

    def add(function: Function) -> Function:
        COMMANDS[name] = Command(meaning, arguments, function)
        return function

    return add


def argument(*names: str, **settings: object) -> Argument:
    """Return an argument from the parameters of ``add_argument``."""
    return names, settings


def flag(name: str, meaning: str, **settings: object) -> Argument:
    """Return an option without a value."""
    return argument(name, action="store_true", help=meaning, **settings)


def option(name: str, value: str, meaning: str, **settings: object) -> Argument:
    """Return an option with a value, such as ``"HZ"``."""
    return argument(name, metavar=value, help=meaning, **settings)


_OF_TOML = (
    "fit, sweep, sensitivity, design, uncertainty or surrogate (a study), floor, listen or predict "
    "(a construction), measure --config (a laboratory)"
)
# Kinds of files: their endings, and the commands that read them.
FILE_KINDS: dict[str, tuple[tuple[str, ...], str]] = {
    "case": ((".nml",), "run, assess, compare, export, explore, floor, listen or predict"),
    "TOML file": ((".toml",), _OF_TOML),
    "recording": (tuple(ending for entry in FORMATS for ending in entry.suffixes),
                  "measure, calibrate, compare or export"),
    "calibration report": ((".json",), "history"),
    "table of levels": ((".xlsx",), "rate"),
    "directory": ((), "explore or history"),
}  # fmt: skip


def kind_of(text: str) -> str:
    """Return the kind of a file by its ending, empty if it is not known; see `FILE_KINDS`."""
    try:
        if Path(text).is_dir():
            return "directory"
    except ValueError:  # a zero byte
        return ""
    ending = Path(text).suffix.lower()
    return next((kind for kind, (endings, _) in FILE_KINDS.items() if ending in endings), "")


def file_of(*kinds: str) -> Callable[[str], str]:
    """Return the type of an argument that is a file of some kinds, which its ending shows."""

    def path(text: str) -> str:
        kind = kind_of(text)
        if kind and kind not in kinds:
            message = (
                f"{text} is a {kind}; allowed: a {' or '.join(kinds)}; a {kind} is "
                f"read by thud-driver {FILE_KINDS[kind][1]}"
            )
            raise argparse.ArgumentTypeError(message)
        endings = (ending for name in kinds for ending in FILE_KINDS[name][0])
        meant = next((text + e for e in endings if not kind and Path(text + e).is_file()), "")
        if meant:
            message = f"{text} has no ending; allowed: {meant}"
            raise argparse.ArgumentTypeError(message)
        return text

    return path


def files(name: str, value: str, meaning: str, *kinds: str, nargs: str | None = None) -> Argument:
    """Return an argument that is a file of some kinds, or several such files."""
    return argument(name, metavar=value, help=meaning, type=file_of(*kinds), nargs=nargs)


def number(text: str) -> float:
    """Return the number that an option states; its error names a decimal comma."""
    try:
        return float(text)
    except ValueError as error:
        comma = " has a decimal comma; allowed: a point" if "," in text else " is not a number"
        message = f"{text!r}{comma}"
        raise argparse.ArgumentTypeError(message) from error


QUIET = argument("-q", "--quiet", action="store_true", help="show only errors and warnings")
NO_FIGURES = flag("--no-figures", "write only the results")


def output(meaning: str) -> tuple[Argument, Argument]:
    """Return the arguments of a command that writes results."""
    folder = argument("-o", "--output", metavar="DIR", help=f"directory for {meaning}")
    return folder, flag("--replace", "also replace results of something else")


def results_of(
    options: argparse.Namespace, default: str, inputs: Iterable[str | None] = (), subject: str = ""
) -> Results:
    """Return the results directory of a command, by default in ``outputs``.

    The input files of the command are never replaced.
    """
    return Results(
        Path(options.output or Path("outputs", default)),
        options.name,
        subject,
        tuple(path for path in inputs if path is not None),
        replace=options.replace,
    )


def figures_of(
    options: argparse.Namespace, draws: Mapping[str, Callable[[], Figure | None]]
) -> dict[str, bytes]:
    """Return the figures that a command draws, as files, unless it is to draw none."""
    contents: dict[str, bytes] = {}
    if not getattr(options, "no_figures", False):
        with warn_if_not_drawn("a figure"):
            from thud.plot.save_figures import figure_files

            contents = figure_files(draw_all(draws), getattr(options, "format", "svg"))
    return contents


def finish(  # noqa: PLR0913, PLR0917 - all that a command shows
    options: argparse.Namespace,
    results: Results,
    contents: Mapping[str, bytes],
    shown: str,
    notes: Iterable[Note | str] = (),
    verdict: Verdict | None = None,
) -> int:
    """Write files, print text, notes and the path of the results; return the exit code.

    With the option `check` the code is that of the verdict.
    """
    results.write(contents)
    if not options.quiet:
        print_results(shown)
    print_notes(notes)
    if not options.quiet:
        print_path("Results", results.folder)
    fails = verdict is not None and options.check and verdict.conforms != VERDICTS[0]
    return NOT_CONFORMING if fails else 0


@contextmanager
def print_immediately() -> Iterator[None]:
    """Print warnings of reports as soon as they arise; results hold those of plausibility."""
    usual = warnings.showwarning

    def show(warning: Any, kind: type[Warning], *origin: Any) -> None:  # noqa: ANN401 - of any warning
        if issubclass(kind, ReportWarning):
            print_notes([str(warning)])
        else:
            usual(warning, kind, *origin)

    with warnings.catch_warnings():
        warnings.simplefilter("always", ReportWarning)
        warnings.simplefilter("ignore", PlausibilityWarning)
        warnings.showwarning = show  # type: ignore[assignment]
        yield


def exit_code(error: Exception) -> int:
    """Return the exit code of an error; an OSError counts as bad input."""
    return error.exit_code if isinstance(error, ThudError) else InputError.exit_code


def message_of(error: Exception) -> str:
    """Return the message of an error in one line."""
    if isinstance(error, OSError):
        path = error.filename or "standard output"
        return f"{path}: {error.strerror}; allowed: a path that you may write to"
    return str(error)
