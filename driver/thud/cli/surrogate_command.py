"""The command that trains a surrogate for studies and fits."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from thud.base.display import draw_all
from thud.base.tables import format_rows
from thud.cli.command import NO_FIGURES, QUIET, Command, argument, file_of, output
from thud.cli.screen import print_notes, print_path, print_results, shows_progress

if TYPE_CHECKING:
    import argparse


def train(options: argparse.Namespace) -> int:
    """Train a surrogate, print its errors and save them as a figure; return the exit code."""
    from thud.studies.surrogate import read_training, surrogate

    training = read_training(options.study)
    folder = Path(options.output or Path("outputs", training.name))
    trained = surrogate(
        training, folder, workers=options.workers, replace=options.replace,
        progress=shows_progress(quiet=options.quiet),
    )  # fmt: skip
    contents = {training.file: trained.to_bytes()}
    if not options.no_figures:
        from thud.plot.save_figures import figure_files

        contents |= figure_files(draw_all({training.name: trained.plot}))
    training.results(folder, replace=options.replace).write(contents)
    if not options.quiet:
        print_results(format_rows(trained.rows()))
    print_notes(trained.notes)
    if not options.quiet:
        print_path("Results", folder)
    return 0


SURROGATE = Command(
    "train a fast approximation of a slow model for other studies",
    (
        argument("study", type=file_of("TOML file"), metavar="STUDY.toml", help="study file"),
        *output("the surrogate; a training goes on there (default: outputs/<study name>)"),
        argument("--workers", type=int, metavar="N", help="threads (default: one per processor)"),
        NO_FIGURES,
        QUIET,
    ),
    train,
)
