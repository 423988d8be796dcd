"""The command that draws the control chart of a ball."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from thud.base.display import draw_all
from thud.base.tables import format_rows
from thud.cli.command import results_of

if TYPE_CHECKING:
    import argparse


def run_history(options: argparse.Namespace) -> int:
    """Draw the control chart of the reports of a ball; return the exit code."""
    # Matplotlib and SciPy take their time.
    from thud.plot.files import figure_files
    from thud.report.ball_history import read_history
    from thud.report.ball_history_figure import draw_history

    history = read_history(options.reports, different_balls=options.different_balls)
    results = results_of(options, "history", options.reports)
    drawn = draw_all({"history": partial(draw_history, history)})
    paths = results.write(figure_files(drawn))
    if not options.quiet:
        print(history.title)
        print(format_rows(history.table()))
        for warning in history.warnings():
            print(warning)
        if paths:
            print(f"Chart: {paths[0]}")
    return 0
