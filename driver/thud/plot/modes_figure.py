"""Mode shapes of the free ball (paper, figure 4)."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from thud.base._schema import Ball
from thud.base.checks import require_kind
from thud.impact.free_modes import FreeModes, free_modes
from thud.plot.half_section import add_colour_bar, draw_section, require_panels
from thud.plot.style import SIZE, WIDTH, new_figure, own_style

# Drawn maximum displacement of a mode, as fraction of the radius.
AMPLITUDE = 0.3


@own_style()
def mode_shapes(modes: FreeModes, columns: int = 3) -> Figure:
    """Draw mode shapes as half sections over the outline of the ball at rest (paper, figure 4).

    Parameters
    ----------
    modes
        The modes.
    columns
        Shapes side by side.

    Returns
    -------
    Figure
        One half section for each mode; the colour is the displacement over its maximum.
    """
    require_kind("modes", modes, FreeModes)
    require_panels("columns", columns)
    rows = -(-len(modes.frequency) // columns)
    # More than three side by side need more than a column.
    figure = new_figure(0.45 + 1.75 * rows, WIDTH * max(1, columns / 3))
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    radius = modes.ball.outer_radius
    scale = Normalize(0, 1)
    for axes, frequency, harmonic, shape in zip(
        panels, modes.frequency, modes.harmonic, modes.shape, strict=False
    ):
        draw_section(axes, modes.start + AMPLITUDE * radius * shape, np.hypot(*shape.T).T, scale)
        _draw_outline(axes, modes.start)
        axes.set_title(f"{frequency:.1f} Hz, n = {harmonic}", fontsize=SIZE, pad=2)
        axes.set_xlim(-0.05 * radius, 1.35 * radius)
        axes.set_ylim(-1.35 * radius, 1.35 * radius)
    for axes in panels:
        axes.set_axis_off()
        axes.set_aspect("equal")
    add_colour_bar(figure, panels, scale, "Displacement relative to its maximum")
    return figure


def _draw_outline(axes: Axes, place: NDArray[np.float64]) -> None:
    """Draw the outline of the ball at rest."""
    surfaces = LineCollection(
        [place[:, 0], place[:, -1]], colors="0.35", linestyles="--", linewidths=0.6
    )
    axes.add_collection(surfaces)


MODES_FIGURES = {"modes": mode_shapes}
DOCUMENTATION_FIGURES = {"figure4_free_modes": lambda: mode_shapes(free_modes(Ball.standard()))}
