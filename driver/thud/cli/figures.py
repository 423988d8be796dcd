"""The command that draws the figures of the paper and of the documentation."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from tqdm import tqdm

from thud.checks import require_output
from thud.studies.directory import save

if TYPE_CHECKING:
    import argparse


def draw_figures(options: argparse.Namespace) -> int:
    """Draw the figures of the paper and of the documentation; return the exit code."""
    from thud.figures import get_figures  # noqa: PLC0415 - matplotlib takes its time

    require_output(options.output)
    folder = Path(options.output)
    folder.mkdir(parents=True, exist_ok=True)
    for name, draw in tqdm(
        get_figures().items(), unit="figure", disable=options.quiet, leave=False
    ):
        save(folder, {}, {name: draw()})
    if not options.quiet:
        print(f"Figures: {folder}")
    return 0
