"""The command that rates levels measured in the room below."""

from __future__ import annotations

from typing import TYPE_CHECKING

from thud.base.tables import format_rows
from thud.cli.command import NO_FIGURES, QUIET, Command, argument, output, save_result

if TYPE_CHECKING:
    import argparse


def rate(options: argparse.Namespace) -> int:
    """Rate measured levels, print and save the result; return the exit code."""
    from thud.floors.survey import levels_csv, rating_table, read_room_levels

    room = read_room_levels(options.levels, volume=options.volume)
    shown = f"{format_rows(room.rows())}\n\n{format_rows(rating_table(room))}"
    if (scatter := room.position_uncertainty) is not None:
        shown += f"\n\n  Standard uncertainty by the scatter of positions: {scatter:.1f} dB"
    file = "room_levels.csv", levels_csv(room)
    return save_result(options, options.levels, room, shown, file, "room_levels")


RATE = Command(
    "rating of levels measured in the room below",
    (
        argument(
            "levels",
            metavar="LEVELS.csv",
            help="frequency, levels of positions, and where known background, reverberation_time",
        ),
        argument("--volume", type=float, metavar="M3", help="volume of the room"),
        *output("the results (default: outputs/<name of the file>)"),
        NO_FIGURES,
        QUIET,
    ),
    rate,
)
