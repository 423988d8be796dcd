"""What all sketches share: paper, colors, arrows, springs, dashpots, floors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch, Rectangle

from thud.plot.style import COLORS, WIDTH

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INK = "0.15"
BLUE, RED, GREEN = COLORS[:3]
SOLID = "#d7e6f2"
FLOOR = "0.82"
# Size of the text, pt: indices of formulas have 6 pt.
SIZE = 8.6


def panels(
    *rows: list[tuple[float, float, float, float]], width: float = WIDTH
) -> tuple[Figure, list[Axes]]:
    """Return a figure and its panels in rows, one for each range (left, right, bottom, top).

    Each row is as wide as the figure, with one scale for all of its panels.
    """
    # Inches of a unit, and heights, of each row.
    scales = [width / sum(right - left for left, right, _, _ in row) for row in rows]
    heights = [
        scale * max(top - bottom for _, _, bottom, top in row)
        for scale, row in zip(scales, rows, strict=True)
    ]
    figure = Figure(figsize=(width, sum(heights)), dpi=300)
    found = []
    base = 1.0
    for row, scale, height in zip(rows, scales, heights, strict=True):
        base -= height / sum(heights)
        start = 0.0
        for left, right, bottom, top in row:
            size = scale * (right - left) / width, scale * (top - bottom) / sum(heights)
            axes = figure.add_axes((start, base, *size))
            axes.set(xlim=(left, right), ylim=(bottom, top))
            axes.set_axis_off()
            found.append(axes)
            start += size[0]
    return figure, found


def text(axes: Axes, x: float, y: float, words: str, **how: object) -> None:
    """Write words; they are centred unless told otherwise."""
    how = {"ha": "center", "va": "center", "fontsize": SIZE, "color": INK, "zorder": 5, **how}
    axes.text(x, y, words, **how)


def arrow(
    axes: Axes,
    start: tuple[float, float],
    end: tuple[float, float],
    colour: str = INK,
    **how: object,
) -> None:
    """Draw an arrow."""
    how = {"arrowstyle": "-|>", "mutation_scale": 9, "linewidth": 1.1, "zorder": 4, **how}
    axes.add_patch(
        FancyArrowPatch(start, end, color=colour, shrinkA=0, shrinkB=0, **how)  # type: ignore[arg-type]
    )


def measure(
    axes: Axes, start: tuple[float, float], end: tuple[float, float], words: str, **how: object
) -> None:
    """Draw a length with its name beside the middle."""
    arrow(axes, start, end, arrowstyle="<|-|>", mutation_scale=6, linewidth=0.7)
    place = {"dx": 0.0, "dy": 0.0, **how}
    dx, dy = place.pop("dx"), place.pop("dy")
    middle = ((start[0] + end[0]) / 2 + dx, (start[1] + end[1]) / 2 + dy)
    text(axes, *middle, words, **place)


def floor(axes: Axes, left: float, right: float, top: float = 0.0, depth: float = 0.14) -> None:
    """Draw a floor that holds, as a hatched strip."""
    axes.add_patch(
        Rectangle(
            (left, top - depth), right - left, depth, facecolor="none", hatch="//////",
            edgecolor="0.6", linewidth=0,
        )
    )  # fmt: skip
    axes.plot([left, right], [top, top], color=INK, linewidth=1.2, zorder=3)


def block(
    axes: Axes, corner: tuple[float, float], size: tuple[float, float], words: str = ""
) -> None:
    """Draw a mass or a plate, by its lower left corner, with its name."""
    axes.add_patch(Rectangle(corner, *size, facecolor=SOLID, edgecolor=INK, zorder=3))
    text(axes, corner[0] + size[0] / 2, corner[1] + size[1] / 2, words)


def spring(axes: Axes, x: float, bottom: float, top: float, width: float = 0.12) -> None:
    """Draw an upright spring."""
    y = np.linspace(bottom, top, 12)
    zigzag = np.array([0, 0, 1, -1, 1, -1, 1, -1, 1, -1, 0, 0]) * width
    axes.plot(x + zigzag, y, color=INK, linewidth=1.1, solid_joinstyle="round")


def dashpot(axes: Axes, x: float, bottom: float, top: float, width: float = 0.1) -> None:
    """Draw an upright dashpot."""
    low, high = bottom + 0.35 * (top - bottom), bottom + 0.7 * (top - bottom)
    piston = (low + high) / 2
    axes.plot([x, x], [bottom, low], color=INK, linewidth=1.1)
    axes.plot(
        [x - width, x - width, x + width, x + width],
        [high, low, low, high],
        color=INK,
        linewidth=1.1,
    )
    axes.plot([x - 0.75 * width, x + 0.75 * width], [piston, piston], color=INK, linewidth=1.6)
    axes.plot([x, x], [piston, top], color=INK, linewidth=1.1)


def box(
    axes: Axes, place: tuple[float, float], size: tuple[float, float], words: str, colour: str
) -> None:
    """Draw a rounded box, by its middle, with words in it."""
    corner = (place[0] - size[0] / 2, place[1] - size[1] / 2)
    axes.add_patch(
        FancyBboxPatch(
            corner, *size, facecolor=colour, edgecolor=INK, linewidth=0.8,
            boxstyle="round,pad=0,rounding_size=0.08",
        )
    )  # fmt: skip
    text(axes, *place, words, linespacing=1.15)
