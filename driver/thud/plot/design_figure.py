"""The margin to the limits of the standards over two parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.colors import TwoSlopeNorm
from matplotlib.ticker import MaxNLocator, StrMethodFormatter

from thud.impact.quantities import RATING
from thud.plot.parameter_axis import show_parameter
from thud.plot.style import FORCE_WORDS, SIZE, empty_axes, legend_above, own_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colorbar import Colorbar
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from thud.plot.parameter_axis import Which
    from thud.studies.design import Design

    Values = NDArray[np.float64]

_TINY = 0.05


@own_style()
def draw_design(result: Design) -> Figure:
    """Draw the margin of a design map, dB, its zero as a line, and the samples that conform.

    The margin is positive where all octave levels lie within their limits. Of a case with a room
    draw the rating of the standardised levels there.
    """
    dataset = result.dataset
    figure, axes = empty_axes(2.9)
    which: tuple[Which, Which] = ("x", "y")
    scales = [
        show_parameter(axes, w, dataset[name]) for w, name in zip(which, result.axes, strict=True)
    ]
    x, y = (dataset[name].values * scale for name, scale in zip(result.axes, scales, strict=True))
    if RATING in dataset:
        rating = np.ma.masked_invalid(dataset[RATING].transpose(*result.axes).values.T)
        _draw_rating(figure, axes, (x, y), rating)
        axes.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))
        axes.grid(visible=False)
        return figure
    margin = np.ma.masked_invalid(dataset["margin"].transpose(*result.axes).values.T)
    conforms = dataset["conforms"].transpose(*result.axes).values.T
    if margin.count():
        bar = _draw_margin(figure, axes, (x, y), margin)
        bar.set_label(f"Margin ({FORCE_WORDS[dataset.attrs['assessed_force']]}), dB", fontsize=SIZE)
    doubtful = np.zeros_like(conforms)
    if "doubtful" in dataset:
        doubtful = dataset["doubtful"].transpose(*result.axes).values.T
    marks = {
        "All criteria met": (conforms & ~doubtful, "."),
        "In doubt by surrogate": (doubtful, "x"),
    }
    for label, (chosen, marker) in marks.items():
        row, column = np.nonzero(chosen)
        if row.size:
            axes.plot(
                x[column], y[row], marker, markersize=2, markeredgewidth=0.5, color="black",
                label=label,
            )  # fmt: skip
    if result.mark:
        place = [value * scale for value, scale in zip(result.mark, scales, strict=True)]
        axes.plot(
            *place, "*", markersize=9, markerfacecolor="white", markeredgecolor="black",
            linestyle="none", label=result.mark_name.capitalize(), clip_on=False, zorder=3,
        )  # fmt: skip
    axes.set(xlim=(x[0], x[-1]), ylim=(y[0], y[-1]))
    axes.grid(visible=False)
    if axes.get_legend_handles_labels()[0]:
        legend_above(axes)
    return figure


def _draw_rating(
    figure: Figure, axes: Axes, place: tuple[Values, Values], rating: np.ma.MaskedArray[Any, Any]
) -> None:
    """Draw the rating as colours, with lines at round values."""
    steps = np.asarray(MaxNLocator(8).tick_values(float(rating.min()), float(rating.max())))
    fine = np.linspace(steps[0], steps[-1], 5 * (len(steps) - 1) + 1)
    filled = axes.contourf(*place, rating, levels=fine, cmap="cividis_r")
    inside = steps[(steps > rating.min()) & (steps < rating.max())]
    if inside.size:
        lines = axes.contour(*place, rating, inside, colors="black", linewidths=0.5)
        axes.clabel(lines, fontsize=SIZE - 2, fmt=StrMethodFormatter("{x:g}"))
    bar = figure.colorbar(filled, ax=axes, ticks=steps)
    bar.ax.tick_params(labelsize=SIZE)
    bar.set_label("Standardised L_iA,Fmax, dB re 20 µPa", fontsize=SIZE)


def _draw_margin(
    figure: Figure, axes: Axes, place: tuple[Values, Values], margin: np.ma.MaskedArray[Any, Any]
) -> Colorbar:
    """Draw the margin as colours, white at 0, with lines at 0 and at round values."""
    lower, upper = min(float(margin.min()), 0.0), max(float(margin.max()), 0.0)
    # The colours of the smaller side, usually of what conforms, change up to four times faster.
    norm = TwoSlopeNorm(0, min(lower, -upper / 4, -_TINY), max(upper, -lower / 4, _TINY))
    steps = np.asarray(MaxNLocator(7).tick_values(lower, max(upper, lower + _TINY)))
    # Five colours from one line to the next.
    fine = np.linspace(steps[0], steps[-1], 5 * (len(steps) - 1) + 1)
    filled = axes.contourf(*place, margin, levels=fine, cmap="PuOr", norm=norm)
    inside = steps[(steps > margin.min()) & (steps < margin.max()) & (steps != 0)]
    if inside.size:
        lines = axes.contour(*place, margin, inside, colors="0.25", linewidths=0.4, linestyles="-")
        axes.clabel(lines, fontsize=SIZE - 2, fmt=StrMethodFormatter("{x:g}"))
    if margin.min() < 0 < margin.max():
        axes.contour(*place, margin, levels=[0.0], colors="black", linewidths=1.2)
        axes.plot([], [], color="black", linewidth=1.2, label="Octave limits")
    bar = figure.colorbar(filled, ax=axes, ticks=steps)
    bar.ax.tick_params(labelsize=SIZE)
    return bar
