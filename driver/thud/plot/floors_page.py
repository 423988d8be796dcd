"""Several floors on one page: force, energy, floor, room, and the levels with their classes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.transforms import Bbox

from thud.base._schema import CLASS_LIMITS
from thud.plot.html_page import curve_look, curve_points, html_page, plot_layout
from thud.plot.style import (
    BAND_WORDS,
    COLOURS,
    LEVEL,
    SIZE,
    WIDTH,
    band_axis,
    escape_label,
    legend_above,
    line_style,
    marker_style,
    new_figure,
    own_style,
    style_axes,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from thud.floors.floor_comparison import FloorComparison
    from thud.floors.prediction import RoomPrediction

# Width of a letter of the table, inch, and letters between two columns.
_LETTER, _GAP = 0.057, 2
# Letters of names that fit beside each other under the bars, per inch.
_LETTERS = 13
# Height of a line of the table, inch.
_LINE = 0.17
# Labels of the steps of the chain, and whether their axes are logarithmic.
_STEPS = {
    LEVEL: False,
    "Energy into the floor, J": True,
    "Radiated share of the losses, %": False,
    "Maximum Fast level, dB re 20 µPa": False,
}


@own_style()
def draw_floors(found: FloorComparison) -> Figure:
    """Draw the chain of each floor as spectra, its levels beside the classes, and the table."""
    table = found.rows()
    below = _LINE * (len(table) + 1)
    letters = [max(map(len, column)) + _GAP for column in zip(*table, strict=True)]
    figure = new_figure(7.2 + below, max(2 * WIDTH, _LETTER * sum(letters)))
    rows = figure.add_gridspec(4, 2, height_ratios=[2.4, 2.4, 2.4, below])
    panels = [style_axes(figure.add_subplot(rows[i, j])) for i in range(2) for j in range(2)]
    for number, (name, one) in enumerate(found.predictions.items()):
        for axes, values in zip(panels, _chain(one), strict=True):
            axes.plot(
                np.arange(len(values)), values, label=escape_label(name), **line_style(number),
                **marker_style(number, 3.5),
            )  # fmt: skip
    nominal = next(iter(found.predictions.values())).frequency
    for axes, (label, logarithmic) in zip(panels, _STEPS.items(), strict=True):
        band_axis(axes, nominal, "third")
        axes.set_ylabel(label, fontsize=SIZE)
        if logarithmic:
            axes.set_yscale("log")
    _draw_classes(style_axes(figure.add_subplot(rows[2, :])), found)
    axes = figure.add_subplot(rows[3, :])
    axes.set_axis_off()
    cells = axes.table(
        [[escape_label(cell) for cell in row] for row in table],
        bbox=Bbox.unit(),
        edges="horizontal",
        colWidths=letters,
    )
    cells.auto_set_font_size(value=False)
    cells.set_fontsize(SIZE - 1)
    for (_, column), cell in cells.get_celld().items():
        cell.set_linewidth(0.5)
        cell.set_text_props(ha="left" if column == 0 else "right")
    legend_above(panels[0])
    return figure


def floors_html(found: FloorComparison) -> str:
    """Return the page of `draw_floors` with interactive plots."""
    traces: list[list[dict[str, Any]]] = [[] for _ in _STEPS]
    for number, (name, one) in enumerate(found.predictions.items()):
        look = curve_look(number, name)
        names = [f"{frequency:g}" for frequency in one.frequency]
        for step, values in zip(traces, _chain(one), strict=True):
            points = curve_points(names, values)
            step.append(
                {**look, "mode": "lines+markers", **points, "showlegend": step is traces[-1]}
            )
    plots = [
        {
            "data": data,
            "layout": plot_layout(
                f"{BAND_WORDS['third']}, Hz", label, "category", "log" if logarithmic else "linear"
            ),
        }
        for data, (label, logarithmic) in zip(traces, _STEPS.items(), strict=True)
    ]
    text = (
        "Levels in the room below, and the chain that leads to them: force, energy, floor, room. "
        "Statistical means over positions, floors and rooms: see the warnings of each prediction."
    )
    # The level in the room, of full width, comes first.
    return html_page("Comparison of floors", text, found.rows(), [plots[-1], *plots[:-1]])


def _chain(one: RoomPrediction) -> tuple[NDArray[np.float64], ...]:
    """Return what is drawn of a prediction, in the order of the steps."""
    force = 10 * np.log10(one.energy / one.conductance)
    return force, one.energy, 100 * one.radiated_share, one.level


def _draw_classes(axes: Axes, found: FloorComparison) -> None:
    """Draw the single numbers beside the maximum levels of the Korean classes."""
    place = np.arange(len(found.predictions))
    room = [one.octave_rating.a_weighted for one in found.predictions.values()]
    after = [one.standardised_rating.a_weighted for one in found.predictions.values()]
    axes.bar(
        place - 0.2, room, 0.36, color=COLOURS[5], edgecolor="black", linewidth=0.5,
        label="in the room, of octaves",
    )  # fmt: skip
    axes.bar(
        place + 0.2, after, 0.36, color="white", edgecolor="black", linewidth=0.5,
        hatch="//////", label="standardised, of thirds",
    )  # fmt: skip
    for number, limit in enumerate(CLASS_LIMITS, 1):
        axes.axhline(limit, color=COLOURS[1], linewidth=0.8, linestyle="--")
        axes.annotate(
            f"class {number}", (1, limit), xycoords=("axes fraction", "data"), ha="left",
            va="center", fontsize=SIZE - 2, color=COLOURS[1],
        )  # fmt: skip
    names = [escape_label(name) for name in found.predictions]
    axes.set_xticks(place, names)
    width = axes.bbox.width / axes.figure.dpi
    if max(map(len, names)) * len(names) > _LETTERS * width:
        axes.tick_params(axis="x", labelrotation=20)
    axes.set_ylabel("L_iA,Fmax, dB", fontsize=SIZE)
    axes.set_ylim(bottom=min([CLASS_LIMITS[0], *room, *after]) - 5)
    axes.legend(
        fontsize=SIZE - 1, frameon=False, ncols=2, loc="lower left", bbox_to_anchor=(0, 1),
        borderpad=0,
    )  # fmt: skip
