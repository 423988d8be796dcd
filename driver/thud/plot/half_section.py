"""The half section of the ball in colours."""

from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation
from numpy.typing import NDArray

from thud.base.errors import InputError
from thud.plot.style import SIZE

# Of monotonic lightness, for any colour vision and for print.
COLOUR_MAP = "cividis"
# More are not readable at column width.
MAX_PANELS = 30


def require_panels(name: str, value: object) -> None:
    """Raise InputError where a number of panels is not allowed."""
    if not isinstance(value, int) or not 1 <= value <= MAX_PANELS:
        message = f"{name} = {value!r} is not allowed; allowed: 1 to {MAX_PANELS}"
        raise InputError(message)


def draw_section(
    axes: Axes, place: NDArray[np.float64], value: NDArray[np.float64], scale: Normalize
) -> None:
    """Draw a half section in colours, with the mesh lines of its surfaces and poles."""
    lines, rings = value.shape
    number = np.arange(lines * rings).reshape(lines, rings)
    corners = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
    a, b, c, d = (corner.ravel() for corner in corners)
    triangles = np.concatenate([np.stack((a, b, c), 1), np.stack((a, c, d), 1)])
    r, z = place.reshape(-1, 2).T
    mesh = Triangulation(r, z, triangles)
    axes.tripcolor(
        mesh, value.ravel(), shading="gouraud", cmap=COLOUR_MAP, norm=scale, rasterized=True
    )
    edge = np.concatenate([place[:, 0], place[::-1, -1], place[:1, 0]])
    axes.plot(*edge.T, color="0.1", linewidth=0.6)


def add_colour_bar(figure: Figure, panels: Any, scale: Normalize, label: str) -> None:  # noqa: ANN401 - axes or an array of them
    """Add the colour bar below the panels."""
    colours = mpl.cm.ScalarMappable(scale, COLOUR_MAP)
    bar = figure.colorbar(colours, ax=panels, location="bottom", shrink=0.7, aspect=30, pad=0.02)
    bar.set_label(label, fontsize=SIZE)
    bar.ax.tick_params(labelsize=SIZE)
