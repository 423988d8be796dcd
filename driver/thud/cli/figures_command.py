"""The commands that only draw: comparisons, and the figures of paper and documentation."""

from __future__ import annotations

import sys
import warnings
from typing import TYPE_CHECKING

from tqdm import tqdm

from thud.base.display import draw_all
from thud.base.errors import PlausibilityWarning
from thud.base.tables import format_rows
from thud.cli.command import PAGE, print_notes, results_of

if TYPE_CHECKING:
    import argparse


def compare_cases(options: argparse.Namespace) -> int:
    """Compare cases and recordings; return the exit code."""
    from thud.comparison import comparison

    results = results_of(options, "comparison", options.cases)
    results.require(f"comparison{ending}" for ending in PAGE)
    found = comparison.read_all(options.cases)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PlausibilityWarning)
        page = comparison.compare(
            found,
            options.force,
            options.source,
            progress=not options.quiet and sys.stderr.isatty(),
        )
    print_notes(page.warnings)
    paths = results.write(page.files())
    if not options.quiet:
        print(format_rows(page.table()))
        print(f"Page: {paths[-1]}")
    return 0


def draw_figures(options: argparse.Namespace) -> int:
    """Draw the figures of the paper and of the documentation; return the exit code."""
    from thud.plot import documentation, figure_files

    results = results_of(options, "figures")
    for name, draw in tqdm(
        documentation.FIGURES.items(), unit="figure", disable=options.quiet or None, leave=False
    ):
        results.write(figure_files(draw_all({name: draw}), options.format))
    if not options.quiet:
        print(f"Figures: {results.folder}")
    return 0
