"""The page of a comparison with interactive plots, in one self-contained file."""

import html
import json
from collections.abc import Mapping, Sequence
from string import Template
from textwrap import wrap
from typing import Any

from plotly.offline import get_plotlyjs

from thud._schema import BandSet, LevelsForce, LimitsSource
from thud.impact import Impact
from thud.levels import get_bands, octave_limits
from thud.plot.force_history import TIME_LABEL, contact_force, force_label
from thud.plot.look import BAND_WORDS, COLOURS, iterate_curves, level_label, styled
from thud.recordings.recording import Recording

# Line styles and markers of `thud.plot.look` by the names of plotly.
_DASHES = ("solid", "dash", "dashdot", "dot", "longdashdot", "2px,2px", "longdash")
_SYMBOLS = ("circle", "square", "triangle-up", "diamond", "triangle-down", "cross", "x")
# Maximum number of letters of a line of a legend.
_LINE = 30


def comparison_html(
    impacts: Mapping[str, Impact | Recording],
    force: LevelsForce | None,
    source: LimitsSource,
    table: Sequence[Sequence[str]],
) -> str:
    """Return the page of `comparison_page` with interactive plots, readable on any screen."""
    forces: list[dict[str, Any]] = []
    levels: dict[BandSet, list[dict[str, Any]]] = {"octave": [], "third": []}
    for i, (label, impact, kind) in enumerate(iterate_curves(impacts, force)):
        look = {
            "name": "<br>".join(html.escape(line) for line in wrap(label, _LINE)),
            "line": {"color": COLOURS[i % len(COLOURS)], "dash": styled(i, _DASHES)},
            "marker": {"symbol": styled(i, _SYMBOLS), "size": 8},
        }
        time, newton = contact_force(impact, kind)
        forces.append({**look, "mode": "lines", **_points(time, newton), "showlegend": True})
        for bands, traces in levels.items():
            found = _points(_names(bands), impact.levels(bands, force=kind))
            traces.append({**look, "mode": "lines+markers", **found, "showlegend": False})
    levels["octave"].append(_tolerance(source))
    level = level_label(impacts, force)
    plots = [
        {"data": forces, "layout": _layout(TIME_LABEL, force_label(impacts, force))},
        *(
            {"data": traces, "layout": _layout(f"{BAND_WORDS[bands]}, Hz", level, "category")}
            for bands, traces in levels.items()
        ),
    ]
    head, *body = table
    rows = "\n".join(_row(row, "td") for row in body)
    return _PAGE.substitute(
        head=_row(head, "th"),
        rows=rows,
        count=len(forces),
        plots=json.dumps(plots),
        plotly=get_plotlyjs(),
    )


def _points(x: Any, y: Any) -> dict[str, list[Any]]:  # noqa: ANN401 - numbers or texts
    """Return a curve, its values with as many digits as can be seen."""
    return {"x": list(x), "y": [float(f"{value:.6g}") + 0.0 for value in y]}


def _names(bands: BandSet) -> list[str]:
    return [f"{frequency:g}" for frequency in get_bands(bands).nominal]


def _tolerance(source: LimitsSource) -> dict[str, Any]:
    """Return the range of each octave as a grey box."""
    lower, upper = octave_limits(source)
    return {
        "type": "bar",
        "name": f"Tolerance, {source.replace('_', ' ')}",
        "x": _names("octave"),
        "y": (upper - lower).tolist(),
        "base": lower.tolist(),
        "hovertext": [f"{low:g} to {high:g} dB" for low, high in zip(lower, upper, strict=True)],
        "hoverinfo": "name+text",
        "marker": {"color": "#bbbbbb"},
        "showlegend": True,
    }


def _layout(x: str, y: str, kind: str = "linear") -> dict[str, Any]:
    """Return labels and place of the axes; the page has the colours."""
    return {
        "xaxis": {"title": {"text": x}, "type": kind, "zeroline": False, "automargin": True},
        "yaxis": {
            "title": {"text": y.replace("\n", "<br>")},
            "zeroline": False,
            "automargin": True,
        },
        "legend": {"orientation": "h", "x": 0, "y": 1.02, "yanchor": "bottom"},
        "margin": {"l": 10, "r": 10, "t": 30, "b": 10},
        "font": {"family": "sans-serif", "size": 14},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
    }


def _row(cells: Sequence[str], tag: str) -> str:
    """Return a row of the table."""
    return "<tr>" + "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in cells) + "</tr>"


# Styles that plotly writes into the plots give way to the colours of the page.
# A click on the legend of the forces hides the curve in all plots.
_PAGE = Template("""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>thud: comparison</title>
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
.table { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { padding: 0.3em 0.8em; text-align: right; border-bottom: 1px solid var(--line); }
th { vertical-align: bottom; max-width: 12em; overflow-wrap: break-word; }
td { white-space: nowrap; }
th:first-child, td:first-child { text-align: left; position: sticky; left: 0;
  background: var(--page); padding-left: 0; }
.plots { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 28em), 1fr));
  gap: 1em; margin-top: 1.5em; }
.plots div:first-child { grid-column: 1 / -1; }
.plots > div { height: 27em; min-width: 0; }
@media (max-width: 60em) {
  .plots > div:first-child { height: calc(24em + 2em * $count); }
}
.plots text:not(.hoverlayer *) { fill: var(--text) !important; }
.plots .gridlayer path { stroke: var(--line) !important; }
.plots [style*="fill: rgb(187, 187, 187)"] { fill: var(--band) !important; }
.plots [style*="stroke: rgb(0, 0, 0)"] { stroke: var(--text) !important; }
.plots .points [style*="fill: rgb(0, 0, 0)"] { fill: var(--text) !important; }
</style>
<script>$plotly</script>
</head>
<body>
<h1>Comparison of models and recordings</h1>
<p>Forces as force plates record them, below 1.25 kHz, and their levels; grey boxes are the
tolerances of the standards, which third octaves do not have.</p>
<div class="table"><table>
<thead>$head</thead>
<tbody>
$rows
</tbody>
</table></div>
<div class="plots"><div id="plot0"></div><div id="plot1"></div><div id="plot2"></div></div>
<script>
const options = {responsive: true, displayModeBar: false};
$plots.forEach((plot, i) => Plotly.newPlot(`plot$${i}`, plot.data, plot.layout, options));
document.getElementById("plot0").on("plotly_restyle", ([change, curves]) => {
  for (const other of ["plot1", "plot2"]) Plotly.restyle(other, change, curves);
});
</script>
</body>
</html>
""")
