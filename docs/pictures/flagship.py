"""The first figure of the documentation: the ball of the paper, and by finite elements."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import thud
from thud.plot.impact_figures import draw_forces, draw_levels
from thud.plot.style import LEVEL, legend_above, new_figure, own_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INPUTS = Path(__file__).parents[2] / "inputs"
CASES = {
    "shell of the paper": "rubber_ball_100cm",
    "elements, order 0.3": "rubber_ball_fe",
    "elements, Kelvin–Voigt": "rubber_ball_fe_viscous",
}


@own_style()
def flagship() -> Figure:
    """Draw force on the floor and octaves of the three cases of `./bootstrap run`."""
    impacts = {
        name: thud.solve(thud.read_case(INPUTS / f"{case}.nml")) for name, case in CASES.items()
    }
    figure = new_figure(2.1)
    history, octaves = figure.subplots(1, 2)
    draw_forces(history, impacts, "floor")
    history.set_ylabel("Force on the floor, kN")
    history.set_xlabel("Time, ms")
    history.set_xticks([0, 10, 20])
    history.locator_params(axis="y", nbins=4)
    draw_levels({"octave": octaves}, impacts, "floor", "rubber_ball")
    octaves.tick_params(axis="x", labelrotation=90)
    octaves.set_xlabel("Octave, Hz")
    octaves.set_ylabel(LEVEL.replace("Force exposure l", "L"))
    legend_above(octaves)
    return figure
