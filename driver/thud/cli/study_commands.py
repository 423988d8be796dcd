"""The commands that run studies: one for each kind of study."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from thud.base.display import warn_if_not_drawn
from thud.base.errors import NumericalError, ThudError
from thud.cli.command import NO_FIGURES, QUIET, Command, argument, file_of, output
from thud.cli.screen import print_notes, print_path, print_results, print_status, shows_progress
from thud.studies.directory import open_directory
from thud.studies.kinds import KINDS, get_kind

if TYPE_CHECKING:
    import argparse

    from thud.studies.kind import RunOptions

_STUDY = argument("study", type=file_of("TOML file"), metavar="STUDY.toml", help="study file")
_SAMPLES = (
    argument("--yes", dest="allow_large", action="store_true", help="allow any number of samples"),
    argument("--workers", type=int, metavar="N", help="threads (default: one per processor)"),
    argument(
        "--scheduler",
        metavar="ADDRESS",
        help="address of a Dask scheduler, such as tcp://host:8786",
    ),
)


def study_commands() -> dict[str, Command]:
    """Return the command of each kind of study."""
    return {
        name: Command(
            info.help,
            (
                _STUDY,
                *output(
                    "the results"
                    + ("; an interrupted study resumes there" if info.has_samples else "")
                    + " (default: outputs/<study name>)"
                ),
                *(_SAMPLES if info.has_samples else ()),
                NO_FIGURES,
                QUIET,
            ),
            run_study,
            Command._field_defaults["after_interrupt"]
            if info.has_samples
            else "nothing is written",
        )
        for name, info in KINDS.items()
    }


def run_study(options: argparse.Namespace) -> int:
    """Run a study, print its results, save files and figures; return the exit code."""
    kind = get_kind(options.name)
    study = kind.read_study(options.study)
    run_options: RunOptions = {
        "progress": shows_progress(quiet=options.quiet),
        "replace": options.replace,
    }
    if KINDS[options.name].has_samples:
        run_options |= {
            "workers": options.workers,
            "allow_large": options.allow_large,
        }
    address = getattr(options, "scheduler", None)
    kind.require_runnable(study, **run_options)
    folder = Path(options.output or Path("outputs", study.name))
    if not options.quiet:
        print_status(kind.describe(study))
    figures = not options.no_figures
    directory = open_directory(folder, kind, study, replace=options.replace, figures=figures)
    try:
        with ExitStack() as stack:
            if address:
                from thud.studies.backends import dask_executor

                run_options["executor"] = stack.enter_context(dask_executor(address))
            result = kind.compute(study, directory, **run_options)
    except ThudError as error:
        raise error.within(options.study) from error
    if not options.quiet:
        print_results(result.table())
    print_notes(f"{options.study}: {text}" for text in (*result.warnings, *result.notes))
    contents = kind.files(result, study)
    if figures:
        with warn_if_not_drawn("the figure of the study"):
            from thud.plot import figure_files

            contents |= figure_files(result.figures(study.name))
    directory.write(contents)
    if not options.quiet:
        print_path("Results", folder)
    return 0 if result.succeeded else NumericalError.exit_code
