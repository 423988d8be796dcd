"""How data flow through thud."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sketch import BLUE, arrow, box, panels, text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Column, row and words of each box, and what makes it.
BOXES = {
    "case": (0, 0, "case\n(namelist)", "given"),
    "recording": (1, 0, "recording of\na force plate", "given"),
    "floor": (2, 0, "floor, room", "given"),
    "model": (0, 1, "source\nmodel", "computed"),
    "history": (1, 1, "force\nhistory", "computed"),
    "levels": (0, 2, "levels in\nbands", "computed"),
    "moved": (2, 2, "contact force\non the floor", "computed"),
    "verdict": (0, 3, "verdict by the\nstandards", "answer"),
    "room": (2, 3, "level in the\nroom below", "computed"),
    "rating": (2, 4, "rating", "answer"),
}
COLOURS = {"given": "#fdf0d5", "computed": "#d7e6f2", "answer": "#d5ece1"}
# Of boxes: distances of the columns and rows, and size.
STEP, RISE, SIZE = 1.0, -0.56, (0.88, 0.36)
ARROWS = (
    *(("case", "model"), ("model", "history"), ("recording", "history"), ("levels", "verdict")),
    *(("floor", "moved"), ("moved", "room"), ("room", "rating")),
)


def flow() -> Figure:
    """Draw what is given, what is computed, and what comes out."""
    figure, (axes,) = panels([(-0.5, 2.5, 4.9 * RISE, 0.24)])
    place = {name: (column * STEP, row * RISE) for name, (column, row, _, _) in BOXES.items()}
    for name, (_, _, words, kind) in BOXES.items():
        box(axes, place[name], SIZE, words, COLOURS[kind])
    for start, end in ARROWS:
        (x, y), (to_x, to_y) = place[start], place[end]
        if y == to_y:
            arrow(axes, (x + SIZE[0] / 2, y), (to_x - SIZE[0] / 2, to_y))
        else:
            arrow(axes, (x, y - SIZE[1] / 2), (to_x, to_y + SIZE[1] / 2))
    # A force history has levels, and acts on the floor.
    x, y = place["history"]
    for side, end in ((-1, "levels"), (1, "moved")):
        to_x, to_y = place[end]
        axes.plot([x, x], [y - SIZE[1] / 2, to_y], color="0.15", linewidth=1.1)
        arrow(axes, (x, to_y), (to_x - side * SIZE[0] / 2, to_y))
    words = "What follows\na force history\nknows forces\nagainst time\nonly, no models."
    text(axes, 1, 3.15 * RISE, words, color=BLUE, style="italic")
    for i, (kind, colour) in enumerate(COLOURS.items()):
        box(axes, (-0.08 + 0.68 * i, 4.55 * RISE), (0.62, 0.2), kind, colour)
    return figure
