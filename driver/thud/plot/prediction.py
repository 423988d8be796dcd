"""The chain of a prediction: energy in the floor, radiation and losses, level in the room."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from thud.floors.prediction import RoomPrediction, predict_level
from thud.plot.look import COLOURS, SIZE, WIDTH, band_axis, dress, legend_above, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    from thud.floors.survey import RoomLevels
    from thud.impact import Impact


def draw_prediction(found: RoomPrediction, measured: RoomLevels | None = None) -> Figure:
    """Draw what a level in the room below is made of, in thirds, and measured levels beside it.

    Hollow marks are thirds of few modes, where the statistical answer is doubtful.
    """
    figure = new_figure(4.2, WIDTH)
    above, middle, below = figure.subplots(3, 1, sharex=True, height_ratios=(1, 1, 1.6))
    place = np.arange(len(found.frequency))
    few = found.has_few_modes
    dress(above).semilogy(place, 1e3 * found.energy, color="black", marker=".", linewidth=1)
    above.set_ylabel("Energy into\nthe floor, mJ", fontsize=SIZE)
    dress(middle).plot(
        place, found.radiation_factor, color=COLOURS[2], marker="^", markersize=3, linewidth=1,
        label="radiation factor",
    )  # fmt: skip
    middle.plot(
        place, 10 * found.loss_factor, color=COLOURS[3], marker="v", markersize=3, linewidth=1,
        linestyle="-.", label="ten times the loss factor",
    )  # fmt: skip
    middle.set_ylim(bottom=0)
    middle.set_ylabel("Floor", fontsize=SIZE)
    dress(below)
    below.plot(place, found.level, color=COLOURS[0], linewidth=1.2)
    for marks, face in ((few, "white"), (~few, COLOURS[0])):
        below.plot(
            place[marks], found.level[marks], color=COLOURS[0], marker="o", markersize=4,
            markerfacecolor=face, linestyle="none",
        )  # fmt: skip
    label = f"in the room: L_iA,Fmax {found.rating.rounded} dB"
    below.plot([], [], color=COLOURS[0], marker="o", markersize=4, linewidth=1.2, label=label)
    below.plot(
        place, found.standardised, color=COLOURS[1], marker="s", markersize=3, linewidth=1,
        linestyle="--", label=f"standardised: {found.standardised_rating.rounded} dB",
    )  # fmt: skip
    if measured is not None:
        level = found.level + found.difference(measured)
        label = f"measured: {measured.rating.rounded} dB"
        below.plot(place, level, color="black", marker="x", linewidth=1, linestyle=":", label=label)
    below.set_ylabel("Maximum Fast level,\ndB re 20 µPa", fontsize=SIZE)
    band_axis(below, found.frequency, "third")
    figure.align_ylabels()
    # One legend for all.
    for line in middle.get_lines():
        below.plot([], [], label=line.get_label(), **_style(line))
    legend_above(below)
    return figure


def _style(line: Line2D) -> dict[str, Any]:
    return {
        "color": line.get_color(), "marker": line.get_marker(), "linestyle": line.get_linestyle(),
        "markersize": line.get_markersize(), "linewidth": line.get_linewidth(),
    }  # fmt: skip


def _draw_room(impact: Impact) -> Figure | None:
    """Draw the prediction of a case that has a room."""
    return draw_prediction(predict_level(impact)) if impact.case.room else None


IMPACT_FIGURES = {"room": _draw_room}
