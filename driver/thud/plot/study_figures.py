"""Figures of studies: design map, sensitivity, surrogate, uncertainty."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

import numpy as np
from matplotlib.colors import TwoSlopeNorm
from matplotlib.ticker import MaxNLocator

from thud.base._schema import CLASS_LIMITS, RATINGS
from thud.case.keys import humanize
from thud.level.assessment import octave_limits
from thud.level.rating import excess_level
from thud.plot.style import (
    COLORS,
    ERROR_BARS,
    FORCE_NAMES,
    LINES,
    RATING_SYMBOL,
    band_axis,
    curve_style,
    figure_of,
    finish,
    own_or,
    own_style,
    panel_grid,
    tolerance_boxes,
)
from thud.plot.sweep_figures import MIN_RANGE, show_parameter

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import PolyCollection
    from matplotlib.colorbar import Colorbar
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from thud.studies.design import Design
    from thud.studies.sensitivity import Sensitivity
    from thud.studies.trained_surrogate import Surrogate
    from thud.studies.uncertainty import Uncertainty


# Maximum number of panels side by side.
_MAX_COLUMNS = 3
# Maximum number of marks of samples along an axis.
_MAX_MARKS = 21
# Distance of a limit beyond the ratings, dB, up to which a curve of ratings shows it.
_NEAR = 1.0


@own_style()
def draw_design(result: Design, ax: Axes | None = None) -> Figure:
    """Draw the margin of a design map, dB, its zero as a line, and the samples that conform.

    The margin is positive if all octave levels lie within their limits. For a case with a room the
    figure shows the rating of the room instead, with the required one and, if it is
    that of octaves, the limits of the classes of KS F 2863-2. One parameter is drawn as a curve.
    """
    axes = own_or(ax, 2.4 if len(result.axes) == 1 else 2.9)
    rating = result.room_rating
    values = result.dataset["margin"] if rating is None else rating
    label = f"Margin ({FORCE_NAMES[result.dataset.attrs['assessed_force']]}), dB"
    if rating is not None:
        symbol = RATINGS[result.room.rating].replace("L_iA,Fmax", RATING_SYMBOL)
        label = f"{symbol},\ndB re 20 µPa"
    if len(result.axes) == 1:
        (name,) = result.axes
        x = values[name].values * show_parameter(axes, "x", values[name])
        axes.set_ylabel(label)
        axes.plot(x, values.values, **curve_style(0, 3))
        low, high = float(values.min()) - _NEAR, float(values.max()) + _NEAR
        for i, (title, limit) in enumerate(_limits(result)):
            if rating is None or low < limit < high:
                axes.axhline(limit, color=COLORS[1], linestyle=LINES[i], label=title)
    else:
        _draw_map(axes, result, np.ma.masked_invalid(values.transpose(*result.axes)), label)
    title = "Limits of the octaves" if rating is None else "Limits of the rating"
    return finish(axes, ax, title)


def _limits(result: Design) -> list[tuple[str, float]]:
    """Return names of limits: of the margin, or the requirement and the classes of the rating.

    Beside each is its value, dB; of a rating, the lowest level that exceeds it when it is rounded.
    """
    if result.room_rating is None:
        return [("Octave limits", 0.0)]
    limits = (
        [(f"required, {result.room.required:g} dB", result.room.required)]
        if result.room.required
        else []
    )
    if result.room.rating == "octaves":
        limits += [
            (f"class {number}, {limit:g} dB", limit)
            for number, limit in enumerate(CLASS_LIMITS, 1)
            if limit != result.room.required
        ]
    return [(name, excess_level(limit)) for name, limit in limits]


def _draw_map(axes: Axes, result: Design, values: np.ma.MaskedArray[Any, Any], label: str) -> None:
    """Draw values, shape (n_x, n_y), as colors with lines at round ones, and the limits."""
    is_margin = result.room_rating is None
    factors = [
        show_parameter(axes, "x", result.dataset[result.axes[0]]),
        show_parameter(axes, "y", result.dataset[result.axes[1]]),
    ]
    x, y = (result.dataset[n].values * f for n, f in zip(result.axes, factors, strict=True))
    if values.count():
        _draw_colors(axes, (x, y), values.T, is_margin=is_margin).set_label(label)
        _draw_limits(axes, (x, y), values.T, _limits(result), COLORS[6 if is_margin else 1])
    if is_margin:
        _mark_samples(axes, (x, y), result)
    if is_margin and result.mark:
        axes.plot(
            *np.multiply(result.mark, factors), "*", markersize=9, markerfacecolor="white",
            markeredgecolor="black", label="Case", clip_on=False, zorder=3,
        )  # fmt: skip
    axes.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))
    axes.grid(visible=False)


def _draw_colors(
    axes: Axes,
    position: tuple[NDArray[np.float64], NDArray[np.float64]],
    values: np.ma.MaskedArray[Any, Any],
    *,
    is_margin: bool,
) -> Colorbar:
    """Draw values as colors, a margin of 0 white and with lines at round values."""
    low, high = float(values.min()), float(values.max())
    style: dict[str, Any] = {"cmap": "cividis_r"}
    if is_margin:
        low, high = min(low, 0.0), max(high, 0.0)
        # On the smaller side, usually that of conforming samples, colors change up to 4 times
        # faster.
        norm = TwoSlopeNorm(0, min(low, -high / 4, -MIN_RANGE), max(high, -low / 4, MIN_RANGE))
        style = {"cmap": "PuOr", "norm": norm}
    steps = np.asarray(MaxNLocator(7).tick_values(low, max(high, low + MIN_RANGE)))
    # Five colors from one line to the next.
    fine = np.linspace(steps[0], steps[-1], 5 * (len(steps) - 1) + 1)
    filled = axes.contourf(*position, values, levels=fine, **style)
    bar = figure_of(axes).colorbar(filled, ax=axes, ticks=steps)
    inside = steps[(steps > values.min()) & (steps < values.max()) & (steps != 0)]
    if is_margin and inside.size:
        # Their values are those of the lines in the bar: numbers would lie on the marks.
        lines = axes.contour(
            *position, values, inside, colors="0.25", linewidths=0.4, linestyles="-"
        )
        bar.add_lines(lines)
    return bar


def _draw_limits(
    axes: Axes,
    position: tuple[NDArray[np.float64], NDArray[np.float64]],
    values: np.ma.MaskedArray[Any, Any],
    limits: list[tuple[str, float]],
    color: str,
) -> None:
    """Draw limits that are within the values as lines."""
    for i, (name, limit) in enumerate(limits):
        # Closer to an end of the values the line would be a point in a corner.
        if values.min() < limit - MIN_RANGE and limit + MIN_RANGE < values.max():
            lines = axes.contour(
                *position, values, [limit], colors=color, linewidths=1.3, linestyles=[LINES[i]]
            )
            if limit:
                # Ratings are rounded before they are compared: 45.5 dB is the end of 45 dB.
                axes.clabel(lines, fmt=lambda level: f"{int(level)} dB", fontsize="small")
            axes.plot([], [], label=name, color=color, linewidth=1.3, linestyle=LINES[i])


def _mark_samples(
    axes: Axes, position: tuple[NDArray[np.float64], NDArray[np.float64]], result: Design
) -> None:
    """Mark the samples that conform, and those of which a surrogate leaves it undecided."""
    conforms = result.dataset["conforms"].transpose(*result.axes).values
    undecided = np.zeros_like(conforms)
    if "undecided" in result.dataset:
        undecided = result.dataset["undecided"].transpose(*result.axes).values
    # Not every sample of a fine map has a mark.
    coarse = tuple(slice(None, None, -(-count // _MAX_MARKS)) for count in conforms.shape)
    marks = {
        "All criteria met": (conforms & ~undecided, "."),
        "Undecided by surrogate": (undecided, "x"),
    }
    for label, (chosen, marker) in marks.items():
        indices = np.nonzero(chosen[coarse])
        if indices[0].size:
            x, y = (p[s][i] for p, s, i in zip(position, coarse, indices, strict=True))
            axes.plot(x, y, marker, markersize=2.5, markeredgewidth=0.5, color="black", label=label)


@own_style()
def draw_sensitivity(result: Sensitivity, ax: Axes | None = None) -> Figure:
    """Draw total Sobol indices of each output as bars, first orders as marks, with intervals.

    Each parameter has a panel; axes of a user show the first.
    """
    indices = result.indices
    parameters = [str(name) for name in indices["parameter"].values]
    outputs = [str(name) for name in indices["output"].values]
    columns = min(len(parameters), _MAX_COLUMNS)
    height = 0.3 + 0.18 * len(outputs)
    figure, panels = panel_grid(len(parameters), columns, height, shared=True, ax=ax)
    y = np.arange(len(outputs), dtype=float)
    bar: dict[str, Any] = {"color": "black", "linestyle": "none", "elinewidth": 0.7}
    for axes, name in zip(panels, parameters, strict=ax is None):
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
    first = panels[0]
    first.set_yticks(y, outputs)
    first.set_ylim(len(outputs) - 0.5, -0.5)
    low, high = first.get_xlim()
    first.set_xlim(min(0.0, low), max(1.0, high))
    first.set_xticks([0, 0.5, 1], ["0", "0.5", "1"])
    force = FORCE_NAMES[result.dataset.attrs["assessed_force"]]
    (ax.set_xlabel if ax is not None else figure.supxlabel)(f"Sobol index ({force})")
    return finish(first, ax)


@own_style()
def draw_surrogate(result: Surrogate, ax: Axes | None = None) -> Figure:
    """Draw the error of each assessed quantity in held-out drops, dB.

    The error of a quantity that is not a level is 20 lg of the ratio to the result of the model.
    """
    labels = [
        name for name, assessed in zip(result.labels, result.assessed, strict=True) if assessed
    ]
    residuals = result.residuals[:, result.assessed]
    axes = own_or(ax, 0.9 + 0.2 * len(labels))
    position = np.arange(len(labels), dtype=float)
    for i, values in enumerate(residuals.T):
        axes.plot(
            values, np.full(len(values), position[i]), "|", color=COLORS[5], markersize=5,
            markeredgewidth=0.5, label=None if i else f"Each of {len(values)} held-out drops",
        )  # fmt: skip
    axes.errorbar(
        np.zeros(len(labels)), position, xerr=result.errors[result.assessed],
        label="95 % of drops", **ERROR_BARS | {"color": "black", "marker": ""},
    )  # fmt: skip
    names = [label.replace("floor ", "").replace("elastic ", "") for label in labels]
    axes.set_yticks(position, [name[0].upper() + name[1:] for name in names])
    axes.set_ylim(len(labels) - 0.5, -0.5)
    axes.locator_params(axis="x", nbins=5)
    axes.set_xlabel("Surrogate − model, dB")
    return finish(axes, ax)


@own_style()
def draw_uncertainty(result: Uncertainty, ax: Axes | None = None) -> Figure:
    """Draw the distribution of octave levels, and the tolerances of the standards.

    Levels are relative to the nominal ones, dB; bars cover 95 % of the samples.
    """
    lower, upper = octave_limits(result.source)
    nominal = (lower + upper) / 2
    axes = own_or(ax, 2.8)
    label = f"Tolerance, {result.source.replace('_', ' ')}"
    tolerance_boxes(axes, lower - nominal, upper - nominal, label)
    levels = result.levels - nominal
    position = np.arange(len(nominal))
    shapes = axes.violinplot(levels, position, widths=0.6, showextrema=False)
    for i, shape in enumerate(cast("list[PolyCollection]", shapes["bodies"])):
        shape.set(
            facecolor=COLORS[5], alpha=1, edgecolor="none", label=None if i else "Distribution"
        )
    low, middle, high = np.quantile(levels, [0.025, 0.5, 0.975], axis=0)
    axes.errorbar(
        position, middle, (middle - low, high - middle), label="Median, 95 % of samples",
        **ERROR_BARS | {"color": "black"},
    )  # fmt: skip
    band_axis(axes)
    force = FORCE_NAMES[result.dataset.attrs["assessed_force"]]
    axes.set_ylabel(f"Level − nominal, dB\n({force})")
    low, high = result.interval
    share = f"{100 * result.probability:.1f} % ({100 * low:.1f} to {100 * high:.1f} %)"
    title = f"All criteria met: {share}"
    if result.surrogate_range:
        low, high = result.surrogate_range
        title += f"\nwith errors of the surrogate {100 * low:.1f} to {100 * high:.1f} %"
    return finish(axes, ax, title)
