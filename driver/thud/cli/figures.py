"""The command that draws the figures of the paper and of the documentation."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from tqdm import tqdm

from thud.checks import require_output
from thud.studies.directory import FORMATS

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable

    from matplotlib.figure import Figure


def draw_figures(options: argparse.Namespace) -> int:
    """Draw the figures of the paper and of the documentation; return the exit code."""
    from thud.figures import get_figures  # noqa: PLC0415 - matplotlib takes its time

    require_output(options.output)
    folder = Path(options.output)
    folder.mkdir(parents=True, exist_ok=True)
    draw_all(folder, get_figures(), quiet=options.quiet)
    if not options.quiet:
        print(f"Figures: {folder}")
    return 0


def draw_all(folder: Path, figures: dict[str, Callable[[], Figure]], *, quiet: bool = True) -> None:
    """Draw figures and save them as PNG and SVG."""
    from thud.plot import save  # noqa: PLC0415 - matplotlib takes its time

    for name, draw in tqdm(figures.items(), unit="figure", disable=quiet, leave=False):
        figure = draw()
        for ending in FORMATS:
            save(figure, folder / f"{name}{ending}")
