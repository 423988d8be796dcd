"""Levels in the room below: measured, predicted, at single positions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from thud.plot.style import (
    COLORS,
    GRAY,
    WIDTH,
    band_axis,
    empty_axes,
    legend_above,
    line_style,
    new_figure,
    own_style,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from thud.floors.modal_room import ModalRoom
    from thud.floors.prediction import RoomPrediction
    from thud.floors.survey import RoomLevels

# Drawn range of a decay below the lowest maximum, dB.
DECAY = 30


@own_style()
def room_levels(room: RoomLevels) -> Figure:
    """Draw levels in a room against their bands."""
    figure, axes = empty_axes(2.6)
    x = np.arange(len(room.frequency))
    if len(room.positions) > 1:
        for i, levels in enumerate(room.positions):
            label = "positions" if i == 0 else None
            axes.plot(x, levels, color="0.65", linewidth=0.6, label=label)
    number = room.rating.rounded
    axes.plot(
        x, room.level, color=COLORS[0], marker="o", markersize=3.5,
        label=f"in the room: L_iA,Fmax {number} dB",
    )  # fmt: skip
    standardized, rating = room.standardized, room.standardized_rating
    if standardized is not None and rating is not None:
        axes.plot(
            x, standardized, color=COLORS[1], marker="s", markersize=3.5,
            linestyle="--", label=f"standardized: {rating.rounded} dB",
        )  # fmt: skip
    if room.background is not None:
        axes.plot(
            x, room.background, color=COLORS[6], linewidth=0.9, linestyle=":",
            label="background",
        )  # fmt: skip
    band_axis(axes, room.frequency, room.bands)
    axes.set_ylabel("Maximum Fast level,\ndB re 20 µPa")
    legend_above(axes)
    return figure


@own_style()
def draw_prediction(prediction: RoomPrediction, measured: RoomLevels | None = None) -> Figure:
    """Draw the components of the level in the room below, and measured levels beside it.

    Hollow markers are bands with few modes, for which the statistical level may be wrong.
    """
    figure = new_figure(4.2, WIDTH)
    above, middle, below = figure.subplots(3, 1, sharex=True, height_ratios=(1, 1, 1.6))
    x = np.arange(len(prediction.frequency))
    few = prediction.has_few_modes
    above.semilogy(x, 1e3 * prediction.energy, color="black", marker=".", linewidth=1)
    above.set_ylabel("Energy into\nthe floor, mJ")
    middle.plot(
        x, prediction.radiation_factor, color=COLORS[2], marker="^", markersize=3, linewidth=1,
        label="radiation factor",
    )  # fmt: skip
    middle.plot(
        x, 10 * prediction.loss_factor, color=COLORS[3], marker="v", markersize=3, linewidth=1,
        linestyle="-.", label="loss factor times 10",
    )  # fmt: skip
    middle.set_ylim(bottom=0)
    middle.set_ylabel("Floor")
    modal = slice(0, prediction.n_modal)
    if prediction.has_edges:
        edges = np.array([prediction.simple_level, prediction.clamped_level])[:, modal]
        below.fill_between(
            x[modal], edges.min(axis=0), edges.max(axis=0), color=GRAY, linewidth=0,
            label="modal, simply supported to clamped",
        )  # fmt: skip
    if prediction.n_modal:
        below.plot(
            x[modal], prediction.modal_level[modal], color=COLORS[1], marker="s", markersize=3.5,
            linewidth=1, linestyle="--",
            label=f"by modes: L_iA,Fmax {prediction.modal_rating.rounded} dB",
        )  # fmt: skip
    below.plot(x, prediction.level, color=COLORS[0])
    for marks, face in ((few, "white"), (~few, COLORS[0])):
        below.plot(
            x[marks], prediction.level[marks], color=COLORS[0], marker="o", markersize=4,
            markerfacecolor=face, linestyle="none",
        )  # fmt: skip
    label = f"statistical: {prediction.rating.rounded} dB"
    below.plot([], [], color=COLORS[0], marker="o", markersize=4, label=label)
    if measured is not None:
        level = prediction.level + prediction.difference(measured)
        label = f"measured: {measured.rating.rounded} dB"
        below.plot(x, level, color="black", marker="x", linewidth=1, linestyle=":", label=label)
    below.set_ylabel("Maximum Fast level,\ndB re 20 µPa")
    band_axis(below, prediction.frequency, "third")
    figure.align_ylabels()
    legend_above(below, middle)
    return figure


@own_style()
def draw_ranges(prediction: RoomPrediction) -> Figure:
    """Draw the levels of both predictions with their ranges."""
    figure, axes = empty_axes(2.5)
    x = np.arange(len(prediction.frequency))
    level, spread = prediction.level, prediction.spread
    axes.fill_between(
        x, level - spread, level + spread, color=GRAY, linewidth=0,
        label="± expected spread of single positions",
    )  # fmt: skip
    axes.plot(
        x, level, color=COLORS[0], marker="o", markersize=3.5,
        label=f"statistical: {prediction.rating.rounded} dB",
    )  # fmt: skip
    modal = slice(0, prediction.n_modal)
    if prediction.has_edges:
        edges = np.array([prediction.simple_level, prediction.clamped_level])[:, modal]
        axes.fill_between(
            x[modal], edges.min(axis=0), edges.max(axis=0), color=COLORS[4], alpha=0.4,
            linewidth=0, label="simply supported to clamped",
        )  # fmt: skip
    if prediction.n_modal:
        axes.plot(
            x[modal], prediction.modal_level[modal], color=COLORS[1], marker="s", markersize=3.5,
            linestyle="--", label=f"by modes: {prediction.modal_rating.rounded} dB",
        )  # fmt: skip
    band_axis(axes, prediction.frequency, "third")
    axes.set_ylabel("Maximum Fast level,\ndB re 20 µPa")
    legend_above(axes)
    return figure


@own_style()
def draw_decay(prediction: RoomPrediction) -> Figure:
    """Draw the reading of the Fast detector against time, in the middle band of each octave."""
    figure, axes = empty_axes(2.6)
    for i, band in enumerate(range(1, len(prediction.frequency), 3)):
        label = f"{prediction.frequency[band]:g} Hz"
        axes.plot(
            1e3 * prediction.history_time, prediction.history[:, band], label=label, **line_style(i)
        )
        axes.plot(
            1e3 * prediction.time_of_maximum[band], prediction.level[band], color=COLORS[i],
            marker="o", linestyle="none",
        )  # fmt: skip
    top = prediction.level[1::3].max()
    axes.set_ylim(prediction.level[1::3].min() - DECAY, top + 3)
    axes.set_xlim(left=0)
    axes.set_xlabel("Time after the impact, ms")
    axes.set_ylabel("Fast level, dB re 20 µPa")
    axes.plot([], [], color="black", marker="o", markersize=4, linestyle="none", label="maximum")
    legend_above(axes)
    return figure


@own_style()
def draw_modal_room(room: ModalRoom) -> Figure:
    """Draw the levels of all pairs of positions, their energy mean, and the statistical level."""
    figure, axes = empty_axes(2.6)
    x = np.arange(len(room.frequency))
    levels = room.level.reshape(-1, len(x))
    low, first, third, high = np.percentile(levels, (5, 25, 75, 95), axis=0)
    axes.vlines(x, low, high, color="0.6", linewidth=1, label="90 % of the positions")
    axes.vlines(x, first, third, color="0.6", linewidth=6, label="50 % of the positions")
    axes.plot(
        x, room.mean, color=COLORS[0], marker="o", markersize=3.5,
        label="energy mean of the positions",
    )  # fmt: skip
    mean, spread = room.statistical
    axes.fill_between(x, mean - spread, mean + spread, color=GRAY, linewidth=0, zorder=0)
    axes.plot(
        x, mean, color=COLORS[1], marker="s", markersize=3.5, linestyle="--",
        label="statistical, ± expected spread",
    )  # fmt: skip
    band_axis(axes, room.frequency, "third")
    axes.set_ylabel("Maximum Fast level,\ndB re 20 µPa")
    legend_above(axes)
    return figure


@own_style()
def draw_positions(prediction: RoomPrediction) -> Figure | None:
    """Draw the levels of positions below a floor; None if no band is modal."""
    # Imported late: modal_room imports the prediction.
    from thud.floors.modal_room import positions_below

    return draw_modal_room(positions_below(prediction)) if prediction.n_modal else None
