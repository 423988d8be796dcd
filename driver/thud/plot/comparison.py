"""Forces, octave and third levels of several impacts, and a table, on one page."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure

from thud.impact import Impact
from thud.plot.force_history import draw_forces
from thud.plot.levels import draw_tolerance
from thud.plot.look import (
    SIZE,
    WIDTH,
    dress,
    iterate_curves,
    line_style,
    literal,
    marker_style,
    octave_axis,
)
from thud.recording import Recording


def comparison_page(
    impacts: Mapping[str, Impact | Recording],
    force: str,
    source: str,
    table: Sequence[Sequence[str]],
) -> Figure:
    """Draw forces, octave and third levels of several impacts, and a table, on one page.

    The table is a header and rows of text; the tolerance band is that of the source. Arguments are
    those of `thud.compare`.
    """
    figure = Figure(figsize=(2 * WIDTH, 7.5), dpi=200, layout="constrained")
    rows = figure.add_gridspec(3, 2, height_ratios=[3, 3, 0.35 + 0.25 * len(table)])
    history = dress(figure.add_subplot(rows[0, :]))
    panels = {
        "octave": dress(figure.add_subplot(rows[1, 0])),
        "third": dress(figure.add_subplot(rows[1, 1])),
    }
    draw_tolerance(panels["octave"], source)
    draw_forces(history, impacts, force)
    for i, (_, impact, kind) in enumerate(iterate_curves(impacts, force)):
        for bands, axes in panels.items():
            values = impact.levels(bands, "exact", kind)
            axes.plot(np.arange(len(values)), values, **line_style(i), **marker_style(i, 3))
    history.legend(fontsize=SIZE, frameon=False)
    for bands, axes in panels.items():
        octave_axis(axes, bands)
        axes.set_ylabel("Force exposure level, dB re 1 N", fontsize=SIZE)
    panels["octave"].legend(fontsize=SIZE, frameon=False)
    below = figure.add_subplot(rows[2, :])
    below.axis("off")
    cells = below.table(
        [[literal(cell) for cell in row] for row in table], loc="center", edges="horizontal"
    )
    cells.auto_set_font_size(value=False)
    cells.set_fontsize(SIZE - 1)
    cells.auto_set_column_width(list(range(len(table[0]))))
    return figure
