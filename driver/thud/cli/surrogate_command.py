"""The command that trains a surrogate for studies and fits."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from thud.base.tables import format_rows
from thud.cli.command import (
    NO_FIGURES,
    QUIET,
    Command,
    figures_of,
    files,
    finish,
    option,
    output,
)
from thud.cli.screen import shows_progress

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
    contents |= figures_of(options, {training.name: trained.plot})
    results = training.results(folder, replace=options.replace)
    return finish(options, results, contents, format_rows(trained.rows()), trained.notes)


SURROGATE = Command(
    "train a fast approximation of a slow model for other studies",
    (
        files("study", "STUDY.toml", "study file", "TOML file"),
        *output("the surrogate; a training goes on there (default: outputs/<study name>)"),
        option("--workers", "N", "threads (default: one per processor)", type=int),
        NO_FIGURES,
        QUIET,
    ),
    train,
)
