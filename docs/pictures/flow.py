"""How data flow through thud."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sketch import BLUE, arrow, box, panels, text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Column, row and words of each box, and what makes it.
BOXES = {
    "case": (0, 2, "case\n(namelist)", "given"),
    "floor": (0, 0, "floor, room", "given"),
    "recording": (0, 1, "recording of a\nforce plate", "given"),
    "model": (1, 2, "source model", "computed"),
    "history": (2, 2, "force history", "computed"),
    "levels": (3, 2, "levels in\nbands", "computed"),
    "verdict": (4, 2, "verdict by\nthe standards", "answer"),
    "moved": (2, 0, "contact force on\nthe floor", "computed"),
    "room": (3, 0, "level in the\nroom below", "computed"),
    "rating": (4, 0, "rating", "answer"),
}
COLOURS = {"given": "#fdf0d5", "computed": "#d7e6f2", "answer": "#d5ece1"}
STEP, RISE, SIZE = 1.62, 0.72, (1.28, 0.48)
ARROWS = (
    *(("case", "model"), ("model", "history"), ("history", "levels"), ("levels", "verdict")),
    *(("floor", "moved"), ("moved", "room"), ("room", "rating"), ("history", "moved")),
)


def flow() -> Figure:
    """Draw what is given, what is computed, and what comes out."""
    figure, (axes,) = panels([(-0.68, 4 * STEP + 0.68, -0.75, 2 * RISE + 0.32)], 2.1)
    place = {name: (column * STEP, row * RISE) for name, (column, row, _, _) in BOXES.items()}
    for name, (_, _, words, kind) in BOXES.items():
        box(axes, place[name], SIZE, words, COLOURS[kind])
    for start, end in ARROWS:
        (x, y), (to_x, to_y) = place[start], place[end]
        if y == to_y:
            arrow(axes, (x + SIZE[0] / 2, y), (to_x - SIZE[0] / 2, to_y))
        else:
            arrow(axes, (x, y - SIZE[1] / 2), (to_x, to_y + SIZE[1] / 2))
    # A recording is a force history too.
    x, y = place["recording"]
    right = place["history"][0] - 0.4
    axes.plot([x + SIZE[0] / 2, right], [y, y], color="0.15", linewidth=1.1)
    arrow(axes, (right, y), (right, place["history"][1] - SIZE[1] / 2))
    words = "What follows a force history knows\nforces against time only, no models."
    text(axes, 3.5 * STEP, RISE, words, fontsize=7.5, color=BLUE, style="italic")
    for i, (kind, colour) in enumerate(COLOURS.items()):
        box(axes, (-0.24 + 0.95 * i, -0.58), (0.8, 0.24), kind, colour)
    return figure
