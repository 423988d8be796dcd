"""Pages of comparisons: a figure with a table, and the same as an interactive HTML file."""

from __future__ import annotations

import html
import json
from pathlib import Path
from string import Template
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base.display import html_text
from thud.floors.prediction_text import rating_title
from thud.level.assessment import octave_limits
from thud.level.levels import get_bands
from thud.plot.impact_figures import (
    TIME_LABEL,
    contact_force,
    draw_forces,
    draw_levels,
    force_label,
)
from thud.plot.room_figures import FAST_LEVEL
from thud.plot.style import (
    BAND_NAMES,
    COLORS,
    LEVEL,
    RATING_SYMBOL,
    band_axis,
    escape_label,
    iterate_curves,
    legend_above,
    level_label,
    line_style,
    marker_style,
    new_figure,
    own_style,
    styled,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from thud.base._schema import BandSet, LevelsForce, LimitsSource
    from thud.floors.floor_comparison import FloorComparison
    from thud.floors.prediction import RoomPrediction
    from thud.recordings.recording import ImpactResult


# Line styles and markers of `thud.plot.style` by their names in ``curves.js``.
_DASHES = ("solid", "dash", "dashdot", "dot", "longdashdot", "2px,2px", "longdash")
_SYMBOLS = ("circle", "square", "triangle-up", "diamond", "triangle-down", "cross", "x")


def html_page(
    title: str,
    text: str,
    table: Sequence[Sequence[str]],
    plots: Sequence[dict[str, Any]],
    warnings: Sequence[str] = (),
) -> str:
    """Return a page of title, text, table (header row first) and plots, the first of full width.

    Warnings are listed below the table.

    A click on the legend hides the curve with the same index in all plots.
    """
    head, *body = table
    items = "".join(f"<li>{html.escape(warning)}</li>" for warning in warnings)
    return _PAGE.substitute(
        title=html.escape(title),
        text=html_text(text),
        head=_row(head, "th"),
        rows="\n".join(_row(row, "td") for row in body),
        warnings=f"<h2>Warnings</h2><ul>{items}</ul>" if items else "",
        plots=json.dumps(plots).replace("<", r"\u003c"),
        script=Path(__file__).with_name("curves.js").read_text(encoding="utf-8"),
    )


def curve_style(i: int, label: str) -> dict[str, Any]:
    """Return name, line and marker of a curve by its index."""
    return {
        "name": label,
        "line": {"color": COLORS[i % len(COLORS)], "dash": styled(i, _DASHES)},
        "marker": {"symbol": styled(i, _SYMBOLS)},
    }


def curve_points(x: Iterable[Any], y: Iterable[float]) -> dict[str, list[Any]]:
    """Return the points of a curve, with values of six digits."""
    return {"x": list(x), "y": [float(f"{value:.6g}") + 0.0 for value in y]}


def plot_layout(x: str, y: str, kind: str = "linear", scale: str = "linear") -> dict[str, Any]:
    """Return the titles and the kinds of the axes of a plot."""
    return {
        "xaxis": {"title": {"text": x}, "type": kind},
        "yaxis": {"title": {"text": y.replace("\n", "<br>")}, "type": scale},
    }


def _row(cells: Sequence[str], tag: str) -> str:
    # Names of cases may break behind an underscore.
    shown = (html_text(cell).replace("_", "_<wbr>") for cell in cells)
    return "<tr>" + "".join(f"<{tag}>{cell}</{tag}>" for cell in shown) + "</tr>"


_PAGE = Template("""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>thud: $title</title>
<style>
:root { color-scheme: light dark; --text: #1a1a1a; --page: #ffffff; --line: #dddddd;
  --band: #cccccc; }
@media (prefers-color-scheme: dark) {
  :root { --text: #e8e8e8; --page: #17191c; --line: #3a3d42;
    --band: #55595f; }
}
body { font-family: sans-serif; margin: 1.5em auto; max-width: 80em; padding: 0 0.8em;
  color: var(--text); background: var(--page); }
h1 { font-size: 1.5em; }
h2 { font-size: 1.1em; }
.table { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: 0.3em 0.8em; text-align: right; border-bottom: 1px solid var(--line); }
th { vertical-align: bottom; max-width: 12em; overflow-wrap: break-word; }
td { white-space: nowrap; }
th:first-child, td:first-child { text-align: left; position: sticky; left: 0;
  background: var(--page); padding-left: 0; }
@media (max-width: 40em) {
  body { margin-top: 0.8em; }
  table { font-size: 0.85em; }
  th, td { padding: 0.35em 0 0.35em 0.9em; }
  th { max-width: 7em; }
  td { white-space: normal; min-width: 4.5em; max-width: 7em; }
  th:first-child, td:first-child { max-width: 7.5em; overflow-wrap: break-word; }
}
.legend { display: flex; flex-wrap: wrap; gap: 0.4em 1.2em; margin-top: 1.5em; }
.legend > * { overflow-wrap: anywhere; }
.legend button { font: inherit; color: inherit; background: none; border: 0; padding: 0;
  text-align: left; cursor: pointer; }
.legend button[aria-pressed="false"] { opacity: 0.4; }
.plots { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 28em), 1fr));
  gap: 1em; margin-top: 1em; }
.plots > div { height: 24em; min-width: 0; position: relative; }
.plots > div:first-child { grid-column: 1 / -1; }
.area { height: 100%; }
.plots svg { display: block; }
.plots .readout svg { display: inline; }
.plots text { fill: var(--text); font-size: 13px; }
sub { line-height: 0; }
.grid { stroke: var(--line); }
.band { fill: var(--band); }
.cursor { stroke: var(--text); }
.readout { position: absolute; top: 8px; right: 10px; padding: 0.2em 0.5em; font-size: 0.9em;
  background: var(--page); border: 1px solid var(--line); pointer-events: none; }
.readout.left { right: auto; left: 6em; }
</style>
</head>
<body>
<h1>$title</h1>
<p>$text</p>
<div class="table" role="region" aria-label="Table" tabindex="0"><table>
<thead>$head</thead>
<tbody>
$rows
</tbody>
</table></div>
$warnings
<div class="legend"></div>
<div class="plots"></div>
<script>
$script
drawPlots(
$plots
);
</script>
</body>
</html>
""")


@own_style()
def comparison_figure(
    impacts: Mapping[str, ImpactResult], force: LevelsForce | None, source: LimitsSource
) -> Figure:
    """Draw forces, octave and one-third-octave levels of impacts.

    The tolerance band is that of the source; arguments are those of `thud.compare`.
    """
    figure = new_figure(6.3)
    history, octaves, third_octaves = figure.subplots(3, 1, height_ratios=[1.4, 1, 1])
    draw_forces(history, impacts, force)
    draw_levels({"octave": octaves, "third": third_octaves}, impacts, force, source)
    for axes in (octaves, third_octaves):
        axes.set_ylabel(level_label(impacts, force, LEVEL.replace(" level", "\nlevel")))
    figure.align_ylabels()
    legend_above(octaves)
    return figure


def comparison_html(
    impacts: Mapping[str, ImpactResult],
    force: LevelsForce | None,
    source: LimitsSource,
    table: Sequence[Sequence[str]],
) -> str:
    """Return a page of interactive plots and the table, readable on any screen.

    The table is rows of text, header row first.
    """
    forces: list[dict[str, Any]] = []
    levels: dict[BandSet, list[dict[str, Any]]] = {"octave": [], "third": []}
    for i, (label, impact, kind) in enumerate(iterate_curves(impacts, force)):
        style = curve_style(i, label)
        time, newton = contact_force(impact, kind)
        forces.append({**style, "mode": "lines", **curve_points(time, newton), "showlegend": True})
        for bands, traces in levels.items():
            points = curve_points(_names(bands), impact.levels(bands, force=kind))
            traces.append({**style, "mode": "lines+markers", **points, "showlegend": False})
    levels["octave"].append(_tolerance(source))
    level = level_label(impacts, force)
    plots = [
        {"data": forces, "layout": plot_layout(TIME_LABEL, force_label(impacts, force))},
        *(
            {"data": traces, "layout": plot_layout(f"{BAND_NAMES[bands]}, Hz", level, "category")}
            for bands, traces in levels.items()
        ),
    ]
    return html_page(
        "Comparison of models and recordings",
        "Forces as force plates record them, low-passed at 1.25 kHz, and their levels; gray boxes "
        "are the tolerances of the standards, which one-third-octave bands do not have.",
        table,
        plots,
    )


def _names(bands: BandSet) -> list[str]:
    return [f"{frequency:g}" for frequency in get_bands(bands).nominal]


def _tolerance(source: LimitsSource) -> dict[str, Any]:
    """Return the tolerance of each octave as a gray box."""
    lower, upper = octave_limits(source)
    return {
        "type": "bar",
        "name": f"Tolerance, {source.replace('_', ' ')}",
        "x": _names("octave"),
        "y": (upper - lower).tolist(),
        "base": lower.tolist(),
        "showlegend": True,
    }


# Labels of the steps from force to room, and whether their axes are logarithmic.
_STEPS = {
    LEVEL.replace(" level", "\nlevel"): False,
    "Energy into\nthe floor, J": True,
    "Radiated share\nof the losses, %": False,
    FAST_LEVEL: False,
}
# Maximum number of characters of the name of a floor in one line.
_NAME = 18
# Difference below which forces are drawn as one, dB.
_SAME = 0.05


@own_style()
def draw_floors(comparison: FloorComparison) -> Figure:
    """Draw ratings with uncertainties, levels in the room, and the steps that lead to them."""
    predictions = comparison.predictions.values()
    rows = 0.3 + 0.35 * len(predictions)
    figure = new_figure(5.2 + rows)
    ratings, *panels = figure.subplots(5, 1, height_ratios=[rows, 1.4, *[1] * 3])
    steps = zip(*map(_step_values, predictions), strict=True)
    nominal = next(iter(predictions)).frequency
    for axes, (label, logarithmic), curves in zip(panels[::-1], _STEPS.items(), steps, strict=True):
        band_axis(axes, nominal, "third")
        axes.set_ylabel(label)
        if logarithmic:
            axes.set_yscale("log")
        if axes is panels[-1] and len(curves) > 1 and np.ptp(curves, axis=0).max() < _SAME:
            axes.plot(curves[0], color="black", marker=".", linewidth=1)
            axes.text(
                0.97, 0.9, "equal for all floors", transform=axes.transAxes, ha="right", va="top"
            )
            continue
        for i, (name, values) in enumerate(zip(comparison.predictions, curves, strict=True)):
            axes.plot(values, label=escape_label(name), **line_style(i), **marker_style(i, 3.5))
    for axes in panels[:-1]:
        axes.tick_params(axis="x", labelbottom=False)
        axes.set_xlabel("")
    _draw_ratings(ratings, comparison)
    figure.align_ylabels(panels)
    legend_above(panels[0], ratings)
    return figure


def floors_html(comparison: FloorComparison) -> str:
    """Return a page of interactive plots and the table."""
    traces: list[list[dict[str, Any]]] = [[] for _ in _STEPS]
    for i, (name, prediction) in enumerate(comparison.predictions.items()):
        style = curve_style(i, name)
        names = [f"{frequency:g}" for frequency in prediction.frequency]
        for step, values in zip(traces, _step_values(prediction), strict=True):
            points = curve_points(names, values)
            step.append(
                {**style, "mode": "lines+markers", **points, "showlegend": step is traces[-1]}
            )
    plots = [
        {
            "data": data,
            "layout": plot_layout(
                f"{BAND_NAMES['third']}, Hz", label, "category", "log" if logarithmic else "linear"
            ),
        }
        for data, (label, logarithmic) in zip(traces, _STEPS.items(), strict=True)
    ]
    text = "Levels in the room below, and the chain that leads to them: force, energy, floor, room."
    # The first plot has the full width: the level in the room.
    plots = [plots[-1], *plots[:-1]]
    return html_page("Comparison of floors", text, comparison.rows(), plots, comparison.warnings)


def _step_values(prediction: RoomPrediction) -> tuple[NDArray[np.float64], ...]:
    """Return the values of each step of a prediction."""
    force = 10 * np.log10(prediction.energy / prediction.conductance)
    return force, prediction.energy, 100 * prediction.radiated_share, prediction.level


def _draw_ratings(axes: Axes, comparison: FloorComparison) -> None:
    """Draw the asked rating of each floor with its standard uncertainty."""
    predictions = list(comparison.predictions.values())
    y = np.arange(len(predictions))
    ratings = [prediction.rating for prediction in predictions]
    axes.errorbar(
        [rating.level for rating in ratings], y, xerr=[rating.uncertainty for rating in ratings],
        fmt="o", color="black", capsize=3, markersize=4, label="with standard uncertainty",
    )  # fmt: skip
    axes.set_yticks(y, [escape_label(fill(name, _NAME)) for name in comparison.predictions])
    axes.set_ylim(len(y) - 0.4, -0.6)
    titles = {
        rating_title(p, p.room.rating).replace("L_iA,Fmax", RATING_SYMBOL) for p in predictions
    }
    title = titles.pop() if len(titles) == 1 else "Ratings that the rooms ask for"
    axes.set_xlabel("\n(".join(title.split(" (")) + ", dB")
