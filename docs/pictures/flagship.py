"""The first figure of the documentation: the standard ball by three models."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import thud
from thud.level.assessment import octave_limits
from thud.plot.impact_figures import draw_forces
from thud.plot.style import (
    SMALLEST,
    add_levels,
    legend_above,
    new_figure,
    own_style,
    tolerance_boxes,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INPUTS = Path(__file__).parents[2] / "inputs"
CASES = {
    "shell of the paper": "rubber_ball_100cm",
    "modal ball": "rubber_ball_modal",
    "finite elements": "rubber_ball_fe",
}


@own_style()
def flagship() -> Figure:
    """Draw the assessed forces of `./bootstrap run`, and their levels from the nominal ones."""
    impacts = {
        name: thud.solve(thud.read_case(INPUTS / f"{case}.nml")) for name, case in CASES.items()
    }
    figure = new_figure(2.1)
    history, octaves = figure.subplots(1, 2)
    draw_forces(history, impacts, None)
    history.set_ylabel("Assessed force, kN")
    history.set_xlabel("Time, ms")
    history.set_xticks([0, 10, 20])
    history.locator_params(axis="y", nbins=4)
    lower, upper = octave_limits("rubber_ball")
    nominal = (lower + upper) / 2
    title = "Tolerance, rubber ball"
    tolerance_boxes(octaves, lower - nominal, upper - nominal, title)
    levels = {name: impact.levels() - nominal for name, impact in impacts.items()}
    add_levels(octaves, levels, marker_size=SMALLEST)
    octaves.tick_params(axis="x", labelrotation=90)
    octaves.set_xlabel("Octave, Hz")
    octaves.set_ylabel("Level − nominal, dB")
    legend_above(octaves)
    return figure
