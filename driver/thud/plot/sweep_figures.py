"""Figure of a sweep: levels against one parameter, its axis in the unit and scale of the study."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from matplotlib.ticker import FormatStrFormatter, LogLocator, MaxNLocator, NullFormatter

from thud.base.units import display_unit
from thud.case.keys import humanize
from thud.level.assessment import octave_limits
from thud.level.levels import FORCES, get_bands
from thud.plot.style import (
    COLORS,
    FORCE_NAMES,
    RATING_SYMBOL,
    curve_style,
    figure_of,
    finish,
    own_panels,
    own_style,
)

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from thud.impact.ensemble import Ensemble
    from thud.studies.sweep import Sweep

    Columns = dict[str, NDArray[Any]]


# Range of numbers that are shown in the unit of the key; others have a display unit.
_PLAIN_RANGE = (1e-2, 1e4)
# Ratios of maximum to minimum from which logarithmic ticks are 1, 2, 5, or powers of ten only.
_MIN_STEP_RATIO, _MIN_DECADE_RATIO = 5.0, 200.0
# Maximum number of ungrouped values of a parameter, and number of groups.
_MAX_VALUES, _GROUP_COUNT = 32, 16
# Maximum number of markers of a line.
_MAX_MARKERS = 16
# Maximum number of values of a text parameter that have a line each.
_MAX_LINES = 6
# Smallest range of levels that is drawn, dB.
MIN_RANGE = 0.05


def show_parameter(axes: Axes, which: Literal["x", "y"], parameter: xr.DataArray) -> float:
    """Give an axis the name, unit and scale of a numeric parameter.

    Return the factor that converts its values to the unit of the axis.
    """
    own = parameter.attrs["units"]
    unit = parameter.attrs.get("shown_unit", own)
    factor = 10.0 ** int(parameter.attrs.get("shown_exponent", 0))
    values = parameter.values
    maximum = float(np.abs(values).max())
    if unit == own and not _PLAIN_RANGE[0] <= maximum < _PLAIN_RANGE[1]:
        unit, size = display_unit(unit, maximum)
        factor = 1 / size
    # A digit behind a unit is an exponent, as in "MN/m3".
    shown = re.sub(
        r"(?<=[a-z])\d", lambda match: "⁰¹²³⁴⁵⁶⁷⁸⁹"[int(match[0])], unit.replace("degC", "°C")
    )
    label = parameter_label(parameter) if unit == "1" else f"{parameter_label(parameter)}, {shown}"
    axes.set(**{f"{which}label": label})
    axis: Axis = getattr(axes, f"{which}axis")
    if parameter.attrs.get("scale") == "log":
        axes.set(**{f"{which}scale": "log"})
        _mark_decades(axis, values * factor)
    else:
        axes.ticklabel_format(axis=which, useOffset=False)
    return factor


def _mark_decades(axis: Axis, values: NDArray[np.float64]) -> None:
    """Give a logarithmic axis ticks with plain numbers."""
    ratio = values.max() / values.min()
    if ratio < _MIN_STEP_RATIO:
        axis.set_major_locator(MaxNLocator(5))
    else:
        axis.set_major_locator(
            LogLocator(subs=(1, 2, 5) if ratio < _MIN_DECADE_RATIO else (1,), numticks=12)
        )
    axis.set_major_formatter(FormatStrFormatter("%g"))
    axis.set_minor_formatter(NullFormatter())


def parameter_label(parameter: xr.DataArray) -> str:
    """Return the name of a parameter in words, as a label begins."""
    return humanize(str(parameter.name)).capitalize()


class _Curves(NamedTuple):
    """Levels of each sample, dB, shape (n_sample, n_panel), and the titles of their panels.

    The tolerance of each panel is the minimum and the maximum one over the samples, of levels
    relative to nominal ones, dB.
    """

    level: NDArray[np.float64]
    titles: list[str]
    label: str
    tolerance: NDArray[np.float64] | None = None


@own_style()
def draw_sweep(result: Sweep | Ensemble, ax: Axes | None = None) -> Figure:
    """Draw octave levels against the first numeric parameter that has several values.

    Levels are those of the assessed force relative to the nominal ones, dB; for a case with a room
    the rating of the levels in it is drawn instead. Each octave has a panel with its tolerance;
    axes of a user show the lowest. The first text parameter with up to six values has a line for
    each; lines are medians over the other parameters, shades extend from the minimum to the
    maximum.
    """
    dataset = result.to_xarray()
    columns = _columns(dataset)
    varied = [name for name, values in columns.items() if len(np.unique(values)) > 1]
    numeric = [name for name in varied if columns[name].dtype.kind in "iuf"]
    name = (numeric or varied or list(columns))[0]
    texts = [n for n in varied if n not in numeric and n != name]
    line_parameter = next((n for n in texts if len(np.unique(columns[n])) <= _MAX_LINES), None)
    if "room_rating" in dataset:
        level = dataset["room_rating"].values.reshape(-1, 1)
        drawn = _Curves(level, ["in the room"], f"{RATING_SYMBOL} in the room below,\ndB re 20 µPa")
    else:
        drawn = _get_relative_levels(dataset, columns)
    lines = {"": np.ones(len(columns[name]), dtype=bool)}
    if line_parameter:
        values = columns[line_parameter]
        lines = {str(value): values == value for value in np.unique(values)}
    count = len(drawn.titles)
    panels = own_panels(ax, 2.5 if count == 1 else 1.0 * count, count, sharex=True)
    has_shades = False
    for i, (axes, title) in enumerate(zip(panels, drawn.titles, strict=ax is None)):
        if count > 1:
            axes.text(1.02, 0.5, title, transform=axes.transAxes, rotation=90, va="center")
        if drawn.tolerance is not None:
            for width, color in zip(drawn.tolerance[i, ::-1], ("0.92", "0.84"), strict=True):
                axes.axhspan(-width, width, color=color, linewidth=0, zorder=0)
            axes.axhline(0, color="0.45", linewidth=0.8)
        for j, (value, mask) in enumerate(lines.items()):
            level = np.where(mask, drawn.level[:, i], np.nan)
            label = humanize(value)
            has_shades |= _draw_line(axes, dataset[name], columns[name], level, label, j)
    for axes in panels if ax is None else ():
        axes.label_outer()
    figure = figure_of(panels[0])
    (ax.set_ylabel if ax is not None else figure.supylabel)(drawn.label)
    others = [n for n in varied if n not in {name, line_parameter}]
    explanation = _get_explanation(drawn, others, has_shades=has_shades)
    return finish(panels[0], ax, explanation)


def _columns(dataset: xr.Dataset) -> Columns:
    """Return the parameters of each sample."""
    whole = dataset["status"]
    names = [str(name) for name in dataset.coords if set(dataset[name].dims) <= set(whole.dims)]
    return {name: dataset[name].broadcast_like(whole).values.ravel() for name in names}


def _get_relative_levels(dataset: xr.Dataset, columns: Columns) -> _Curves:
    """Return the levels of the assessed force relative to the nominal levels of the source."""
    levels = {
        force: dataset[f"{force}_octave"].values.reshape(-1, len(dataset["octave"]))
        for force in FORCES
    }
    count = len(dataset["status"].values.ravel())
    forces = columns.get("force", np.full(count, dataset.attrs["assessed_force"]))
    sources = columns.get("source", np.full(count, dataset.attrs["limits"]))
    level = np.where((forces == "floor")[:, np.newaxis], levels["floor"], levels["elastic"])
    limits = [octave_limits(source) for source in np.unique(sources)]
    for source, (lower, upper) in zip(np.unique(sources), limits, strict=True):
        level[sources == source] -= (lower + upper) / 2
    half = np.array([(upper - lower) / 2 for lower, upper in limits])
    force = "assessed force" if "force" in columns else FORCE_NAMES[dataset.attrs["assessed_force"]]
    names = [f"{band:g} Hz" for band in get_bands().nominal]
    label = f"Level − nominal, dB\n({force})"
    return _Curves(level, names, label, np.transpose([half.min(axis=0), half.max(axis=0)]))


def _draw_line(  # noqa: PLR0913, PLR0917 - what is drawn, and how
    axes: Axes,
    parameter: xr.DataArray,
    values: NDArray[Any],
    level: NDArray[np.float64],
    label: str,
    style: int,
) -> bool:
    """Draw the levels of samples, without NaN, against a parameter; return whether they range."""
    positions, groups, names = _group_values(values)
    if names is None:
        positions = positions * show_parameter(axes, "x", parameter)
    else:
        axes.set_xticks(positions, names)
        axes.tick_params(axis="x", labelrotation=20)
        axes.set_xlabel(parameter_label(parameter))
    # Slow to import.
    import pandas as pd

    grouped = pd.Series(level).groupby(groups)
    middle, lower, upper = (f().to_numpy() for f in (grouped.median, grouped.min, grouped.max))
    marker_size = 3 if len(positions) <= _MAX_MARKERS else 0
    axes.plot(positions, middle, label=label, **curve_style(style, marker_size))
    has_shades = bool(np.nanmax(upper - lower, initial=0) > MIN_RANGE)
    if has_shades:
        color = COLORS[style % len(COLORS)]
        axes.fill_between(positions, lower, upper, color=color, alpha=0.15, linewidth=0)
    return has_shades


def _group_values(
    values: NDArray[Any],
) -> tuple[NDArray[np.float64], NDArray[np.intp], list[str] | None]:
    """Return positions on an axis, the group of each sample, and labels if the values are texts."""
    distinct, groups = np.unique(values, return_inverse=True)
    if values.dtype.kind not in "iuf":
        return np.arange(len(distinct), dtype=float), groups, [str(value) for value in distinct]
    if len(distinct) > _MAX_VALUES:
        edges = np.quantile(values, np.linspace(0, 1, _GROUP_COUNT + 1))
        groups = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, _GROUP_COUNT - 1)
        distinct = np.array([np.median(values[groups == i]) for i in np.unique(groups)])
    return distinct.astype(float), groups, None


def _get_explanation(drawn: _Curves, others: list[str], *, has_shades: bool) -> str:
    """Return the explanation of lines, shades and gray areas."""
    lines = []
    if others:
        names = humanize(others[0]) if len(others) == 1 else f"{len(others)} other parameters"
        lines.append(
            f"Lines: median over {names}; shades: range" if has_shades else f"Also varied: {names}"
        )
    if drawn.tolerance is not None:
        lines.append("Gray: tolerance of the octave")
    return "\n".join(lines)
