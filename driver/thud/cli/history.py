"""The command that draws the control chart of a ball."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from thud.display import draw_all
from thud.tables import format_rows

if TYPE_CHECKING:
    import argparse


def run_history(options: argparse.Namespace) -> int:
    """Draw the control chart of the reports of a ball; return the exit code."""
    # Matplotlib and SciPy take their time.
    from thud.plot.history import draw_history  # noqa: PLC0415
    from thud.plot.look import save_all  # noqa: PLC0415
    from thud.report.history import read_history  # noqa: PLC0415

    history = read_history(options.reports, different_balls=options.different_balls)
    folder = Path(options.output)
    folder.mkdir(parents=True, exist_ok=True)
    paths = save_all(draw_all({"history": partial(draw_history, history)}), folder)
    if not options.quiet:
        print(history.title)
        print(format_rows(history.table()))
        for remark in history.remarks():
            print(remark)
        print(*(f"Chart: {path}" for path in paths[:1]))
    return 0
