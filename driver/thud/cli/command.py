"""Commands of ``thud-driver``: their type, shared arguments and messages."""

from __future__ import annotations

import argparse
import warnings
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from thud.base.display import draw_all, warn_if_not_drawn
from thud.base.errors import InputError, ReportWarning, ThudError
from thud.base.files import Results
from thud.cli.screen import print_notes, print_path, print_results
from thud.recordings.formats import FORMATS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from thud.floors.mobility_fit import MobilityFit
    from thud.floors.survey import RoomLevels

# Exit code of `--check` if a source does not conform.
NOT_CONFORMING = 3
# Names or flags of an argument, and its keywords for `add_argument`.
Argument = tuple[tuple[str, ...], dict[str, Any]]


class Command(NamedTuple):
    """A command; `after_interrupt` is its message after an interrupt."""

    help: str
    arguments: tuple[Argument, ...]
    # Returns the exit code.
    function: Callable[[argparse.Namespace], int]
    after_interrupt: str = "finished results are kept"


def argument(*names: str, **settings: object) -> Argument:
    """Return an argument from the parameters of ``add_argument``."""
    return names, settings


# Kinds of files by their endings, and the commands that read them.
FILE_KINDS = {".nml": "case", ".toml": "TOML file"} | dict.fromkeys(
    (ending for entry in FORMATS for ending in entry.suffixes), "recording"
)
READERS = {
    "case": "run, assess, compare, floor and predict",
    "TOML file": "sweep, sensitivity, design, uncertainty, surrogate and fit (or --construction)",
    "recording": "measure",
}


def file_of(*kinds: str) -> Callable[[str], str]:
    """Return the type of an argument that is a file of some kinds, which its ending shows."""

    def path(text: str) -> str:
        kind = FILE_KINDS.get(Path(text).suffix.lower())
        if kind is None or kind in kinds:
            return text
        message = f"{text} is a {kind}; allowed: a {' or '.join(kinds)}; for it: {READERS[kind]}"
        raise argparse.ArgumentTypeError(message)

    return path


def number(text: str) -> float:
    """Return the number that an option states; its error names a decimal comma."""
    try:
        return float(text)
    except ValueError as error:
        comma = " has a decimal comma; allowed: a point" if "," in text else " is not a number"
        message = f"{text!r}{comma}"
        raise argparse.ArgumentTypeError(message) from error


REPLACE = argument("--replace", action="store_true", help="also replace results of something else")


def output(meaning: str) -> tuple[Argument, Argument]:
    """Return the arguments of a command that writes results."""
    return argument("-o", "--output", metavar="DIR", help=f"directory for {meaning}"), REPLACE


def results_of(
    options: argparse.Namespace,
    default: str,
    inputs: Iterable[str | None] = (),
    subject: str = "",
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


# Endings of the files of a page.
PAGE = (".svg", ".html")
QUIET = argument("-q", "--quiet", action="store_true", help="show only errors and warnings")
NO_FIGURES = argument("--no-figures", action="store_true", help="write only the results")
FORMAT = argument(
    "--format",
    choices=("svg", "png", "pdf"),
    default="svg",
    help="format of the figures (default: svg)",
)


@contextmanager
def print_immediately() -> Iterator[None]:
    """Print warnings of reports as soon as they arise."""
    usual = warnings.showwarning

    def show(warning: Any, kind: type[Warning], *origin: Any) -> None:  # noqa: ANN401 - of any warning
        if issubclass(kind, ReportWarning):
            print_notes([warning])
        else:
            usual(warning, kind, *origin)

    with warnings.catch_warnings():
        warnings.simplefilter("always", ReportWarning)
        warnings.showwarning = show  # type: ignore[assignment]
        yield


def save_result(  # noqa: PLR0913, PLR0917 - all differ between commands
    options: argparse.Namespace,
    source: str,
    result: MobilityFit | RoomLevels,
    shown: str,
    file: tuple[str, bytes],
    figure: str,
) -> int:
    """Save file and figure of a result, print text and warnings; return the exit code.

    `source` is the path of the input file.
    """
    results = results_of(options, result.name, [source])
    contents = dict([file])
    if not options.no_figures:
        with warn_if_not_drawn(figure):
            from thud.plot.save_figures import figure_files

            contents |= figure_files(draw_all({figure: result.plot}))
    results.write(contents)
    if not options.quiet:
        print_results(shown)
    print_notes(result.notes)
    if not options.quiet:
        print_path("Results", results.folder)
    return 0


def exit_code(error: Exception) -> int:
    """Return the exit code of an error; an OSError counts as bad input."""
    return error.exit_code if isinstance(error, ThudError) else InputError.exit_code


def message_of(error: Exception) -> str:
    """Return the message of an error in one line."""
    if isinstance(error, OSError):
        path = error.filename or "standard output"
        return f"{path}: {error.strerror}; allowed: a path that you may write to"
    return str(error)
