"""The command that fits parameters of a model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from thud.base.errors import NumericalError, ThudError
from thud.cli.command import NO_FIGURES, QUIET, Command, argument, file_of, output
from thud.cli.screen import print_notes, print_path, print_results, print_status, shows_progress
from thud.studies.fit import read_fit_study, run_fit

if TYPE_CHECKING:
    import argparse


def run(options: argparse.Namespace) -> int:
    """Run a fit, print its results, save files and figures; return the exit code."""
    study = read_fit_study(options.study)
    if not options.quiet:
        names = ", ".join(parameter.name for parameter in study.parameters)
        print_status(f"{study.name}: {names} of {study.case.model.name}")  # type: ignore[union-attr]
    folder = Path(options.output or Path("outputs", study.name))
    try:
        result = run_fit(
            study, folder, figures=not options.no_figures,
            progress=shows_progress(quiet=options.quiet), replace=options.replace,
        )  # fmt: skip
    except ThudError as error:
        raise error.within(options.study) from error
    if not options.quiet:
        print_results(result.table())
    print_notes(f"{options.study}: {text}" for text in (*result.warnings, *result.notes))
    if not options.quiet:
        print_path("Results", folder)
    return 0 if result.converged else NumericalError.exit_code


FIT = Command(
    "parameters of a model from a force or from levels",
    (
        argument("study", type=file_of("TOML file"), metavar="STUDY.toml", help="study file"),
        *output("the results (default: outputs/<study name>)"),
        NO_FIGURES,
        QUIET,
    ),
    run,
    "nothing is written",
)
