"""Drop on a floor that moves: contact against blocked force, levels, energy and mobility."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.ticker import NullLocator

from thud.level.levels import BANDWIDTHS, get_bands, record_force
from thud.plot.documentation_impacts import solve_chipboard
from thud.plot.force_history_figure import TIME_LABEL
from thud.plot.style import (
    COLOURS,
    SIZE,
    band_axis,
    legend_above,
    line_style,
    new_figure,
    own_style,
    style_axes,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from thud.impact.floor_impact import FloorImpact
    from thud.impact.impact import Impact

THIRDS = BANDWIDTHS[1]
# Contact times that are drawn.
_SHOWN = 1.5
# Frequencies per octave of the mobility: peaks of lightly damped floors are narrow.
_DENSITY = 400


@own_style()
def draw_floor(impact: FloorImpact) -> Figure:
    """Draw force and floor velocity, the change of the levels, the energy, and the mobility."""
    figure = new_figure(6.4)
    history, motion, change, energy, mobility = figure.subplots(5, 1)
    _draw_histories(style_axes(history), style_axes(motion), impact)
    place = np.arange(len(get_bands(THIRDS).nominal))
    style_axes(change).bar(place, impact.difference(THIRDS), color=COLOURS[0], width=0.7)
    change.axhline(0, color="black", linewidth=0.6)
    change.set_ylabel("Contact less\nblocked, dB", fontsize=SIZE)
    found = impact.injected_energy(THIRDS)
    style_axes(energy).set_yscale("log")
    energy.plot(place, 1e3 * found.by_mobility, label="energy by the mobility", **line_style(0))
    energy.plot(
        place, 1e3 * found.by_motion, label="energy by the velocity", color=COLOURS[1], marker="o",
        markersize=3.5, linestyle="none",
    )  # fmt: skip
    energy.set_ylabel("Energy into\nthe floor, mJ", fontsize=SIZE)
    energy.sharex(change)
    change.tick_params(labelbottom=False)
    band_axis(energy, found.frequency, THIRDS)
    _draw_mobility(style_axes(mobility), impact)
    # One legend for all.
    for axes in (motion, energy, mobility):
        for line in axes.get_lines():
            if not str(line.get_label()).startswith("_"):
                history.plot([], [], label=line.get_label(), **_style(line))
    figure.align_ylabels()
    legend_above(history)
    return figure


def _style(line: object) -> dict[str, object]:
    names = ("color", "linestyle", "linewidth", "marker", "markersize")
    return {name: getattr(line, f"get_{name}")() for name in names}


def _draw_histories(history: Axes, motion: Axes, impact: FloorImpact) -> None:
    time = 1e3 * (impact.time - impact.touch_time)
    shown = (time >= 0) & (time <= 1e3 * _SHOWN * impact.contact_time)
    forces = {"blocked force": impact.blocked_force, "contact force": impact.floor_force}
    for i, (name, force) in enumerate(forces.items()):
        recorded = 1e-3 * record_force(force, impact.sample_rate)
        history.plot(time[shown], recorded[shown], label=name, **line_style(i))
    history.set_ylabel("Force on the floor\nbelow 1.25 kHz, kN", fontsize=SIZE)
    motion.plot(time[shown], 1e3 * impact.floor_velocity[shown], color=COLOURS[2], linewidth=1)
    motion.set_ylabel("Velocity of\nthe floor, mm/s", fontsize=SIZE)
    motion.set_xlabel(TIME_LABEL, fontsize=SIZE)
    motion.sharex(history)
    history.tick_params(labelbottom=False)
    history.margins(x=0)


def _draw_mobility(axes: Axes, impact: FloorImpact) -> None:
    bands = get_bands(THIRDS)
    low, high = bands.lower[0], bands.upper[-1]
    frequency = np.geomspace(low, high, int(_DENSITY * np.log2(high / low)))
    found = impact.mobility(frequency)
    axes.loglog(frequency, abs(found), label="|Y|", color="0.6", linewidth=0.8)
    axes.loglog(frequency, found.real, label="Re Y", color=COLOURS[3], linewidth=0.8)
    axes.set_ylabel("Mobility Y,\nm/(N s)", fontsize=SIZE)
    axes.set_xlabel("Frequency, Hz", fontsize=SIZE)
    axes.set_xlim(low, high)
    octaves = get_bands(BANDWIDTHS[0]).nominal
    axes.set_xticks(octaves, [f"{octave:g}" for octave in octaves])
    axes.xaxis.set_minor_locator(NullLocator())


def _draw_on_floor(impact: Impact) -> Figure | None:
    """Draw the drop on the floor of a case that has one."""
    return draw_floor(impact.on_floor) if impact.on_floor else None


IMPACT_FIGURES = {"floor": _draw_on_floor}
DOCUMENTATION_FIGURES = {"floor_chipboard": lambda: _draw_on_floor(solve_chipboard())}
