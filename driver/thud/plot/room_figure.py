"""Levels in the room below: positions, mean, background, standardised."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from thud.plot.style import COLOURS, SIZE, band_axis, empty_axes, legend_above, own_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from thud.floors.survey import RoomLevels


@own_style()
def room_levels(found: RoomLevels) -> Figure:
    """Draw levels in a room against their bands."""
    figure, axes = empty_axes(2.6)
    place = np.arange(len(found.frequency))
    if len(found.positions) > 1:
        for i, levels in enumerate(found.positions):
            label = "positions" if i == 0 else None
            axes.plot(place, levels, color="0.65", linewidth=0.6, label=label)
    number = found.rating.rounded
    axes.plot(
        place, found.level, color=COLOURS[0], marker="o", markersize=3.5, linewidth=1.2,
        label=f"in the room: L_iA,Fmax {number} dB",
    )  # fmt: skip
    after, standardised = found.standardised, found.standardised_rating
    if after is not None and standardised is not None:
        axes.plot(
            place, after, color=COLOURS[1], marker="s", markersize=3.5, linewidth=1.2,
            linestyle="--", label=f"standardised: {standardised.rounded} dB",
        )  # fmt: skip
    if found.background is not None:
        axes.plot(
            place, found.background, color=COLOURS[6], linewidth=0.9, linestyle=":",
            label="background",
        )  # fmt: skip
    band_axis(axes, found.frequency, found.bands)
    axes.set_ylabel("Maximum Fast level,\ndB re 20 µPa", fontsize=SIZE)
    legend_above(axes)
    return figure
