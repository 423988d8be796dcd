"""The commands that read study files: one for each kind of study, and fits."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from thud.base.errors import NumericalError, ThudError
from thud.base.files import replace_file
from thud.cli.command import NO_FIGURES, QUIET, command, figures_of, files, option, output
from thud.cli.screen import print_notes, print_path, print_results, print_status, shows_progress
from thud.studies.fit import read_fit_study, run_fit
from thud.studies.kinds import KINDS, result_type

if TYPE_CHECKING:
    import argparse

    from thud.studies.fitting.fit_result import Fit
    from thud.studies.study_result import SampleResult

_STUDY = files("study", "STUDY.toml", "study file", "TOML file")
_WORKERS = option("--workers", "N", "threads (default: one per processor)", type=int)


def run_study(options: argparse.Namespace) -> int:
    """Run a study, save files and figures, print its results; return the exit code."""
    result = result_type(options.name)
    from thud.studies.run import compute, describe
    from thud.studies.study import read_study

    study = read_study(options.study, options.name)
    if not options.quiet:
        print_status(describe(study))
    folder = Path(options.output or Path("outputs", study.name))
    try:
        computed = compute(
            result, study, folder, workers=options.workers, replace=options.replace,
            progress=shows_progress(quiet=options.quiet),
        )  # fmt: skip
    except ThudError as error:
        raise error.within(options.study) from error
    for name, content in figures_of(options, {study.name: computed.plot}).items():
        replace_file(folder / name, content)
    _print(options, computed, folder)
    return 0


def _print(options: argparse.Namespace, result: SampleResult | Fit, folder: Path) -> None:
    """Print results, their notes and their directory."""
    if not options.quiet:
        print_results(result.table())
    print_notes(f"{options.study}: {text}" for text in result.notes)
    if not options.quiet:
        print_path("Results", folder)


for _name, _kind in KINDS.items():
    command(
        _name,
        _kind.help,
        _STUDY,
        *output("the results; an interrupted study resumes there (default: outputs/<study name>)"),
        _WORKERS,
        NO_FIGURES,
        QUIET,
    )(run_study)


@command(
    "fit",
    "parameters of a model from a force or from levels",
    _STUDY,
    *output("the results (default: outputs/<study name>)"),
    NO_FIGURES,
    QUIET,
)
def fit(options: argparse.Namespace) -> int:
    """Run a fit, save files and figures, print its results; return the exit code."""
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
    _print(options, result, folder)
    return 0 if result.converged else NumericalError.exit_code
