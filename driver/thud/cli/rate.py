"""The command that rates levels measured in the room below."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from thud.cli.command import NO_FIGURES, QUIET, Command, argument, output
from thud.files import replace_file
from thud.tables import format_rows

if TYPE_CHECKING:
    import argparse


def rate(options: argparse.Namespace) -> int:
    """Rate measured levels, print and save the result; return the exit code."""
    from thud.floors.survey import levels_csv, rating_table, read_room_levels  # noqa: PLC0415

    found = read_room_levels(options.levels, volume=options.volume)
    folder = Path(options.output or Path("outputs", found.name))
    figures = {}
    if not options.no_figures:
        from thud.plot.room import room_levels  # noqa: PLC0415 - Matplotlib takes its time

        figures = {"room_levels": room_levels(found)}
    folder.mkdir(parents=True, exist_ok=True)
    replace_file(folder / "room_levels.csv", levels_csv(found))
    if figures:
        from thud.plot.look import save_all  # noqa: PLC0415

        save_all(figures, folder)
    if not options.quiet:
        print(format_rows(found.rows()))
        print()
        print(format_rows(rating_table(found)))
        if (scatter := found.position_uncertainty) is not None:
            print(f"\n  Standard uncertainty by the scatter of positions: {scatter:.1f} dB")
    for remark in found.remarks:
        print(f"thud-driver: {remark}", file=sys.stderr)
    if not options.quiet:
        print(f"Results: {folder}")
    return 0


RATE = Command(
    "rating of levels measured in the room below",
    (
        argument(
            "levels",
            metavar="LEVELS.csv",
            help="frequency, levels of positions, and where known background, reverberation_time",
        ),
        argument("--volume", type=float, metavar="M3", help="volume of the room"),
        output("the results (default: outputs/<name of the file>)"),
        NO_FIGURES,
        QUIET,
    ),
    rate,
)
