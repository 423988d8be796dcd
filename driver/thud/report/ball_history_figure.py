"""The control chart of a ball: each criterion by date, with its limits."""

from __future__ import annotations

from datetime import timedelta
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter
from matplotlib.ticker import MultipleLocator

from thud.plot.style import COLORS, GRAY, WIDTH, escape_label, legend_above, new_figure, own_style
from thud.report.ball_history import ACTION, WARNING
from thud.report.rows import NOT_KNOWN

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from thud.report.ball_history import History, Series

# Marker and its fill by verdict: distinct in grey as well.
MARKS = {
    "conforms": ("o", COLORS[0]),
    "undecided": ("s", "white"),
    "does not conform": ("X", COLORS[1]),
}
TREND: dict[str, Any] = {"color": COLORS[0], "linewidth": 1, "linestyle": "--"}
# Lines of the control limits, by their distance in standard deviations, and of calibrations.
CONTROL: dict[float, dict[str, Any]] = {
    WARNING: {"color": COLORS[4], "linewidth": 0.8, "linestyle": ":"},
    ACTION: {"color": COLORS[1], "linewidth": 0.8, "linestyle": "-."},
}
CALIBRATION: dict[str, Any] = {"color": COLORS[2], "linewidth": 0.8, "linestyle": (0, (6, 2))}
# Margin before the first and after the last report: fraction of the time between them, and minimum.
MARGIN, MIN_MARGIN = 0.06, timedelta(days=15)
# Maximum number of characters in a line of the title.
MAX_TITLE = 90


@own_style()
def draw_history(history: History) -> Figure:
    """Draw each criterion of a ball by the date of its reports.

    The allowed range is grey, bars are expanded uncertainties (95 %), markers show the verdict, and
    lines the significant trends, control limits and calibrations. The last panel has the recorded
    temperatures.
    """
    has_temperature = any(value is not None for value in history.temperatures)
    count = len(history.series) + has_temperature
    rows = -(-count // 2)
    figure = new_figure(0.5 + 1.15 * rows, 2 * WIDTH)
    panels = figure.subplots(rows, 2, sharex=True, squeeze=False).T.ravel()
    for axes, series in zip(panels, history.series, strict=False):
        _draw_criterion(axes, history, series)
    if has_temperature:
        _draw_temperature(panels[count - 1], history)
    for axes in panels[:count]:
        for date in history.calibrations:
            axes.axvline(date, **CALIBRATION)
    for axes in panels[count:]:
        axes.remove()
    panels[count - 1].tick_params(labelbottom=True)
    figure.align_ylabels()
    margin = max(MARGIN * (history.dates[-1] - history.dates[0]), MIN_MARGIN)
    first = panels[0]
    first.set_xlim(history.dates[0] - margin, history.dates[-1] + margin)
    locator = AutoDateLocator(minticks=3, maxticks=6)  # type: ignore[no-untyped-call]
    first.xaxis.set_major_locator(locator)
    first.xaxis.set_major_formatter(ConciseDateFormatter(locator))  # type: ignore[no-untyped-call]
    _add_legend(first, history)
    return figure


def _draw_criterion(axes: Axes, history: History, series: Series) -> None:
    entries, scale = series.entries, series.quantity.display_scale
    bounds = np.array([(entry["lower"], entry["upper"]) for entry in entries]) * scale
    # A count has a single allowed value: its area gets a height.
    is_count = bounds[0, 0] == bounds[0, 1]
    bounds += is_count * np.array([-0.4, 0.4])
    # The area extends beyond both ends of the axis.
    span = history.dates[-1] - history.dates[0] + MIN_MARGIN
    edges = np.array([history.dates[0] - span, *history.dates, history.dates[-1] + span])
    lower, upper = np.pad(bounds, ((1, 1), (0, 0)), "edge").T
    axes.fill_between(edges, lower, upper, step="mid", color=GRAY, linewidth=0)
    for date, entry in zip(history.dates, entries, strict=True):
        if entry["value"] is None:
            continue
        bar = (entry["expanded_uncertainty"] or 0.0) * scale
        axes.errorbar(
            date, entry["value"] * scale, yerr=bar,  # type: ignore[arg-type]
            **_marker(entry["verdict"]),
        )  # fmt: skip
    if all(entry["value"] is None for entry in entries):
        axes.text(0.5, 0.5, NOT_KNOWN, transform=axes.transAxes, ha="center")
    if series.trend and series.is_drifting:
        dates = np.array([history.date(year) for year in series.trend.time])
        axes.plot(dates, series.trend.value * scale, **TREND)
    if series.control is not None:
        for factor, line in CONTROL.items():
            for distance in (-factor * series.control.deviation, factor * series.control.deviation):
                axes.axhline((series.control.mean + distance) * scale, **line)
    axes.margins(y=0.15)
    if is_count:
        axes.yaxis.set_major_locator(MultipleLocator(1))
    axes.set_ylabel(series.title.replace(", ", ",\n"))


def _draw_temperature(axes: Axes, history: History) -> None:
    pairs = zip(history.dates, history.temperatures, strict=True)
    known = [(date, value) for date, value in pairs if value is not None]
    dates, values = zip(*known, strict=True)
    axes.plot(dates, values, color="black", linestyle="none", marker="o", markersize=3.5)
    axes.margins(y=0.2)
    axes.set_ylabel("Temperature,\n°C")


def _marker(verdict: str) -> dict[str, Any]:
    """Return the style of a value by its verdict."""
    marker, color = MARKS[verdict]
    return {
        "marker": marker, "markersize": 4.5, "markerfacecolor": color, "markeredgewidth": 0.7,
        "color": "black", "linestyle": "none", "capsize": 2, "elinewidth": 0.8,
    }  # fmt: skip


def _add_legend(axes: Axes, history: History) -> None:
    axes.fill_between([], [], color=GRAY, linewidth=0, label="allowed")
    for verdict in MARKS:
        axes.errorbar([], [], yerr=[], label=verdict, **_marker(verdict))
    if any(series.is_drifting for series in history.series):
        axes.plot([], [], label="trend", **TREND)
    if any(series.control is not None for series in history.series):
        for (factor, line), name in zip(CONTROL.items(), ("warning", "action"), strict=True):
            axes.plot([], [], label=f"{name} limits ({factor:g} σ)", **line)
    if history.calibrations:
        axes.plot([], [], label="calibration", **CALIBRATION)
    legend_above(axes, title=escape_label(fill(history.title, MAX_TITLE)))
