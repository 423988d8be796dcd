"""The command that compares floors."""

from __future__ import annotations

import sys
import warnings
from typing import TYPE_CHECKING

from thud.base.errors import InputError, PlausibilityWarning
from thud.base.tables import format_rows
from thud.case.case import read_case
from thud.cli.command import PAGE, QUIET, Command, argument, output, print_notes, results_of

if TYPE_CHECKING:
    import argparse

    from thud.case.case import Case


def compare(options: argparse.Namespace) -> int:
    """Compare the floors of cases, print the table and save the page; return the exit code."""
    from thud.floors.floor_comparison import compare_floors

    results = results_of(options, "floors", options.cases)
    results.require(f"floors{ending}" for ending in PAGE)
    cases: dict[str, Case] = {}
    for path in options.cases:
        case = read_case(path)
        if case.name in cases:
            message = f"{path}: {case.name!r} also names another case; allowed: different names"
            raise InputError(message)
        cases[case.name] = case
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PlausibilityWarning)
        comparison = compare_floors(cases, progress=not options.quiet and sys.stderr.isatty())
    print_notes(comparison.warnings)
    paths = results.write(comparison.files())
    if not options.quiet:
        print(format_rows(comparison.rows()))
        print(f"Page: {paths[-1]}")
    return 0


FLOOR = Command(
    "floors and rooms of several cases on one page",
    (
        argument("cases", nargs="+", metavar="CASE.nml", help="namelist files with floor and room"),
        *output("the page (default: outputs/floors)"),
        QUIET,
    ),
    compare,
    "nothing is written",
)
