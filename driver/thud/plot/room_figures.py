"""Levels in the room below: measured, predicted, at single positions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from thud.plot.style import (
    COLORS,
    GRAY,
    RATING_SYMBOL,
    band_axis,
    empty_axes,
    legend_above,
    line_style,
    new_figure,
    own_style,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from thud.floors.modal_room import ModalRoom
    from thud.floors.prediction import RoomPrediction
    from thud.floors.survey import RoomLevels

FAST_LEVEL = "Maximum Fast level,\ndB re 20 µPa"
RATING = f"Bands and their A-weighted sum {RATING_SYMBOL}"
# Drawn range of a decay below the lowest maximum, dB.
DECAY = 30


@own_style()
def room_levels(room: RoomLevels) -> Figure:
    """Draw levels in a room against their bands."""
    figure, axes = empty_axes(2.4)
    x = np.arange(len(room.frequency))
    if len(room.positions) > 1:
        for i, levels in enumerate(room.positions):
            label = "positions" if i == 0 else None
            axes.plot(x, levels, color="0.65", linewidth=0.6, label=label)
    number = room.rating.rounded
    axes.plot(
        x, room.level, color=COLORS[0], marker="o", markersize=3.5,
        label=f"in the room: {number} dB",
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
    axes.set_ylabel(FAST_LEVEL)
    legend_above(axes, title=RATING)
    return figure


@own_style()
def draw_prediction(prediction: RoomPrediction, measured: RoomLevels | None = None) -> Figure:
    """Draw the level in the room below, with measured levels if stated, and what it follows from.

    Hollow markers are bands with few modes, for which the statistical level may be wrong.
    """
    figure = new_figure(4.6)
    below, energy, radiation, loss = figure.subplots(4, 1, sharex=True, height_ratios=(2, 1, 1, 1))
    x = np.arange(len(prediction.frequency))
    modal = slice(0, prediction.n_modal)
    if prediction.has_edges:
        edges = np.array([prediction.simple_level, prediction.clamped_level])[:, modal]
        below.fill_between(
            x[modal], edges.min(axis=0), edges.max(axis=0), color="0.8", linewidth=0,
            label="by modes, simply supported to clamped",
        )  # fmt: skip
    if prediction.n_modal:
        below.plot(
            x[modal], prediction.modal_level[modal], color=COLORS[1], marker="s", markersize=3.5,
            linewidth=1, linestyle="--", label=f"by modes: {prediction.modal_rating.rounded} dB",
        )  # fmt: skip
    _draw_statistical(below, x, prediction)
    if measured is not None:
        level = prediction.level + prediction.difference(measured)
        label = f"measured: {measured.rating.rounded} dB"
        below.plot(x, level, color="black", marker="x", linewidth=1, linestyle=":", label=label)
    below.set_ylabel(FAST_LEVEL)
    style = {"color": "black", "linewidth": 1, "marker": ".", "markersize": 4}
    energy.semilogy(x, 1e3 * prediction.energy, **style)
    energy.set_ylabel("Energy into\nfloor, mJ")
    radiation.plot(x, prediction.radiation_factor, **style)
    radiation.set_ylabel("Radiation\nfactor $\\sigma$")
    loss.plot(x, prediction.loss_factor, **style)
    loss.set_ylabel("Loss\nfactor $\\eta$")
    for axes in (radiation, loss):
        axes.set_ylim(bottom=0)
    band_axis(loss, prediction.frequency, "third")
    for axes in (below, energy, radiation):
        axes.tick_params(axis="x", labelbottom=False)
    figure.align_ylabels()
    legend_above(below, title=RATING)
    return figure


def _draw_statistical(axes: Axes, x: NDArray[np.int_], prediction: RoomPrediction) -> None:
    """Draw the statistical levels, with hollow markers at bands with few modes."""
    few = prediction.has_few_modes
    axes.plot(x, prediction.level, color=COLORS[0])
    style: dict[str, Any] = {
        "color": COLORS[0], "marker": "o", "markersize": 4, "linestyle": "none",
    }  # fmt: skip
    name = f"statistical: {prediction.rating.rounded} dB"
    if not few.all():
        axes.plot(x[~few], prediction.level[~few], label=name, **style)
        name = "statistical, few modes"
    if few.any():
        axes.plot(x[few], prediction.level[few], label=name, markerfacecolor="white", **style)


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
    axes.set_ylabel(FAST_LEVEL)
    legend_above(axes, title=RATING)
    return figure


@own_style()
def draw_decay(prediction: RoomPrediction) -> Figure:
    """Draw the reading of the Fast detector against time, in the middle band of each octave."""
    figure, axes = empty_axes(2.6)
    middle = slice(1, None, 3)
    for i, (frequency, history) in enumerate(
        zip(prediction.frequency[middle], prediction.history.T[middle], strict=True)
    ):
        label = f"{frequency:g} Hz"
        axes.plot(1e3 * prediction.history_time, history, label=label, **line_style(i))
    axes.plot(
        1e3 * prediction.time_of_maximum[middle], prediction.level[middle], color="black",
        marker="o", markersize=4, linestyle="none", label="maximum",
    )  # fmt: skip
    top = prediction.level[1::3].max()
    axes.set_ylim(prediction.level[1::3].min() - DECAY, top + 3)
    axes.set_xlim(left=0)
    axes.set_xlabel("Time after the impact, ms")
    axes.set_ylabel("Fast level, dB re 20 µPa")
    legend_above(axes)
    return figure


@own_style()
def draw_modal_room(room: ModalRoom) -> Figure:
    """Draw the levels of all pairs of positions, their energy mean, and the statistical level."""
    figure, axes = empty_axes(2.6)
    x = np.arange(len(room.frequency))
    levels = room.level.reshape(-1, len(x))
    mean, spread = room.statistical
    axes.fill_between(
        x, mean - spread, mean + spread, facecolor="#fbe3d2", edgecolor=COLORS[1], linewidth=0.6,
        linestyle=":", zorder=0, label="± expected spread",
    )  # fmt: skip
    axes.plot(
        x, mean, color=COLORS[1], marker="s", markersize=3.5, linestyle="--", label="statistical",
    )  # fmt: skip
    low, first, third, high = np.percentile(levels, (5, 25, 75, 95), axis=0)
    axes.vlines(x, low, high, color="black", linewidth=0.8, label="90 % of positions")
    axes.bar(
        x, third - first, 0.4, first, facecolor="white", edgecolor="black", linewidth=0.8,
        zorder=2.5, label="50 % of positions",
    )  # fmt: skip
    axes.plot(
        x, room.mean, color=COLORS[0], marker="o", markersize=3.5, zorder=3,
        label="mean of positions",
    )  # fmt: skip
    band_axis(axes, room.frequency, "third")
    axes.set_ylabel(FAST_LEVEL)
    legend_above(axes)
    return figure


@own_style()
def draw_positions(prediction: RoomPrediction) -> Figure | None:
    """Draw the levels of positions below a floor; None if no band is modal."""
    # Imported late: modal_room imports the prediction.
    from thud.floors.modal_room import positions_below

    return draw_modal_room(positions_below(prediction)) if prediction.n_modal else None
