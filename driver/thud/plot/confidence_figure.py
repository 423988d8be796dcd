"""Joint confidence regions of the parameters of a fit, or their correlations."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.ticker import MaxNLocator

from thud.case.keys import humanize
from thud.plot.style import (
    COLOURS,
    GREY,
    SIZE,
    WIDTH,
    legend_above,
    new_figure,
    own_style,
    style_axes,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from thud.studies.fitting.result import Fit

# More parameters have a table of correlations.
MAX_PARAMETERS = 5
# Characters of a label along all panels.
LINE = 44


@own_style()
def confidence(fit: Fit, units: Mapping[str, tuple[str, float]]) -> Figure:
    """Draw joint confidence regions of two or more parameters, or their correlations.

    There is one panel for each pair; more than five parameters have a table of correlations. Units
    are given by name and size in SI units.
    """
    count = len(fit.names)
    known = np.isfinite(np.diag(fit.covariance)).all()
    if count > MAX_PARAMETERS or not known:
        return _draw_correlation(fit)
    side = max(2.6, 0.95 * count + 0.6) if count > 2 else 2.6  # noqa: PLR2004 - a single pair
    figure = new_figure(side)
    panels = figure.subplots(count - 1, count - 1, sharex="col", sharey="row", squeeze=False)
    for row in range(1, count):
        for column in range(count - 1):
            axes = panels[row - 1, column]
            if column >= row:
                axes.remove()
                continue
            style_axes(axes)
            _draw_pair(fit, axes, (column, row), units)
    letters = LINE / (count - 1)
    for row in range(1, count):
        panels[row - 1, 0].set_ylabel(_label(fit.names[row], units, letters), fontsize=SIZE)
    for column in range(count - 1):
        panels[-1, column].set_xlabel(_label(fit.names[column], units, letters), fontsize=SIZE)
    legend_above(panels[0, 0])
    figure.align_labels()
    return figure


def _draw_pair(
    fit: Fit, axes: Axes, pair: tuple[int, int], units: Mapping[str, tuple[str, float]]
) -> None:
    """Draw the joint confidence region of two parameters around their values."""
    factor = np.array([units[fit.names[i]][1] for i in pair])
    centre = fit.estimate[list(pair)] / factor
    block = fit.covariance[np.ix_(pair, pair)] / np.outer(factor, factor)
    square = _squared_radius(fit)
    _add_ellipse(axes, centre, square * block, f"{100 * fit.confidence:g} % region of both")
    axes.plot(
        *centre, color=COLOURS[1], marker="+", markersize=6, linestyle="none", label="Estimate"
    )
    intervals = fit.intervals()
    x, y = (
        np.array(intervals[fit.names[i]]) / scale for i, scale in zip(pair, factor, strict=True)
    )
    look: dict[str, Any] = {"color": GREY, "alpha": 0.5, "linewidth": 0, "zorder": 0}
    axes.axvspan(*x, label=f"{100 * fit.confidence:g} % interval of each", **look)
    axes.axhspan(*y, **look)
    half = 1.25 * np.sqrt(square * np.diag(block))
    axes.set_xlim(centre[0] - half[0], centre[0] + half[0])
    axes.set_ylim(centre[1] - half[1], centre[1] + half[1])
    ticks = 4 if len(fit.names) == len(pair) else 2
    axes.xaxis.set_major_locator(MaxNLocator(ticks))
    axes.yaxis.set_major_locator(MaxNLocator(ticks + 1))
    axes.ticklabel_format(useOffset=False)
    share = fit.correlation[pair]
    digits = 2 if abs(share) < 0.99 else 4  # noqa: PLR2004 - 1.00 would hide a difference
    axes.set_title(f"Correlation {share:z.{digits}f}".replace("-", "−"), fontsize=SIZE - 1)


def _squared_radius(fit: Fit) -> float:
    """Return the quantile of chi-square with 2 degrees of freedom, or twice that of Fisher's F."""
    logarithm = np.log1p(-fit.confidence)
    if fit.known_noise:
        return float(-2 * logarithm)
    freedom = fit.degrees_of_freedom
    return float(freedom * np.expm1(-2 * logarithm / freedom))


def _add_ellipse(
    axes: Axes, centre: NDArray[np.float64], block: NDArray[np.float64], label: str
) -> None:
    """Draw the ellipse (x - centre) block^-1 (x - centre) = 1."""
    # In units of its deviations an ellipse has its axes on the diagonals: no loss of digits.
    x, y = np.sqrt(np.diag(block))
    angle = np.linspace(0, 2 * np.pi, 181)
    share = block[0, 1] / (x * y)
    axes.fill(
        centre[0] + x * np.cos(angle),
        centre[1] + y * (share * np.cos(angle) + np.sqrt(max(0, 1 - share**2)) * np.sin(angle)),
        facecolor="none",
        edgecolor=COLOURS[0],
        linewidth=1.2,
        label=label,
    )


def _draw_correlation(fit: Fit) -> Figure:
    """Draw the correlations of all parameters as a table of colours."""
    figure = new_figure(WIDTH)
    axes = figure.add_subplot()
    shown = np.ma.masked_invalid(fit.correlation)
    axes.set_facecolor(GREY)
    axes.imshow(shown, cmap="RdBu_r", vmin=-1, vmax=1)
    names = [name.replace("_", "\n") for name in fit.names]
    axes.set_xticks(range(len(names)), names, fontsize=SIZE - 1, rotation=90)
    axes.set_yticks(range(len(names)), names, fontsize=SIZE - 1)
    for (row, column), value in np.ndenumerate(fit.correlation):
        text = f"{value:z.2f}".replace("-", "−") if np.isfinite(value) else "not\nknown"
        dark = np.isfinite(value) and abs(value) > 0.6  # noqa: PLR2004 - colours
        axes.text(
            column, row, text, ha="center", va="center", fontsize=SIZE - 1,
            color="white" if dark else "black",
        )  # fmt: skip
    axes.set_title("Correlation", fontsize=SIZE)
    return figure


def _label(name: str, units: Mapping[str, tuple[str, float]], letters: float) -> str:
    """Return a parameter with its unit, on two lines where it does not fit on one."""
    unit = units[name][0]
    text = humanize(name).capitalize()
    if not unit:
        return text
    line = f"{text}, {unit}"
    return line if len(line) <= letters else f"{text},\n{unit}"
