"""A page with a table and interactive plots, in one self-contained file."""

import html
import json
from collections.abc import Iterable, Sequence
from string import Template
from textwrap import wrap
from typing import Any

from plotly.offline import get_plotlyjs

from thud.plot.style import COLOURS, styled

# Line styles and markers of `thud.plot.style` by the names of plotly.
_DASHES = ("solid", "dash", "dashdot", "dot", "longdashdot", "2px,2px", "longdash")
_SYMBOLS = ("circle", "square", "triangle-up", "diamond", "triangle-down", "cross", "x")
# Maximum number of letters of a line of a legend.
_LINE = 30


def html_page(
    title: str, text: str, table: Sequence[Sequence[str]], plots: Sequence[dict[str, Any]]
) -> str:
    """Return a page: title, text, table (its head first), and plots, the first of full width.

    A click on the legend of the first plot hides the curve of the same number in all of them.
    """
    head, *body = table
    return _PAGE.substitute(
        title=html.escape(title),
        text=html.escape(text),
        head=_row(head, "th"),
        rows="\n".join(_row(row, "td") for row in body),
        places="".join(f'<div id="plot{i}"></div>' for i in range(len(plots))),
        count=len(plots[0]["data"]),
        plots=json.dumps(plots),
        plotly=get_plotlyjs(),
    )


def curve_look(i: int, label: str) -> dict[str, Any]:
    """Return name, line and marker of a curve by its number."""
    return {
        "name": "<br>".join(html.escape(line) for line in wrap(label, _LINE)),
        "line": {"color": COLOURS[i % len(COLOURS)], "dash": styled(i, _DASHES)},
        "marker": {"symbol": styled(i, _SYMBOLS), "size": 8},
    }


def curve_points(x: Iterable[Any], y: Iterable[float]) -> dict[str, list[Any]]:
    """Return a curve, its values with as many digits as can be seen."""
    return {"x": list(x), "y": [float(f"{value:.6g}") + 0.0 for value in y]}


def plot_layout(x: str, y: str, kind: str = "linear", scale: str = "linear") -> dict[str, Any]:
    """Return labels and place of the axes; the page has the colours."""
    return {
        "xaxis": {"title": {"text": x}, "type": kind, "zeroline": False, "automargin": True},
        "yaxis": {
            "title": {"text": y.replace("\n", "<br>")},
            "type": scale,
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
<h1>$title</h1>
<p>$text</p>
<div class="table"><table>
<thead>$head</thead>
<tbody>
$rows
</tbody>
</table></div>
<div class="plots">$places</div>
<script>
const options = {responsive: true, displayModeBar: false};
$plots.forEach((plot, i) => Plotly.newPlot(`plot$${i}`, plot.data, plot.layout, options));
document.getElementById("plot0").on("plotly_restyle", ([change, curves]) => {
  for (const other of document.querySelectorAll(".plots > div:not(#plot0)")) {
    Plotly.restyle(other, change, curves);
  }
});
</script>
</body>
</html>
""")
