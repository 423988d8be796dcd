"""Figures of studies: sweep, design map, sensitivity, uncertainty, surrogate."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, cast

import numpy as np
from matplotlib.colors import TwoSlopeNorm
from matplotlib.ticker import (
    FormatStrFormatter,
    LogLocator,
    MaxNLocator,
    NullFormatter,
)

from thud.base._schema import CLASS_LIMITS, RATINGS
from thud.base.units import display_unit
from thud.case.keys import humanize
from thud.level.assessment import octave_limits
from thud.level.levels import FORCES, get_bands
from thud.level.rating import excess_level
from thud.plot.style import (
    COLORS,
    FORCE_NAMES,
    LINES,
    RATING_SYMBOL,
    empty_axes,
    legend_above,
    line_style,
    marker_style,
    new_figure,
    octave_axis,
    octave_boxes,
    own_style,
)

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.collections import PolyCollection
    from matplotlib.colorbar import Colorbar
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from thud.studies.design import Design
    from thud.studies.sensitivity import Sensitivity
    from thud.studies.sweep import Sweep
    from thud.studies.trained_surrogate import Surrogate
    from thud.studies.uncertainty import Uncertainty

    Values = NDArray[np.float64]
    Columns = dict[str, NDArray[Any]]


AxisName = Literal["x", "y"]
# Maximum number of panels side by side.
_MAX_COLUMNS = 3
# Range of numbers that are shown in the unit of the key; others have a display unit.
_PLAIN_RANGE = (1e-2, 1e4)
# Ratios of maximum to minimum from which logarithmic ticks are 1, 2, 5, or powers of ten only.
_MIN_STEP_RATIO, _MIN_DECADE_RATIO = 5.0, 200.0


def show_parameter(axes: Axes, which: AxisName, parameter: xr.DataArray) -> float:
    """Give an axis the name, unit and scale of a numeric parameter.

    Return the factor that converts its values to the unit of the axis.
    """
    unit, factor = parameter.attrs["shown_unit"], 10.0 ** int(parameter.attrs["shown_exponent"])
    values = parameter.values
    maximum = float(np.abs(values).max())
    if unit == parameter.attrs["units"] and not _PLAIN_RANGE[0] <= maximum < _PLAIN_RANGE[1]:
        unit, size = display_unit(unit, maximum)
        factor = 1 / size
    shown = re.sub(r"(?<=[a-z])\d", _raise_digit, unit.replace("degC", "°C"))
    label = parameter_label(parameter) if unit == "1" else f"{parameter_label(parameter)}, {shown}"
    axes.set(**{f"{which}label": label})
    axis: Axis = getattr(axes, f"{which}axis")
    if parameter.attrs.get("scale") == "log":
        axes.set(**{f"{which}scale": "log"})
        _mark_decades(axis, values * factor)
    else:
        axes.ticklabel_format(axis=which, useOffset=False)
    return factor


def _raise_digit(match: re.Match[str]) -> str:
    """Return a digit as an exponent: "MN/m3" has a power."""
    return match[0].translate(str.maketrans("23456789", "²³⁴⁵⁶⁷⁸⁹"))


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


# Maximum number of ungrouped values of a parameter, and number of groups.
_MAX_VALUES = 32
_GROUP_COUNT = 16
# Maximum number of markers of a line; half as many in half the width.
_MAX_MARKERS = 16
# Maximum number of values of a text parameter that have a panel each.
_MAX_PANELS = 6
# Maximum number of marks of samples along an axis.
_MAX_MARKS = 21
# Smallest range of levels that is drawn, dB.
_MIN_RANGE = 0.05


class _Curves(NamedTuple):
    """Levels of each sample, dB, shape (n_sample, n_curve), names of the curves, and their axis.

    The tolerance is the minimum and the maximum one of levels relative to nominal ones, dB.
    """

    level: NDArray[np.float64]
    names: list[str]
    label: str
    tolerance: tuple[float, float] | None = None


@own_style()
def draw_sweep(result: Sweep) -> Figure:
    """Draw octave levels against the first numeric parameter that has several values.

    Levels are those of the assessed force relative to the nominal ones, dB; for a case with a room
    the rating of the levels in it is drawn instead. The first text
    parameter with up to six values has a panel for each. Lines are medians over the other
    parameters; shades extend from the minimum to the maximum.
    """
    dataset = result.dataset
    columns = _columns(dataset)
    varied = [name for name, values in columns.items() if len(np.unique(values)) > 1]
    numeric = [name for name in varied if columns[name].dtype.kind in "iuf"]
    name = (numeric or varied or list(columns))[0]
    texts = [n for n in varied if n not in numeric and n != name]
    panel_parameter = next((n for n in texts if len(np.unique(columns[n])) <= _MAX_PANELS), None)
    drawn = (
        _get_ratings(dataset)
        if "room_rating" in dataset
        else _get_relative_levels(dataset, columns)
    )
    masks = {"": np.ones(len(columns[name]), dtype=bool)}
    if panel_parameter:
        masks = {
            str(value): columns[panel_parameter] == value
            for value in np.unique(columns[panel_parameter])
        }
    column_count = 1 if len(masks) == 1 else 2
    row_count = -(-len(masks) // column_count)
    figure = new_figure(1.1 + (1.9 if column_count == 1 else 1.6) * row_count)
    panels = figure.subplots(
        row_count, column_count, sharex=True, sharey=True, squeeze=False
    ).ravel()
    has_shades = False
    for i, (axes, (title, mask)) in enumerate(zip(panels, masks.items(), strict=False)):
        if drawn.tolerance:
            _draw_tolerance(axes, drawn.tolerance)
        curves = drawn._replace(level=np.where(mask[:, np.newaxis], drawn.level, np.nan))
        has_shades |= _draw_curves(
            axes, dataset[name], columns[name], curves, _MAX_MARKERS // column_count
        )
        axes.set_title(title.replace("_", " "))
        lowest = i + column_count >= len(masks)
        axes.tick_params(axis="x", labelbottom=lowest)
        axes.xaxis.label.set_visible(lowest)
    for axes in panels[len(masks) :]:
        axes.remove()
    figure.supylabel(drawn.label)
    others = [n for n in varied if n not in {name, panel_parameter}]
    explanation = _get_explanation(drawn, panel_parameter, others, has_shades=has_shades)
    legend_above(panels[0], title=explanation)
    return figure


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
    tolerances: list[float] = []
    for source in np.unique(sources):
        lower, upper = octave_limits(source)
        level[sources == source] -= (lower + upper) / 2
        tolerances.extend((upper - lower) / 2)
    force = "assessed force" if "force" in columns else FORCE_NAMES[dataset.attrs["assessed_force"]]
    names = [f"{band:g} Hz" for band in get_bands().nominal]
    label = f"Level − nominal, dB\n({force})"
    return _Curves(level, names, label, (min(tolerances), max(tolerances)))


def _get_ratings(dataset: xr.Dataset) -> _Curves:
    """Return the rating of the levels in the room."""
    level = dataset["room_rating"].values.reshape(-1, 1)
    return _Curves(level, ["in the room"], f"{RATING_SYMBOL} in the room below,\ndB re 20 µPa")


def _draw_tolerance(axes: Axes, tolerance: tuple[float, float]) -> None:
    """Draw the maximum tolerance of all octaves around the nominal level, the minimum on top."""
    for width, color in zip(reversed(tolerance), ("0.92", "0.84"), strict=True):
        axes.axhspan(-width, width, color=color, linewidth=0, zorder=0)
    axes.axhline(0, color="0.45", linewidth=0.8)


def _draw_curves(
    axes: Axes,
    parameter: xr.DataArray,
    values: NDArray[Any],
    curves: _Curves,
    max_markers: int,
) -> bool:
    """Draw the levels of samples, without NaN, against a parameter; return whether they range."""
    positions, members, names = _group_values(values)
    if names is None:
        positions = positions * show_parameter(axes, "x", parameter)
    else:
        axes.set_xticks(positions, names)
        axes.tick_params(axis="x", labelrotation=20)
        axes.set_xlabel(parameter_label(parameter))
    has_shades = False
    for i, title in enumerate(curves.names):
        groups = [curves.level[chosen, i] for chosen in members]
        middle, lower, upper = (
            np.array([_of_finite(group, f) for group in groups])
            for f in (np.median, np.min, np.max)
        )
        marks = marker_style(i, 3) if len(positions) <= max_markers else {}
        axes.plot(positions, middle, label=title, **line_style(i), **marks)
        if np.nanmax(upper - lower, initial=0) > _MIN_RANGE:
            axes.fill_between(positions, lower, upper, color=COLORS[i], alpha=0.15, linewidth=0)
            has_shades = True
    return has_shades


def _group_values(
    values: NDArray[Any],
) -> tuple[NDArray[np.float64], list[NDArray[np.bool_]], list[str] | None]:
    """Return positions on an axis, the samples at each, and labels if the values are texts."""
    distinct = np.unique(values)
    if values.dtype.kind not in "iuf":
        members = [values == value for value in distinct]
        return np.arange(len(distinct), dtype=float), members, [str(value) for value in distinct]
    if len(distinct) <= _MAX_VALUES:
        return distinct.astype(float), [values == value for value in distinct], None
    edges = np.quantile(values, np.linspace(0, 1, _GROUP_COUNT + 1))
    position = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, _GROUP_COUNT - 1)
    members = [position == i for i in range(_GROUP_COUNT) if (position == i).any()]
    return np.array([np.median(values[chosen]) for chosen in members]), members, None


def _of_finite(values: NDArray[np.float64], function: Any) -> float:  # noqa: ANN401 - of NumPy
    """Return a function of the finite numbers; NaN if there are none."""
    finite = values[np.isfinite(values)]
    return float(function(finite)) if finite.size else np.nan


def _get_explanation(
    drawn: _Curves, panel_parameter: str | None, others: list[str], *, has_shades: bool
) -> str:
    """Return the explanation of panels, lines, shades and gray areas."""
    lines = []
    if panel_parameter:
        lines.append(f"Panels: {humanize(panel_parameter)}")
    if others:
        names = humanize(others[0]) if len(others) == 1 else f"{len(others)} other parameters"
        lines.append(
            f"Lines: median over {names}; shades: range" if has_shades else f"Also varied: {names}"
        )
    if drawn.tolerance:
        minimum, maximum = drawn.tolerance
        lines.append(f"Gray: tolerances of the octaves, ±{minimum:g} to ±{maximum:g} dB")
    return "\n".join(lines)


@own_style()
def draw_design(result: Design) -> Figure:
    """Draw the margin of a design map, dB, its zero as a line, and the samples that conform.

    The margin is positive if all octave levels lie within their limits. For a case with a room the
    figure shows the rating of the room instead, with the required one and, if it is
    that of octaves, the limits of the classes of KS F 2863-2. One parameter is drawn as a curve.
    """
    if len(result.axes) == 1:
        return _draw_design_curve(result)
    dataset = result.dataset
    figure, axes = empty_axes(2.9)
    names: tuple[AxisName, AxisName] = ("x", "y")
    scales = [
        show_parameter(axes, which, dataset[name])
        for which, name in zip(names, result.axes, strict=True)
    ]
    x, y = (dataset[name].values * scale for name, scale in zip(result.axes, scales, strict=True))
    room_rating = result.room_rating
    if room_rating is not None:
        rating = np.ma.masked_invalid(room_rating.transpose(*result.axes).values.T)
        _draw_rating(figure, axes, (x, y), rating, RATINGS[result.rating_name])
        _draw_limits(axes, (x, y), rating, _rating_limits(result))
        axes.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))
        axes.grid(visible=False)
        return figure
    margin = np.ma.masked_invalid(dataset["margin"].transpose(*result.axes).values.T)
    conforms = dataset["conforms"].transpose(*result.axes).values.T
    if margin.count():
        bar = _draw_margin(figure, axes, (x, y), margin)
        bar.set_label(f"Margin ({FORCE_NAMES[dataset.attrs['assessed_force']]}), dB")
    undecided = np.zeros_like(conforms)
    if "undecided" in dataset:
        undecided = dataset["undecided"].transpose(*result.axes).values.T
    marks = {
        "All criteria met": (conforms & ~undecided, "."),
        "Undecided by surrogate": (undecided, "x"),
    }
    # Not every sample of a fine map has a mark.
    row_step, column_step = (-(-count // _MAX_MARKS) for count in conforms.shape)
    for label, (chosen, marker) in marks.items():
        row, column = np.nonzero(chosen[::row_step, ::column_step])
        if row.size:
            axes.plot(
                x[::column_step][column], y[::row_step][row], marker, markersize=2.5,
                markeredgewidth=0.5, color="black", label=label,
            )  # fmt: skip
    if result.mark:
        position = [value * scale for value, scale in zip(result.mark, scales, strict=True)]
        axes.plot(
            *position, "*", markersize=9, markerfacecolor="white", markeredgecolor="black",
            linestyle="none", label=result.mark_name.capitalize(), clip_on=False, zorder=3,
        )  # fmt: skip
    axes.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))
    axes.grid(visible=False)
    if axes.get_legend_handles_labels()[0]:
        legend_above(axes)
    return figure


def _with_symbol(title: str) -> str:
    """Return the title of a rating with its symbol as mathematics."""
    return title.replace("L_iA,Fmax", RATING_SYMBOL)


def _draw_rating(
    figure: Figure,
    axes: Axes,
    position: tuple[Values, Values],
    rating: np.ma.MaskedArray[Any, Any],
    title: str,
) -> None:
    """Draw the rating as colors, with lines at round values."""
    steps = np.asarray(MaxNLocator(8).tick_values(float(rating.min()), float(rating.max())))
    fine = np.linspace(steps[0], steps[-1], 5 * (len(steps) - 1) + 1)
    filled = axes.contourf(*position, rating, levels=fine, cmap="cividis_r")
    inside = steps[(steps > rating.min()) & (steps < rating.max())]
    bar = figure.colorbar(
        filled, ax=axes, ticks=steps, label=f"{_with_symbol(title)},\ndB re 20 µPa"
    )
    if inside.size:
        lines = axes.contour(*position, rating, inside, colors="black", linewidths=0.5)
        bar.add_lines(lines)


def _rating_limits(result: Design) -> list[tuple[str, float]]:
    """Return names of the requirement and, if they apply, of the classes.

    Beside each is the lowest level, dB, that exceeds it when it is rounded.
    """
    limits = [(f"required, {result.required:g} dB", result.required)] if result.required else []
    if result.rating_name == "octaves":
        limits += [
            (f"class {number}, {limit:g} dB", limit)
            for number, limit in enumerate(CLASS_LIMITS, 1)
            if limit != result.required
        ]
    return [(name, excess_level(limit)) for name, limit in limits]


def _draw_limits(
    axes: Axes,
    position: tuple[Values, Values],
    rating: np.ma.MaskedArray[Any, Any],
    limits: list[tuple[str, float]],
) -> None:
    """Draw limits of a rating that are within it as lines, with a legend if there is one."""
    for i, (name, limit) in enumerate(limits):
        # Closer to an end of the ratings the line would be a point in a corner.
        low, high = limit - _MIN_RANGE, limit + _MIN_RANGE
        if rating.count() and rating.min() < low and high < rating.max():
            style: dict[str, Any] = {"color": COLORS[1], "linewidth": 1.4, "linestyle": LINES[i]}
            axes.contour(
                *position, rating, [limit], colors=COLORS[1], linewidths=1.4, linestyles=[LINES[i]]
            )
            axes.plot([], [], label=name, **style)
    if axes.get_legend_handles_labels()[0]:
        legend_above(axes, title="Limits of the rating")


def _draw_design_curve(result: Design) -> Figure:
    """Draw the rating of the room, or the margin of the ball, against one parameter."""
    figure, axes = empty_axes(2.4)
    (name,) = result.axes
    x = result.dataset[name].values * show_parameter(axes, "x", result.dataset[name])
    rating = result.room_rating
    if rating is None:
        values, limits = result.dataset["margin"], [("octave limits", 0.0)]
        axes.set_ylabel(f"Margin ({FORCE_NAMES[result.dataset.attrs['assessed_force']]}), dB")
    else:
        values = rating
        limits = [
            (title, limit)
            for title, limit in _rating_limits(result)
            if float(rating.min()) - 1 < limit < float(rating.max()) + 1
        ]
        axes.set_ylabel(f"{_with_symbol(RATINGS[result.rating_name])},\ndB re 20 µPa")
    axes.plot(x, values.values, **line_style(0), **marker_style(0, 3))
    for i, (title, limit) in enumerate(limits):
        axes.axhline(limit, color=COLORS[1], linewidth=1.4, linestyle=LINES[i], label=title)
    if limits:
        legend_above(axes)
    return figure


def _draw_margin(
    figure: Figure, axes: Axes, position: tuple[Values, Values], margin: np.ma.MaskedArray[Any, Any]
) -> Colorbar:
    """Draw the margin as colors, white at 0, with lines at 0 and at round values."""
    lower, upper = min(float(margin.min()), 0.0), max(float(margin.max()), 0.0)
    # On the smaller side, usually that of conforming samples, colors change up to 4 times faster.
    norm = TwoSlopeNorm(0, min(lower, -upper / 4, -_MIN_RANGE), max(upper, -lower / 4, _MIN_RANGE))
    steps = np.asarray(MaxNLocator(7).tick_values(lower, max(upper, lower + _MIN_RANGE)))
    # Five colors from one line to the next.
    fine = np.linspace(steps[0], steps[-1], 5 * (len(steps) - 1) + 1)
    filled = axes.contourf(*position, margin, levels=fine, cmap="PuOr", norm=norm)
    bar = figure.colorbar(filled, ax=axes, ticks=steps)
    inside = steps[(steps > margin.min()) & (steps < margin.max()) & (steps != 0)]
    if inside.size:
        # Their values are those of the lines in the bar: numbers would lie on the marks.
        lines = axes.contour(
            *position, margin, inside, colors="0.25", linewidths=0.4, linestyles="-"
        )
        bar.add_lines(lines)
    if margin.min() < 0 < margin.max():
        axes.contour(*position, margin, levels=[0.0], colors="black", linewidths=1.2)
        axes.plot([], [], color="black", label="Octave limits")
    return bar


@own_style()
def draw_sensitivity(result: Sensitivity) -> Figure:
    """Draw total Sobol indices of each output as bars, first orders as marks, with intervals.

    Each parameter has a panel.
    """
    indices = result.indices
    parameters = [str(name) for name in indices["parameter"].values]
    outputs = [str(name) for name in indices["output"].values]
    column_count = min(len(parameters), _MAX_COLUMNS)
    row_count = -(-len(parameters) // column_count)
    figure = new_figure(0.4 + row_count * (0.3 + 0.18 * len(outputs)))
    panels = figure.subplots(
        row_count, column_count, sharex=True, sharey=True, squeeze=False
    ).ravel()
    y = np.arange(len(outputs), dtype=float)
    bar: dict[str, Any] = {"color": "black", "linestyle": "none", "elinewidth": 0.7}
    for i, (axes, name) in enumerate(zip(panels, parameters, strict=False)):
        row = indices.sel(parameter=name)
        axes.barh(y, row["total"], 0.8, color=COLORS[5], label="total index")
        axes.errorbar(
            row["total"], y - 0.2, xerr=row["total_interval"], label="95 % interval", **bar
        )
        axes.errorbar(
            row["first_order"], y + 0.2, xerr=row["first_order_interval"], marker="D",
            markersize=2.5, markerfacecolor="white", markeredgewidth=0.6, label="first order",
            **bar,
        )  # fmt: skip
        axes.set_title(humanize(name))
        lowest = i + column_count >= len(parameters)
        axes.tick_params(axis="x", labelbottom=lowest)
    for axes in panels[len(parameters) :]:
        axes.remove()
    first = panels[0]
    first.set_yticks(y, outputs)
    first.set_ylim(len(outputs) - 0.5, -0.5)
    low, high = first.get_xlim()
    first.set_xlim(min(0.0, low), max(1.0, high))
    first.set_xticks([0, 0.5, 1], ["0", "0.5", "1"])
    force = FORCE_NAMES[result.dataset.attrs["assessed_force"]]
    figure.supxlabel(f"Sobol index ({force})")
    legend_above(first)
    return figure


@own_style()
def draw_surrogate(result: Surrogate) -> Figure:
    """Draw the error of each assessed quantity in held-out drops, dB, and the bound.

    The error of a quantity that is not a level is 20 lg of the ratio to the result of the model.
    """
    labels = [
        name for name, assessed in zip(result.labels, result.assessed, strict=True) if assessed
    ]
    residuals = result.residuals[:, result.assessed]
    figure, axes = empty_axes(0.9 + 0.2 * len(labels))
    bound = result.bound
    axes.axvspan(-bound, bound, color="0.85", linewidth=0, label=f"Bound of 95 %, {bound:g} dB")
    position = np.arange(len(labels), dtype=float)
    for i, values in enumerate(residuals.T):
        axes.plot(
            values, np.full(len(values), position[i]), "|", color=COLORS[5], markersize=5,
            markeredgewidth=0.5, label=None if i else f"Each of {len(values)} held-out drops",
        )  # fmt: skip
    axes.errorbar(
        np.zeros(len(labels)), position, xerr=result.errors[result.assessed], fmt="none",
        color="black", elinewidth=0.8, capsize=3, label="95 % of drops",
    )  # fmt: skip
    names = [label.replace("floor ", "").replace("elastic ", "") for label in labels]
    axes.set_yticks(position, [name[0].upper() + name[1:] for name in names])
    axes.set_ylim(len(labels) - 0.5, -0.5)
    axes.set_xlabel("Surrogate − model, dB")
    legend_above(axes)
    return figure


@own_style()
def draw_uncertainty(result: Uncertainty) -> Figure:
    """Draw the distribution of octave levels, and the tolerances of the standards.

    Levels are relative to the nominal ones, dB; bars cover 95 % of the samples.
    """
    lower, upper = octave_limits(result.source)
    nominal = (lower + upper) / 2
    figure, axes = empty_axes(2.8)
    label = f"Tolerance, {result.source.replace('_', ' ')}"
    octave_boxes(axes, lower - nominal, upper - nominal, label)
    levels = result.levels - nominal
    position = np.arange(len(nominal))
    shapes = axes.violinplot(levels, position, widths=0.6, showextrema=False)
    for i, shape in enumerate(cast("list[PolyCollection]", shapes["bodies"])):
        shape.set(
            facecolor=COLORS[5], alpha=1, edgecolor="none", label=None if i else "Distribution"
        )
    low, middle, high = np.quantile(levels, [0.025, 0.5, 0.975], axis=0)
    axes.errorbar(
        position, middle, (middle - low, high - middle), fmt="o", color="black", markersize=2.5,
        elinewidth=0.8, capsize=2, label="Median, 95 % of samples",
    )  # fmt: skip
    octave_axis(axes)
    force = FORCE_NAMES[result.dataset.attrs["assessed_force"]]
    axes.set_ylabel(f"Level − nominal, dB\n({force})")
    low, high = result.interval
    share = f"{100 * result.probability:.1f} % ({100 * low:.1f} to {100 * high:.1f} %)"
    title = f"All criteria met: {share}"
    if result.surrogate_range:
        low, high = result.surrogate_range
        title += f"\nwith errors of the surrogate {100 * low:.1f} to {100 * high:.1f} %"
    legend_above(axes, title=title)
    return figure
