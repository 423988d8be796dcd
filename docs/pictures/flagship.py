"""The first figure of the documentation: the ball of the paper, and by finite elements."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import thud
from thud.plot.impact_figures import draw_forces, draw_levels
from thud.plot.style import LEVEL, WIDTH, legend_above, new_figure, own_style

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
    """Draw forces and octaves of the three cases of `./bootstrap run`."""
    impacts = {
        name: thud.solve(thud.read_case(INPUTS / f"{case}.nml")) for name, case in CASES.items()
    }
    figure = new_figure(2.4, 2 * WIDTH)
    history, octaves = figure.subplots(1, 2)
    draw_forces(history, impacts, None)
    draw_levels({"octave": octaves}, impacts, None, "rubber_ball")
    octaves.set_ylabel(LEVEL)
    legend_above(octaves)
    return figure
