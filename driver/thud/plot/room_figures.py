"""Levels in the room below: measured, predicted, at single positions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from thud.plot.style import (
    COLORS,
    FAST_LEVEL,
    GRAY,
    RATING_SYMBOL,
    add_levels,
    band_axis,
    curve_style,
    escape_label,
    finish,
    legend_above,
    new_figure,
    own_or,
    own_style,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from thud.export.floor_sound import FloorSound
    from thud.export.room_sound import RoomSound
    from thud.floors.modal_room import ModalRoom
    from thud.floors.prediction import RoomPrediction
    from thud.floors.survey import RoomLevels
    from thud.floors.tapping import TappingLevel

RATING = f"Bands and their A-weighted sum {RATING_SYMBOL}"


@own_style()
def room_levels(room: RoomLevels, ax: Axes | None = None) -> Figure:
    """Draw levels in a room against their bands."""
    axes = own_or(ax, 2.4)
    x = np.arange(len(room.frequency))
    for i, levels in enumerate(room.positions if len(room.positions) > 1 else []):
        label = None if i else "positions"
        axes.plot(x, levels, color="0.65", linewidth=0.6, label=label)
    levels = {f"in the room: {room.rating.rounded} dB": room.level}
    if room.standardized is not None and room.standardized_rating is not None:
        levels[f"standardized: {room.standardized_rating.rounded} dB"] = room.standardized
    add_levels(axes, levels, room.bands, room.frequency, 3.5)
    if room.background is not None:
        axes.plot(x, room.background, "k:", linewidth=0.9, label="background")
    axes.set_ylabel(FAST_LEVEL)
    return finish(axes, ax, RATING)


@own_style()
def draw_prediction(prediction: RoomPrediction, measured: RoomLevels | None = None) -> Figure:
    """Draw the level in the room below, measured levels if stated, and what it follows from."""
    figure = new_figure(4.6)
    below, energy, radiation, loss = figure.subplots(4, 1, sharex=True, height_ratios=(2, 1, 1, 1))
    x = np.arange(len(prediction.frequency))
    _draw_below(below, prediction, measured)
    style = {"color": "black", "linewidth": 1, "marker": ".", "markersize": 4}
    energy.semilogy(x, 1e3 * prediction.energy, **style)
    energy.set_ylabel("Energy into\nfloor, mJ")
    radiation.plot(x, prediction.radiation_factor, **style)
    radiation.set_ylabel("Radiation\nfactor $\\sigma$")
    loss.plot(x, prediction.loss_factor, **style)
    loss.set_ylabel("Loss\nfactor $\\eta$")
    for axes in (radiation, loss):
        axes.set_ylim(bottom=0)
    band_axis(loss, "third", prediction.frequency)
    figure.align_ylabels()
    legend_above(below, title=RATING)
    return figure


def _draw_below(axes: Axes, prediction: RoomPrediction, measured: RoomLevels | None) -> None:
    """Draw levels with their standard uncertainty, with other edges, and measured ones."""
    level, uncertainty = prediction.level, prediction.uncertainty
    x = np.arange(len(level))
    axes.fill_between(
        x, level - uncertainty, level + uncertainty, color=GRAY, linewidth=0,
        label="± standard uncertainty",
    )  # fmt: skip
    if prediction.has_edges:
        edges = {"simply supported": (prediction.simple_level, ":"),
                 "clamped": (prediction.clamped_level, "--")}  # fmt: skip
        modal = slice(0, prediction.n_modal)
        for label, (edge, line) in edges.items():
            axes.plot(x[modal], edge[modal], line, color=COLORS[1], linewidth=1, label=label)
    axes.plot(x, level, label=f"{prediction.rating}", **curve_style(0, 3.5))
    if measured is not None:
        label = f"measured: {measured.rating.rounded} dB"
        axes.plot(x, level + prediction.difference(measured), "kx:", linewidth=1, label=label)
    axes.set_ylabel(FAST_LEVEL)


@own_style()
def draw_levels(
    prediction: RoomPrediction, measured: RoomLevels | None = None, ax: Axes | None = None
) -> Figure:
    """Draw the levels in the room below with their standard uncertainty."""
    axes = own_or(ax, 2.5)
    _draw_below(axes, prediction, measured)
    band_axis(axes, "third", prediction.frequency)
    return finish(axes, ax, RATING)


@own_style()
def draw_modal_room(room: ModalRoom, ax: Axes | None = None) -> Figure:
    """Draw the levels of all pairs of positions and their energy mean."""
    axes = own_or(ax, 2.6)
    x = np.arange(len(room.frequency))
    levels = room.level.reshape(-1, len(x))
    low, first, third, high = np.percentile(levels, (5, 25, 75, 95), axis=0)
    axes.vlines(x, low, high, color="black", linewidth=0.8, label="90 % of positions")
    axes.bar(
        x, third - first, 0.4, first, facecolor="white", edgecolor="black", linewidth=0.8,
        zorder=2.5, label="50 % of positions",
    )  # fmt: skip
    axes.plot(x, room.mean, zorder=3, label="mean of positions", **curve_style(0, 3.5))
    band_axis(axes, "third", room.frequency)
    axes.set_ylabel(FAST_LEVEL)
    return finish(axes, ax)


@own_style()
def draw_tapping(tapping: TappingLevel, ax: Axes | None = None) -> Figure:
    """Draw the levels of the tapping machine, and the shifted reference curve."""
    from thud.floors.tapping import AT_500, CURVE, RATED

    axes = own_or(ax, 2.4)
    add_levels(axes, {"level": tapping.level}, "third", tapping.frequency, 3.5)
    shifted = CURVE + tapping.weighted - AT_500
    label = f"reference curve, $L_\\mathrm{{n,w}}$ {tapping.weighted} dB"
    axes.plot(np.arange(len(tapping.frequency))[RATED], shifted, "k:", label=label)
    axes.set_ylabel("Normalized level,\ndB re 20 µPa")
    return finish(axes, ax)


@own_style()
def draw_sound(sound: RoomSound, ax: Axes | None = None) -> Figure:
    """Draw the sound pressure over time, with the floors at the times of their impacts."""
    axes = own_or(ax, 2.0)
    axes.plot(np.arange(len(sound.pressure)) / sound.sample_rate, sound.pressure, linewidth=0.4)
    top = abs(sound.pressure).max()
    for start, floor in zip(sound.starts, sound.sounds, strict=True):
        axes.text(start, 1.1 * top, escape_label(floor.name), fontsize="small")
    axes.set_ylim(-1.05 * top, 1.3 * top)
    axes.set_xlabel("Time, s")
    axes.set_ylabel("Sound pressure, Pa")
    return finish(axes, ax)


@own_style()
def draw_floor_sound(sound: FloorSound, ax: Axes | None = None) -> Figure:
    """Draw the levels of a sound, and those that it should have."""
    axes = own_or(ax, 2.4)
    levels = {"sound": sound.level.third, "prediction": sound.reference.third}
    add_levels(axes, levels, "third", sound.prediction.frequency, 3.5)
    axes.set_ylabel(FAST_LEVEL)
    return finish(axes, ax)


@own_style()
def draw_positions(prediction: RoomPrediction) -> Figure | None:
    """Draw the levels of positions below a floor; None if no band is modal."""
    # Imported late: modal_room imports the prediction.
    from thud.floors.modal_room import modal_room

    return draw_modal_room(modal_room(prediction)) if prediction.n_modal else None
