"""Figures of what studies tell, as wide as a column of a journal page."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.colors import TwoSlopeNorm
from matplotlib.ticker import MaxNLocator

from thud.keys import plain_words
from thud.levels import octave_limits
from thud.plot import COLOURS, SIZE, empty_axes, legend_above, octave_axis
from thud.studies.axes import show_parameter

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from thud.studies.axes import Which
    from thud.studies.design_map import DesignMap
    from thud.studies.sensitivity import Sensitivity
    from thud.studies.uncertainty import Uncertainty

    Values = NDArray[np.float64]

_TINY = 0.05


def draw_sensitivity(result: Sensitivity) -> Figure:
    """Draw total Sobol indices as bars, first orders as marks on them, both with intervals.

    Parameters
    ----------
    result
        What `sensitivity` gives.

    Returns
    -------
    Figure
        One group of bars for each output.
    """
    indices = result.indices
    parameters = [str(name) for name in indices["parameter"].values]
    outputs = [str(name) for name in indices["output"].values]
    thickness = 0.84 / len(parameters)
    figure, axes = empty_axes(0.9 + 0.075 * len(outputs) * (len(parameters) + 1))
    place = np.arange(len(outputs), dtype=float)
    for i, name in enumerate(parameters):
        row = indices.sel(parameter=name)
        at = place + (i - (len(parameters) - 1) / 2) * thickness
        axes.barh(
            at, row["total"], 0.9 * thickness, color=COLOURS[i % len(COLOURS)],
            hatch="////" if i >= len(COLOURS) else None, label=plain_words(name),
        )  # fmt: skip
        look: dict[str, Any] = {"color": "black", "linestyle": "none", "elinewidth": 0.6}
        axes.errorbar(
            row["total"], at - thickness / 5, xerr=row["total_interval"], marker="|", markersize=3,
            label="total index" if i == len(parameters) - 1 else None, **look,
        )  # fmt: skip
        axes.errorbar(
            row["first_order"], at + thickness / 5, xerr=row["first_order_interval"], marker="D",
            markersize=2, markerfacecolor="white", markeredgewidth=0.5,
            label="first order" if i == len(parameters) - 1 else None, **look,
        )  # fmt: skip
    axes.set_yticks(place, outputs)
    axes.set_ylim(len(outputs) - 0.5, -0.5)
    axes.set_xlim(left=min(0.0, axes.get_xlim()[0]))
    axes.set_xlabel("Sobol index, with its interval of 95 %", fontsize=SIZE)
    legend_above(axes, 3, "lower right")
    return figure


def draw_design_map(result: DesignMap) -> Figure:
    """Draw the margin over two parameters, its zero as a line, and what meets all criteria.

    Parameters
    ----------
    result
        What `design_map` gives.

    Returns
    -------
    Figure
        Margin in dB, positive where all octave levels lie within their limits.
    """
    dataset = result.dataset
    figure, axes = empty_axes(2.9)
    which: tuple[Which, Which] = ("x", "y")
    scales = [
        show_parameter(axes, w, dataset[name]) for w, name in zip(which, result.axes, strict=True)
    ]
    x, y = (dataset[name].values * scale for name, scale in zip(result.axes, scales, strict=True))
    margin = np.ma.masked_invalid(dataset["margin"].transpose(*result.axes).values.T)
    conforms = dataset["conforms"].transpose(*result.axes).values.T
    if margin.count():
        _draw_margin(figure, axes, (x, y), margin)
    row, column = np.nonzero(conforms)
    if row.size:
        axes.plot(x[column], y[row], ".", markersize=2, color="black", label="all criteria met")
    if result.mark:
        place = [value * scale for value, scale in zip(result.mark, scales, strict=True)]
        axes.plot(
            *place, "*", markersize=9, markerfacecolor="white", markeredgecolor="black",
            linestyle="none", label=result.mark_name, clip_on=False, zorder=3,
        )  # fmt: skip
    axes.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))
    axes.grid(visible=False)
    if axes.get_legend_handles_labels()[0]:
        legend_above(axes, 2)
    return figure


def _draw_margin(
    figure: Figure, axes: Axes, place: tuple[Values, Values], margin: np.ma.MaskedArray[Any, Any]
) -> None:
    """Draw the margin as colours, white at 0, with lines at 0 and at round values."""
    least, most = min(float(margin.min()), 0.0), max(float(margin.max()), 0.0)
    # The smaller side, of what conforms most often, has colours that go faster, up to four times.
    norm = TwoSlopeNorm(0, min(least, -most / 4, -_TINY), max(most, -least / 4, _TINY))
    steps = np.asarray(MaxNLocator(7).tick_values(least, max(most, least + _TINY)))
    filled = axes.contourf(*place, margin, levels=_fine(steps), cmap="PuOr", norm=norm)
    inside = steps[(steps > margin.min()) & (steps < margin.max()) & (steps != 0)]
    if inside.size:
        lines = axes.contour(*place, margin, inside, colors="0.25", linewidths=0.4, linestyles="-")
        axes.clabel(lines, fontsize=SIZE - 2, fmt="%g")
    if margin.min() < 0 < margin.max():
        axes.contour(*place, margin, levels=[0.0], colors="black", linewidths=1.2)
        axes.plot([], [], color="black", linewidth=1.2, label="octave limits")
    bar = figure.colorbar(filled, ax=axes, ticks=steps)
    bar.set_label("Margin, dB", fontsize=SIZE)
    bar.ax.tick_params(labelsize=SIZE)


def _fine(steps: Values) -> Values:
    """Return five levels for each of some steps."""
    return np.linspace(steps[0], steps[-1], 5 * (len(steps) - 1) + 1)


def draw_uncertainty(result: Uncertainty) -> Figure:
    """Draw the distribution of each octave level over the tolerances of the standards.

    Parameters
    ----------
    result
        What `uncertainty` gives.

    Returns
    -------
    Figure
        Level over nominal level, dB; bars reach over 95 % of the sets.
    """
    lower, upper = octave_limits(result.source)
    nominal = (lower + upper) / 2
    figure, axes = empty_axes(2.8)
    for i, (low, high) in enumerate(zip(lower - nominal, upper - nominal, strict=True)):
        name = f"tolerance, {result.source.replace('_', ' ')}" if i == 0 else None
        axes.fill_between([i - 0.4, i + 0.4], low, high, color="0.82", linewidth=0, label=name)
    levels = result.levels - nominal
    place = np.arange(len(nominal))
    shapes = axes.violinplot(levels, place, widths=0.6, showextrema=False)
    for shape in shapes["bodies"]:  # type: ignore[attr-defined]
        shape.set(facecolor=COLOURS[0], alpha=0.8, edgecolor="none")
    low, middle, high = np.quantile(levels, [0.025, 0.5, 0.975], axis=0)
    axes.errorbar(
        place, middle, (middle - low, high - middle), fmt="o", color="black", markersize=2.5,
        elinewidth=0.8, capsize=2, label="median, 95 % of sets",
    )  # fmt: skip
    octave_axis(axes)
    axes.set_ylabel("Level - nominal, dB", fontsize=SIZE)
    least, most = result.interval
    legend = legend_above(axes, 2)
    share = f"{100 * result.probability:.1f} % ({100 * least:.1f} to {100 * most:.1f} %)"
    legend.set_title(f"Conforms: {share}")
    legend.get_title().set_fontsize(SIZE)
    return figure
