"""The command that makes a floor of a measured mobility."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from thud.cli.command import NO_FIGURES, QUIET, Command, argument, output
from thud.files import replace_file
from thud.tables import format_rows

if TYPE_CHECKING:
    import argparse


def fit(options: argparse.Namespace) -> int:
    """Fit a measured mobility, print the errors, save the floor; return the exit code."""
    from thud.floors.mobility_fit import fit_mobility  # noqa: PLC0415

    found = fit_mobility(options.table, quantity=options.quantity, order=options.order)
    folder = Path(options.output or Path("outputs", found.name))
    figures = {}
    if not options.no_figures:
        from thud.plot.mobility_fit import mobility_fit  # noqa: PLC0415 - Matplotlib takes its time

        figures = {"mobility_fit": mobility_fit(found)}
    folder.mkdir(parents=True, exist_ok=True)
    replace_file(folder / "measured_mobility.nml", found.namelist().encode())
    if figures:
        from thud.plot.look import save_all  # noqa: PLC0415

        save_all(figures, folder)
    if not options.quiet:
        print(repr(found)[1:-1])
        print(format_rows(found.rows()))
    for remark in found.remarks:
        print(f"thud-driver: {remark}", file=sys.stderr)
    if not options.quiet:
        print(f"Results: {folder}")
    return 0


MOBILITY = Command(
    "floor of a measured mobility, as poles for a case",
    (
        argument(
            "table",
            metavar="TABLE.csv|TABLE.uff",
            help="frequency, real, imaginary (or magnitude, phase), or a universal file",
        ),
        argument(
            "--quantity",
            choices=("mobility", "accelerance", "receptance"),
            help="what a table holds (default: mobility)",
        ),
        argument("--order", type=int, metavar="N", help="number of poles (default: chosen)"),
        output("the results (default: outputs/<name of the file>)"),
        NO_FIGURES,
        QUIET,
    ),
    fit,
)
