"""The chain of a prediction: energy in the floor, radiation and losses, level in the room."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from thud.plot.style import (
    COLOURS,
    GREY,
    SIZE,
    WIDTH,
    band_axis,
    empty_axes,
    legend_above,
    line_style,
    new_figure,
    own_style,
    style_axes,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    from thud.floors.prediction import RoomPrediction
    from thud.floors.survey import RoomLevels


# How far below the lowest maximum a decay is drawn, dB.
DECAY = 30


@own_style()
def draw_prediction(found: RoomPrediction, measured: RoomLevels | None = None) -> Figure:
    """Draw what a level in the room below is made of, in thirds, and measured levels beside it.

    Hollow marks are thirds of few modes, where the statistical answer is doubtful.
    """
    figure = new_figure(4.2, WIDTH)
    above, middle, below = figure.subplots(3, 1, sharex=True, height_ratios=(1, 1, 1.6))
    place = np.arange(len(found.frequency))
    few = found.has_few_modes
    style_axes(above).semilogy(place, 1e3 * found.energy, color="black", marker=".", linewidth=1)
    above.set_ylabel("Energy into\nthe floor, mJ", fontsize=SIZE)
    style_axes(middle).plot(
        place, found.radiation_factor, color=COLOURS[2], marker="^", markersize=3, linewidth=1,
        label="radiation factor",
    )  # fmt: skip
    middle.plot(
        place, 10 * found.loss_factor, color=COLOURS[3], marker="v", markersize=3, linewidth=1,
        linestyle="-.", label="ten times the loss factor",
    )  # fmt: skip
    middle.set_ylim(bottom=0)
    middle.set_ylabel("Floor", fontsize=SIZE)
    style_axes(below)
    low, high = found.level - found.spread, found.level + found.spread
    below.fill_between(place, low, high, color=GREY, linewidth=0, label="± expected spread")
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


@own_style()
def draw_decay(found: RoomPrediction) -> Figure:
    """Draw what the Fast detector shows against time, in a third of each octave."""
    figure, axes = empty_axes(2.6)
    for i, band in enumerate(range(1, len(found.frequency), 3)):
        label = f"{found.frequency[band]:g} Hz"
        axes.plot(1e3 * found.history_time, found.history[:, band], label=label, **line_style(i))
        axes.plot(
            1e3 * found.time_of_maximum[band], found.level[band], color=COLOURS[i], marker="o",
            markersize=4, linestyle="none",
        )  # fmt: skip
    top = found.level[1::3].max()
    axes.set_ylim(found.level[1::3].min() - DECAY, top + 3)
    axes.set_xlim(left=0)
    axes.set_xlabel("Time after the impact, ms", fontsize=SIZE)
    axes.set_ylabel("Fast level, dB re 20 µPa", fontsize=SIZE)
    axes.plot([], [], color="black", marker="o", markersize=4, linestyle="none", label="maximum")
    legend_above(axes)
    return figure


def _style(line: Line2D) -> dict[str, Any]:
    return {
        "color": line.get_color(), "marker": line.get_marker(), "linestyle": line.get_linestyle(),
        "markersize": line.get_markersize(), "linewidth": line.get_linewidth(),
    }  # fmt: skip


ROOM_FIGURES = {"room": draw_prediction, "room_decay": draw_decay}
