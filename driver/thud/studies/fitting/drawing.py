"""Figures of a fit: target and model with their difference, and confidence regions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullLocator
from scipy import stats

from thud.keys import plain_words
from thud.plot import COLOURS, SIZE, WIDTH, dress, legend_above
from thud.studies.fitting.force_target import ForceMisfit

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from thud.studies.fitting.result import Fit

# More parameters than that are drawn as a table of correlations.
MAX_PANELS = 5
BAND = "0.85"
# Letters of a label along all panels.
LINE = 44
# Names that are too long for the axis or the key.
BROKEN = {"contact time": "contact\ntime", "restitution": "resti-\ntution"}
# Where half of the samples are this part of the largest force off, they show beside the lines.
VISIBLE = 0.003
# Time that is drawn before and after the contact, as part of it.
BEFORE, AFTER = 0.15, 0.4


def target_and_fit(fit: Fit) -> Figure:
    """Draw target and model, and below it their difference over the uncertainty.

    Parameters
    ----------
    fit
        The fit.

    Returns
    -------
    Figure
        Forces in kN against time in ms, or levels in dB.
    """
    figure = Figure(figsize=(WIDTH, 3.6), dpi=300, layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[2.2, 1])
    dress(above)
    dress(below)
    below.axhline(0, color="0.45", linewidth=0.8)
    if isinstance(fit.misfit, ForceMisfit):
        _draw_force(fit, fit.misfit, above, below)
    else:
        _draw_levels(fit, above, below)
    above.tick_params(axis="x", labelbottom=False)
    figure.align_ylabels()
    return figure


def _draw_force(fit: Fit, misfit: ForceMisfit, above: Axes, below: Axes) -> None:
    """Draw record, fit and residual."""
    column = misfit.history_columns(fit.impact, fit.time_shift)
    time = 1e3 * column["time_s"]
    record, target = column["record_N"], column["target_N"]
    limit = f"below {misfit.below / 1e3:.3g} kHz"
    if np.median(np.abs(record - target)) > VISIBLE * target.max():
        above.plot(time, record / 1e3, color="0.6", linewidth=0.5, label="Record")
    above.plot(
        time, target / 1e3, color=COLOURS[0], linewidth=2.2, alpha=0.6, label=f"Record {limit}"
    )
    above.plot(
        time, column["model_N"] / 1e3, color=COLOURS[1], linestyle="--", linewidth=1.1, label="Fit"
    )
    share = np.sqrt(misfit.size / len(time))
    width = 2 * share * fit.noise
    below.axhspan(-width, width, color=BAND, linewidth=0)
    below.plot(time, column["residual_N"], color=COLOURS[6], linewidth=0.7)
    contact = fit.impact.contact_time
    begin, end = fit.time_shift - BEFORE * contact, fit.time_shift + (1 + AFTER) * contact
    below.set_xlim(1e3 * max(begin, misfit.time[0]), 1e3 * min(end, misfit.time[-1]))
    below.set_xlabel("Time, ms", fontsize=SIZE)
    above.set_ylabel(f"{misfit.kind.capitalize()} force, kN", fontsize=SIZE)
    below.set_ylabel("Fit - target, N", fontsize=SIZE)
    most = max(np.abs(column["residual_N"]).max(), width)
    below.set_ylim(-1.1 * most, 1.1 * most)
    # Below, it would cover the curve.
    above.fill_between([], [], color=BAND, linewidth=0, label=rf"Noise {limit}, $\pm2\sigma$")
    legend_above(above, 2, "lower right")


def _draw_levels(fit: Fit, above: Axes, below: Axes) -> None:
    """Draw levels with their uncertainty, and whatever else was compared in the residuals."""
    column = fit.misfit.columns(fit.impact, 0.0)
    names = [str(name).removesuffix(" Hz") for name in column["quantity"]]
    values = {
        name: np.array(column[name], dtype=np.float64)
        for name in ("target", "uncertainty", "model")
    }
    place = np.arange(len(names))
    count = sum(str(name).endswith(" Hz") for name in column["quantity"])
    scale = 1.0 if fit.known_noise else fit.noise
    for i in range(count):
        edge = values["target"][i] + scale * np.array([-1, 1]) * values["uncertainty"][i]
        name = "Target" if i == 0 else None
        band = "Its standard deviation" if i == 0 else None
        above.fill_between([i - 0.35, i + 0.35], *edge, color="0.75", linewidth=0, label=band)
        above.plot(
            [i - 0.35, i + 0.35],
            2 * [values["target"][i]],
            color=COLOURS[0],
            linewidth=1.2,
            label=name,
        )
    above.plot(
        place[:count],
        values["model"][:count],
        color=COLOURS[1],
        marker="o",
        markersize=4,
        linestyle="--",
        linewidth=1,
        label="Fit",
    )
    below.axhspan(-1, 1, color=BAND, linewidth=0)
    below.plot(place, fit.residuals, color=COLOURS[1], marker="o", markersize=4, linestyle="none")
    most = 1.2 * max(1.2, np.abs(fit.residuals).max())
    below.set_ylim(-most, most)
    below.set_xticks(place, [BROKEN.get(name, name) for name in names])
    below.xaxis.set_minor_locator(NullLocator())
    below.set_xlim(-0.6, len(names) - 0.4)
    if count > MAX_PANELS:
        below.tick_params(axis="x", labelrotation=90)
    below.set_xlabel("Band, Hz", fontsize=SIZE)
    above.set_ylabel("Force exposure level, dB", fontsize=SIZE)
    below.set_ylabel("(Fit - target)\n/ uncertainty", fontsize=SIZE)
    above.legend(fontsize=SIZE - 1, frameon=False)


def confidence(fit: Fit, units: Mapping[str, tuple[str, float]]) -> Figure:
    """Draw joint confidence regions of pairs of parameters, or their correlations.

    Parameters
    ----------
    fit
        A fit of two or more parameters.
    units
        Unit of each parameter: name, and how many SI units it is.

    Returns
    -------
    Figure
        One panel for each pair; correlations as a table for more than five parameters.
    """
    count = len(fit.names)
    known = np.isfinite(np.diag(fit.covariance)).all()
    if count > MAX_PANELS or not known:
        return _draw_correlation(fit)
    side = max(2.6, 0.95 * count + 0.6) if count > 2 else 2.6  # noqa: PLR2004 - a single pair
    figure = Figure(figsize=(WIDTH, side), dpi=300, layout="constrained")
    panels = figure.subplots(count - 1, count - 1, sharex="col", sharey="row", squeeze=False)
    for row in range(1, count):
        for column in range(count - 1):
            axes = panels[row - 1, column]
            if column >= row:
                axes.remove()
                continue
            dress(axes)
            _draw_pair(fit, axes, (column, row), units)
    room = LINE / (count - 1)
    for row in range(1, count):
        panels[row - 1, 0].set_ylabel(_label(fit.names[row], units, room), fontsize=SIZE)
    for column in range(count - 1):
        panels[-1, column].set_xlabel(_label(fit.names[column], units, room), fontsize=SIZE)
    figure.align_labels()
    return figure


def _draw_pair(
    fit: Fit, axes: Axes, pair: tuple[int, int], units: Mapping[str, tuple[str, float]]
) -> None:
    """Draw the joint confidence region of two parameters around their values."""
    factor = np.array([units[fit.names[i]][1] for i in pair])
    centre = fit.estimate[list(pair)] / factor
    block = fit.covariance[np.ix_(pair, pair)] / np.outer(factor, factor)
    freedom = fit.degrees_of_freedom
    square = (
        stats.chi2.ppf(fit.confidence, 2)
        if fit.known_noise
        else 2 * stats.f.ppf(fit.confidence, 2, freedom)
    )
    _add_ellipse(axes, centre, square * block)
    axes.plot(*centre, color=COLOURS[1], marker="+", markersize=6)
    intervals = fit.intervals()
    x, y = (
        np.array(intervals[fit.names[i]]) / scale for i, scale in zip(pair, factor, strict=True)
    )
    look: dict[str, Any] = {"color": BAND, "alpha": 0.5, "linewidth": 0, "zorder": 0}
    axes.axvspan(*x, **look)
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
    axes.set_title(f"correlation {share:.{digits}f}", fontsize=SIZE - 1)


def _add_ellipse(axes: Axes, centre: NDArray[np.float64], block: NDArray[np.float64]) -> None:
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
    )


def _draw_correlation(fit: Fit) -> Figure:
    """Draw the correlations of all parameters as a table of colours."""
    figure = Figure(figsize=(WIDTH, WIDTH), dpi=300, layout="constrained")
    axes = figure.add_subplot()
    shown = np.ma.masked_invalid(fit.correlation)
    axes.set_facecolor(BAND)
    axes.imshow(shown, cmap="RdBu_r", vmin=-1, vmax=1)
    names = [name.replace("_", "\n") for name in fit.names]
    axes.set_xticks(range(len(names)), names, fontsize=SIZE - 1, rotation=90)
    axes.set_yticks(range(len(names)), names, fontsize=SIZE - 1)
    for (row, column), value in np.ndenumerate(fit.correlation):
        text = f"{value:.2f}" if np.isfinite(value) else "not\nknown"
        dark = np.isfinite(value) and abs(value) > 0.6  # noqa: PLR2004 - colours
        axes.text(
            column,
            row,
            text,
            ha="center",
            va="center",
            fontsize=SIZE - 1,
            color="white" if dark else "black",
        )
    axes.set_title("Correlation", fontsize=SIZE)
    return figure


def _label(name: str, units: Mapping[str, tuple[str, float]], room: float) -> str:
    """Return a parameter with its unit, on two lines where one has no room for its letters."""
    unit = units[name][0]
    text = plain_words(name).capitalize()
    if not unit:
        return text
    line = f"{text}, {unit}"
    return line if len(line) <= room else f"{text},\n{unit}"
