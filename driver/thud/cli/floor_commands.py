"""Commands on floors and rooms: compare floors, rate levels, fit a mobility."""

from __future__ import annotations

import sys
import warnings
from typing import TYPE_CHECKING

from thud.base.errors import InputError, PlausibilityWarning
from thud.base.tables import format_rows
from thud.case.case import read_case
from thud.cli.command import (
    NO_FIGURES,
    PAGE,
    QUIET,
    Command,
    argument,
    output,
    print_notes,
    results_of,
    save_result,
)

if TYPE_CHECKING:
    import argparse

    from thud.case.case import Case


def compare_floor_cases(options: argparse.Namespace) -> int:
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
    "compare floors and rooms of several cases on one page",
    (
        argument("cases", nargs="+", metavar="CASE.nml", help="namelist files with floor and room"),
        *output("the page (default: outputs/floors)"),
        QUIET,
    ),
    compare_floor_cases,
    "nothing is written",
)


def rate(options: argparse.Namespace) -> int:
    """Rate measured levels, print and save the result; return the exit code."""
    from thud.floors.survey import levels_csv, rating_table, read_room_levels

    room = read_room_levels(options.levels, volume=options.volume)
    shown = f"{format_rows(room.rows())}\n\n{format_rows(rating_table(room))}"
    if (scatter := room.position_uncertainty) is not None:
        shown += f"\n\n  Standard uncertainty from the scatter of the positions: {scatter:.1f} dB"
    file = "room_levels.csv", levels_csv(room)
    return save_result(options, options.levels, room, shown, file, "room_levels")


RATE = Command(
    "rating of levels measured in the room below",
    (
        argument(
            "levels",
            metavar="LEVELS.csv|LEVELS.xlsx",
            help="frequency, levels at positions; optional: background, reverberation_time",
        ),
        argument("--volume", type=float, metavar="M3", help="volume of the room"),
        *output("the results (default: outputs/<name of the file>)"),
        NO_FIGURES,
        QUIET,
    ),
    rate,
)


def fit_mobility_table(options: argparse.Namespace) -> int:
    """Fit a measured mobility, print the errors, save the floor; return the exit code."""
    from thud.floors.mobility_fit import fit_mobility

    result = fit_mobility(options.table, quantity=options.quantity, order=options.order)
    shown = f"{repr(result)[1:-1]}\n{format_rows(result.rows())}"
    file = "measured_mobility.nml", result.namelist().encode()
    return save_result(options, options.table, result, shown, file, "mobility_fit")


MOBILITY = Command(
    "fit poles to a measured mobility and save it as a floor for cases",
    (
        argument(
            "table",
            metavar="TABLE.csv|TABLE.uff",
            help="columns frequency, real, imaginary (or magnitude, phase), or a universal file",
        ),
        argument(
            "--quantity",
            choices=("mobility", "accelerance", "receptance"),
            help="quantity of the table (default: mobility)",
        ),
        argument("--order", type=int, metavar="N", help="number of poles (default: automatic)"),
        *output("the results (default: outputs/<name of the file>)"),
        NO_FIGURES,
        QUIET,
    ),
    fit_mobility_table,
)
