"""The commands that only draw: comparisons, and the figures of paper and documentation."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

from tqdm import tqdm

from thud.cli.command import tell
from thud.display import draw_all
from thud.errors import PlausibilityWarning
from thud.tables import format_rows

if TYPE_CHECKING:
    import argparse


def compare_cases(options: argparse.Namespace) -> int:
    """Compare cases and recordings; return the exit code."""
    from thud import comparison  # noqa: PLC0415 - matplotlib takes its time

    found = comparison.read_all(options.cases)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PlausibilityWarning)
        page = comparison.compare(
            found,
            options.force,
            options.source,
            progress=not options.quiet and sys.stderr.isatty(),
        )
    tell(page.remarks)
    paths = page.save(options.output)
    if not options.quiet:
        print(format_rows(page.table()))
        print(f"Page: {paths[-1]}")
    return 0


def draw_figures(options: argparse.Namespace) -> int:
    """Draw the figures of the paper and of the documentation; return the exit code."""
    from thud import plot  # noqa: PLC0415 - matplotlib takes its time

    folder = Path(options.output)
    folder.mkdir(parents=True, exist_ok=True)
    figures = plot.documentation_figures()
    for name, draw in tqdm(
        figures.items(), unit="figure", disable=options.quiet or None, leave=False
    ):
        plot.save_all(draw_all({name: draw}), folder)
    if not options.quiet:
        print(f"Figures: {folder}")
    return 0
