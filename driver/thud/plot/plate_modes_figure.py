"""Mode shapes of a simply supported plate."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from thud.base._schema import Plate
from thud.base.checks import require_kind, require_whole
from thud.floors.modal_room import plate_frequencies
from thud.plot.style import SIZE, WIDTH, new_figure, own_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from thud.impact.impact import Impact

# Maximum number of shapes, points along a side, and levels of a contour.
MAX_SHAPES, POINTS = 30, 60


@own_style()
def plate_modes(floor: Plate, count: int = 6, columns: int = 3) -> Figure:
    """Draw the lowest mode shapes of a simply supported plate.

    Parameters
    ----------
    floor
        The plate.
    count
        Number of shapes.
    columns
        Shapes side by side.
    """
    require_kind("floor", floor, Plate)
    require_whole("count", count, 1, MAX_SHAPES)
    require_whole("columns", columns, 1, MAX_SHAPES)
    numbers = np.array([(m, n) for m in range(1, count + 1) for n in range(1, count + 1)])
    frequency = plate_frequencies(floor, numbers)
    lowest = np.argsort(frequency, kind="stable")[:count]
    columns = min(columns, count)
    rows = -(-count // columns)
    side = WIDTH / columns
    ratio = floor.width / floor.length
    figure = new_figure(0.5 + rows * (side * ratio + 0.25), WIDTH)
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    x, y = np.linspace(0, floor.length, POINTS), np.linspace(0, floor.width, POINTS)
    for axes in panels:
        axes.set_axis_off()
    for axes, mode in zip(panels, lowest, strict=False):
        m, n = numbers[mode]
        shape = np.outer(np.sin(n * np.pi * y / floor.width), np.sin(m * np.pi * x / floor.length))
        drawn = axes.pcolormesh(x, y, shape, cmap="RdBu_r", vmin=-1, vmax=1, rasterized=True)
        axes.set_aspect("equal")
        axes.set_title(f"{frequency[mode]:.1f} Hz ({m}, {n})", fontsize=SIZE - 1, pad=2)
    bar = figure.colorbar(drawn, ax=panels.tolist(), location="bottom", shrink=0.7, aspect=30)
    bar.set_label("Displacement relative to its maximum", fontsize=SIZE)
    bar.ax.tick_params(labelsize=SIZE)
    return figure


def _draw_floor(impact: Impact) -> Figure | None:
    """Draw the modes of a plate of a case."""
    floor = impact.case.floor
    return plate_modes(floor) if isinstance(floor, Plate) else None


IMPACT_FIGURES = {"floor_modes": _draw_floor}
