"""The command that makes a floor of a measured mobility."""

from __future__ import annotations

from typing import TYPE_CHECKING

from thud.base.tables import format_rows
from thud.cli.command import NO_FIGURES, QUIET, Command, argument, output, save_result

if TYPE_CHECKING:
    import argparse


def fit(options: argparse.Namespace) -> int:
    """Fit a measured mobility, print the errors, save the floor; return the exit code."""
    from thud.floors.mobility_fit import fit_mobility

    result = fit_mobility(options.table, quantity=options.quantity, order=options.order)
    shown = f"{repr(result)[1:-1]}\n{format_rows(result.rows())}"
    file = "measured_mobility.nml", result.namelist().encode()
    return save_result(options, options.table, result, shown, file, "mobility_fit")


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
        *output("the results (default: outputs/<name of the file>)"),
        NO_FIGURES,
        QUIET,
    ),
    fit,
)
