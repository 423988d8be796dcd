"""Levels of single positions in a modal room against the statistical answer."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from thud.base._schema import Plate
from thud.floors.modal_room import ModalRoom, ModeCountError, positions_below
from thud.plot.style import COLOURS, GREY, SIZE, band_axis, empty_axes, legend_above, own_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from thud.floors.prediction import RoomPrediction


@own_style()
def draw_modal_room(found: ModalRoom) -> Figure:
    """Draw the levels of all pairs of positions, their energy mean, and the statistical level."""
    figure, axes = empty_axes(2.6)
    place = np.arange(len(found.frequency))
    levels = found.level.reshape(-1, len(place))
    low, first, third, high = np.percentile(levels, (5, 25, 75, 95), axis=0)
    axes.vlines(place, low, high, color="0.6", linewidth=1, label="90 % of the positions")
    axes.vlines(place, first, third, color="0.6", linewidth=6, label="half of them")
    axes.plot(
        place, found.mean, color=COLOURS[0], marker="o", markersize=3.5, linewidth=1.2,
        label="energy mean of the positions",
    )  # fmt: skip
    mean, spread = found.statistical
    axes.fill_between(place, mean - spread, mean + spread, color=GREY, linewidth=0, zorder=0)
    axes.plot(
        place, mean, color=COLOURS[1], marker="s", markersize=3.5, linewidth=1.2, linestyle="--",
        label="statistical, ± expected spread",
    )  # fmt: skip
    band_axis(axes, found.frequency, "third")
    axes.set_ylabel("Maximum Fast level,\ndB re 20 µPa", fontsize=SIZE)
    legend_above(axes)
    return figure


def _draw_positions(found: RoomPrediction) -> Figure | None:
    """Draw the levels of positions below a plate."""
    if not isinstance(found.floor, Plate):
        return None
    try:
        return draw_modal_room(positions_below(found, balls=8, microphones=16))
    except ModeCountError:  # the statistical answer stands alone
        return None


ROOM_FIGURES = {"room_positions": _draw_positions}
