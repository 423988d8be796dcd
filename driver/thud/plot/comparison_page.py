"""Forces, octave and third-octave levels of several impacts, and a table, on one page."""

from collections.abc import Mapping, Sequence
from textwrap import fill

from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from thud.base._schema import LevelsForce, LimitsSource
from thud.level.impact_result import ImpactResult
from thud.plot.force_history_figure import draw_forces
from thud.plot.levels_figure import draw_levels
from thud.plot.style import (
    SIZE,
    WIDTH,
    escape_label,
    legend_above,
    level_label,
    new_figure,
    own_style,
    style_axes,
)

# Size of a letter and of a line of the table, inch; letters of a name on one line.
_LETTER, _LINE = 0.062, 0.17
_LETTERS = 20


@own_style()
def comparison_page(
    impacts: Mapping[str, ImpactResult],
    force: LevelsForce | None,
    source: LimitsSource,
    table: Sequence[Sequence[str]],
) -> Figure:
    """Draw forces, octave and third-octave levels of several impacts, and a table, on one page.

    The table is rows of text, first the head; the tolerance band is that of the source. Other
    arguments are those of `thud.compare`.
    """
    head, *body = table
    letters = [
        2 + max([min(len(name), _LETTERS), *map(len, column)])
        for name, *column in zip(*table, strict=True)
    ]
    names = [fill(name, length) for name, length in zip(head, letters, strict=True)]
    lines = [1 + max(name.count("\n") for name in names), *(1 for _ in body)]
    below = _LINE * (sum(lines) + 1)
    width = max(2 * WIDTH, 0.8 + _LETTER * sum(letters))
    figure = new_figure(5.8 + below, width)
    rows = figure.add_gridspec(3, 2, height_ratios=[2.7, 2.7, below])
    draw_forces(style_axes(figure.add_subplot(rows[0, :])), impacts, force)
    octaves = figure.add_subplot(rows[1, 0])
    thirds = figure.add_subplot(rows[1, 1], sharey=octaves)
    draw_levels({"octave": octaves, "third": thirds}, impacts, force, source)
    octaves.set_ylabel(level_label(impacts, force), fontsize=SIZE)
    legend_above(octaves)
    axes = figure.add_subplot(rows[2, :])
    axes.set_axis_off()
    cells = axes.table(
        [[escape_label(cell) for cell in row] for row in (names, *body)],
        colWidths=[length / sum(letters) for length in letters],
        bbox=Bbox.unit(),
        edges="horizontal",
    )
    cells.auto_set_font_size(value=False)
    cells.set_fontsize(SIZE - 1)
    for (row, column), cell in cells.get_celld().items():
        cell.set(height=lines[row] / sum(lines), linewidth=0.5)
        cell.PAD = 0.05
        cell.set_text_props(ha="left" if column == 0 else "right")
    return figure
