"""Impedances of sources and floors, and the resistances below which floors change the force."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.ticker import FixedLocator, NullLocator

from thud.base._schema import FloatingFloor, JoistFloor, Plate
from thud.floors.impedance import ball_impedance
from thud.impact.mobility import mobility
from thud.impact.solve import solve
from thud.plot.documentation_impacts import solve_published
from thud.plot.style import (
    COLOURS,
    LINES,
    SIZE,
    empty_axes,
    legend_above,
    marker_style,
    own_style,
    styled,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure

    from thud.base._schema import FloorOptions
    from thud.floors.impedance import BallImpedance

# Frequencies of the impedances of the floors, Hz.
_FREQUENCIES = np.geomspace(22.0, 720.0, 1000)


@own_style()
def ball_impedances(
    sources: Mapping[str, BallImpedance], floors: Mapping[str, FloorOptions]
) -> Figure:
    """Draw the impedances of sources, filled markers, and of floors, lines.

    Floors below the open markers change the level of the force by more than 1 dB.
    """
    figure, axes = empty_axes(3.0)
    for i, (name, floor) in enumerate(floors.items()):
        axes.loglog(
            _FREQUENCIES, 1 / np.abs(mobility(floor, _FREQUENCIES)), label=name, linewidth=0.8,
            color=COLOURS[i % len(COLOURS)], linestyle=styled(i, LINES),
        )  # fmt: skip
    frequency = np.array([])
    for i, (name, source) in enumerate(sources.items()):
        frequency = source.frequency
        # Side by side where sources agree.
        place = frequency * 1.05 ** (i - (len(sources) - 1) / 2)
        style = {"color": "black", "linestyle": "none", **marker_style(i)}
        words = f", {name}" if name else ""
        axes.loglog(place, np.abs(source.impedance), label=f"source{words}", **style)
        axes.loglog(place, source.limit(), fillstyle="none", label=f"limit of 1 dB{words}", **style)
    axes.xaxis.set_major_locator(FixedLocator(frequency.tolist()))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set_xticklabels([f"{f:g}" for f in frequency])
    axes.set_xlabel("Frequency, Hz", fontsize=SIZE)
    axes.set_ylabel("Impedance, N s/m", fontsize=SIZE)
    legend_above(axes)
    return figure


def _draw_models() -> Figure:
    """Draw three models of the ball, and floors from chipboard to concrete."""
    resistance = [560.0, 1e3, 2e3, 5e3, 1e5]
    sources = {
        "shell": ball_impedance(solve(), resistance),
        "modes": ball_impedance(solve(model="modal_ball"), resistance),
        "elements": ball_impedance(solve_published(), resistance[1:]),
    }
    floors: dict[str, FloorOptions] = {
        "chipboard on joists": JoistFloor(),
        "floating screed": FloatingFloor(),
        "180 mm concrete": Plate(),
    }
    return ball_impedances(sources, floors)


DOCUMENTATION_FIGURES = {"ball_impedance": _draw_models}
