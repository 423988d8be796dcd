"""The commands that run studies: one for each kind of study."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from thud.base.display import warn_if_not_drawn
from thud.base.errors import NumericalError, ThudError
from thud.base.files import replace_file
from thud.cli.command import NO_FIGURES, QUIET, Command, argument, file_of, output
from thud.cli.screen import print_notes, print_path, print_results, print_status, shows_progress
from thud.studies.kinds import KINDS, result_type

if TYPE_CHECKING:
    import argparse

    from thud.studies.run import RunOptions

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
    results = "the results; an interrupted study resumes there (default: outputs/<study name>)"
    arguments = (_STUDY, *output(results), *_SAMPLES, NO_FIGURES, QUIET)
    return {name: Command(kind.help, arguments, run_study) for name, kind in KINDS.items()}


def run_study(options: argparse.Namespace) -> int:
    """Run a study, print its results, save files and figures; return the exit code."""
    result = result_type(options.name)
    from thud.studies.run import compute, dask_executor, describe
    from thud.studies.study import read_study

    study = read_study(options.study, options.name)
    if not options.quiet:
        print_status(describe(study))
    folder = Path(options.output or Path("outputs", study.name))
    figures = () if options.no_figures else (f"{study.name}.svg",)
    run_options: RunOptions = {
        "workers": options.workers,
        "allow_large": options.allow_large,
        "progress": shows_progress(quiet=options.quiet),
        "replace": options.replace,
    }
    scheduler = options.scheduler
    try:
        with dask_executor(scheduler) if scheduler else nullcontext() as executor:
            run_options["executor"] = executor
            computed = compute(result, study, folder, figures, **run_options)
    except ThudError as error:
        raise error.within(options.study) from error
    if not options.quiet:
        print_results(computed.table())
    print_notes(f"{options.study}: {text}" for text in (*computed.warnings, *computed.notes))
    if computed.succeeded and not options.no_figures:
        with warn_if_not_drawn("the figure of the study"):
            from thud.plot.save_figures import figure_files

            for name, content in figure_files({study.name: computed.plot()}).items():
                replace_file(folder / name, content)
    if not options.quiet:
        print_path("Results", folder)
    return 0 if computed.succeeded else NumericalError.exit_code
