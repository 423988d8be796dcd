"""Figures of a fit: target and model with their difference, and confidence regions."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

import numpy as np
from matplotlib.ticker import MaxNLocator, NullLocator, ScalarFormatter

from thud.case.keys import humanize
from thud.plot.style import (
    BAND_NAMES,
    COLORS,
    FORCE_NAMES,
    GRAY,
    curve_style,
    figure_of,
    finish,
    legend_above,
    level_label,
    new_figure,
    own_panels,
    own_style,
    tolerance_boxes,
)
from thud.studies.fitting.compression_target import CompressionComparison
from thud.studies.fitting.fit_report import file_ends
from thud.studies.fitting.force_target import SHIFT, ForceComparison

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from thud.impact.impact import Impact
    from thud.studies.fitting.fit_result import Fit, FittedTarget
    from thud.studies.fitting.level_target import LevelComparison


# Maximum number of bands whose names are not rotated.
MAX_UPRIGHT = 5
# Line breaks in names that are too long for the axis.
WRAPPED_NAMES = {"contact time": "contact\ntime", "restitution": "resti-\ntution"}
# Median difference, relative to the maximum force, above which the unfiltered record is drawn too.
MIN_DIFFERENCE = 0.003
# Drawn time before and after the contact, as fractions of the contact time.
BEFORE, AFTER = 0.15, 0.4


@own_style()
def draw_fit(fit: Fit) -> dict[str, Figure]:
    """Draw ``"fit"``, or ``"fit_1"`` and so on, and ``"confidence"`` of two to five parameters.

    Parameters that are not identifiable have no regions.
    """
    figures = {
        f"fit{end}": target_and_fit(fit, number=number)
        for number, end in enumerate(file_ends(len(fit.targets)), start=1)
    }
    if 1 < len(fit.names) <= MAX_PARAMETERS and np.isfinite(np.diag(fit.covariance)).all():
        figures["confidence"] = confidence(fit)
    return figures


@own_style()
def target_and_fit(fit: Fit, ax: Axes | None = None, number: int = 1) -> Figure:
    """Draw a target and the model, in kN against ms or in dB, and below it their difference."""
    target = fit.targets[number - 1]
    above, *below = own_panels(ax, 3.6, 2, sharex=True, height_ratios=[2.2, 1])
    for axes in below:
        axes.axhline(0, color="0.45", linewidth=0.8)
    draw = {ForceComparison: _draw_force, CompressionComparison: _draw_press}.get(
        type(target.comparison), _draw_levels
    )
    draw(target, fit.deviation_of(target), above, below)
    figure_of(above).align_ylabels()
    return finish(above, ax)


def _draw_force(fitted: FittedTarget, deviation: float, above: Axes, below: list[Axes]) -> None:
    """Draw record, fit with its background, and residual."""
    comparison, impact = cast("ForceComparison", fitted.comparison), cast("Impact", fitted.result)
    column = comparison.columns(impact, fitted.own)
    time = 1e3 * column["time_s"]
    record, target = column["record_N"], column["target_N"]
    band = f"below {comparison.below / 1e3:.3g} kHz"
    if np.median(np.abs(record - target)) > MIN_DIFFERENCE * target.max():
        above.plot(time, record / 1e3, color="0.6", linewidth=0.5, label="Record")
    above.plot(
        time, target / 1e3, color=COLORS[5], linewidth=2.8, alpha=0.6, label=f"Record {band}"
    )
    fit = column["model_N"] + column["background_N"]
    above.plot(time, fit / 1e3, color=COLORS[1], linestyle="--", linewidth=1.1, label="Fit")
    contact, touch = impact.contact_time, comparison.own_value(SHIFT, fitted.own)
    begin, end = touch - BEFORE * contact, touch + (1 + AFTER) * contact
    above.set_xlim(
        1e3 * max(begin, comparison.record.time[0]), 1e3 * min(end, comparison.record.time[-1])
    )
    above.set_ylabel(f"{FORCE_NAMES[comparison.kind].capitalize()}, kN")
    [above, *below][-1].set_xlabel("Time, ms")
    width = 2 * comparison.band_fraction * deviation
    limit = 1.1 * max(np.abs(column["residual_N"]).max(), width)
    for axes in below:
        axes.axhspan(-width, width, color=GRAY, linewidth=0)
        axes.plot(time, column["residual_N"], color=COLORS[6], linewidth=0.7)
        axes.set_ylabel("Fit − target, N")
        axes.set_ylim(-limit, limit)
        # A label in the lower panel would cover the curve.
        above.fill_between([], [], color=GRAY, linewidth=0, label=f"Noise {band}, ±2σ")


def _draw_press(fitted: FittedTarget, deviation: float, above: Axes, below: list[Axes]) -> None:
    """Draw the curve of a press, that of the model with what the press adds, and the residual."""
    column = {name: np.asarray(values) for name, values in fitted.columns().items()}
    deflection = 1e3 * column["deflection_m"]
    above.plot(deflection, column["force_N"], label="Measured", **curve_style(0, 1))
    fit = column["model_N"] + column["effects_N"]
    above.plot(deflection, fit, color=COLORS[1], linestyle="--", linewidth=1.1, label="Fit")
    above.set_ylabel("Force, N")
    [above, *below][-1].set_xlabel("Deflection, mm")
    for axes in below:
        axes.axhspan(-2 * deviation, 2 * deviation, color=GRAY, linewidth=0)
        axes.plot(deflection, column["residual_N"], color=COLORS[6], linewidth=0.7)
        axes.set_ylabel("Fit − target, N")
        above.fill_between([], [], color=GRAY, linewidth=0, label="Noise, ±2σ")


def _draw_levels(fitted: FittedTarget, scale: float, above: Axes, below: list[Axes]) -> None:
    """Draw levels with their uncertainty times a scale, and the residuals of all quantities."""
    comparison, impact = cast("LevelComparison", fitted.comparison), cast("Impact", fitted.result)
    column = comparison.columns(impact, fitted.own)
    residuals = comparison.residual(impact, fitted.own) / scale
    names = [str(name).removesuffix(" Hz") for name in column["quantity"]]
    x = np.arange(len(names))
    count = sum(str(name).endswith(" Hz") for name in column["quantity"])
    target, uncertainty, model = (
        np.array(column[name][:count], dtype=np.float64)
        for name in ("target", "uncertainty", "model")
    )
    half = scale * uncertainty
    label = "Standard deviation of the target"
    tolerance_boxes(above, target - half, target + half, label, "Target")
    above.plot(x[:count], model, label="Fit", **curve_style(1, 4))
    above.set_ylabel(level_label(FORCE_NAMES[impact.assessed_force(comparison.force)]))
    lowest = [above, *below][-1]
    lowest.set_xticks(x, [WRAPPED_NAMES.get(name, name) for name in names], fontsize="small")
    lowest.xaxis.set_minor_locator(NullLocator())
    lowest.set_xlim(-0.6, len(names) - 0.4)
    if count > MAX_UPRIGHT:
        lowest.tick_params(axis="x", labelrotation=90)
    lowest.set_xlabel(f"{BAND_NAMES[comparison.bands]}, Hz")
    limit = 1.2 * max(1.2, np.abs(residuals).max())
    for axes in below:
        axes.axhspan(-1, 1, color=GRAY, linewidth=0)
        axes.plot(x, residuals, **curve_style(1, 4) | {"linestyle": "none"})
        axes.set_ylim(-limit, limit)
        axes.set_ylabel("(Fit − target)\n/ uncertainty")


# Maximum number of parameters with confidence regions.
MAX_PARAMETERS = 5
# Ratio of the half axis of a region to its center below which ticks have an offset.
MIN_RATIO = 1e-3
# Maximum number of characters of a label as wide as all panels.
MAX_CHARACTERS = 44


@own_style()
def confidence(fit: Fit) -> Figure:
    """Draw joint confidence regions of two to five parameters: one panel for each pair."""
    count = len(fit.names)
    side = max(2.6, 0.95 * count + 0.6) if count > 2 else 2.6  # noqa: PLR2004 - a single pair
    figure = new_figure(side)
    panels = figure.subplots(count - 1, count - 1, sharex="col", sharey="row", squeeze=False)
    for row in range(1, count):
        for column in range(count - 1):
            axes = panels[row - 1, column]
            if column >= row:
                axes.remove()
                continue
            _draw_pair(fit, axes, (column, row))
    letters = MAX_CHARACTERS / (count - 1)
    labels = [_label(name, unit, letters) for name, (unit, _) in fit.display_units.items()]
    for row in range(1, count):
        panels[row - 1, 0].set_ylabel(labels[row])
    for column in range(count - 1):
        panels[-1, column].set_xlabel(labels[column])
    legend_above(panels[0, 0])
    figure.align_labels()
    return figure


def _draw_pair(fit: Fit, axes: Axes, pair: tuple[int, int]) -> None:
    """Draw the joint confidence region of two parameters around their values."""
    factor = np.array([fit.display_units[fit.names[i]][1] for i in pair])
    center = fit.estimate[list(pair)] / factor
    block = fit.covariance[np.ix_(pair, pair)] / np.outer(factor, factor)
    # Twice the quantile of F where the intervals use Student's t, else of chi-square.
    logarithm, freedom = np.log1p(-fit.confidence), fit.interval_freedom
    square = -2 * logarithm
    if freedom is not None:
        square = freedom * np.expm1(-2 * logarithm / freedom)
    # An ellipse that is scaled by its deviations has diagonal axes: no loss of digits.
    (x, y), angle = np.sqrt(square * np.diag(block)), np.linspace(0, 2 * np.pi, 181)
    correlation = square * block[0, 1] / (x * y)
    height = correlation * np.cos(angle) + np.sqrt(max(0, 1 - correlation**2)) * np.sin(angle)
    axes.fill(
        center[0] + x * np.cos(angle), center[1] + y * height, facecolor="none",
        edgecolor=COLORS[0], linewidth=1.2, label=f"{100 * fit.confidence:g} % region of both",
    )  # fmt: skip
    axes.plot(
        *center, color=COLORS[1], marker="+", markersize=6, linestyle="none", label="Estimate"
    )
    intervals = fit.intervals()
    x, y = (
        np.array(intervals[fit.names[i]]) / scale for i, scale in zip(pair, factor, strict=True)
    )
    interval = f"{100 * fit.confidence:g} % interval of each"
    axes.axvspan(*x, color=GRAY, linewidth=0, zorder=0, label=interval)
    axes.axhspan(*y, color=GRAY, linewidth=0, zorder=0)
    half = 1.25 * np.sqrt(square * np.diag(block))
    axes.set_xlim(center[0] - half[0], center[0] + half[0])
    axes.set_ylim(center[1] - half[1], center[1] + half[1])
    ticks = 4 if len(fit.names) == len(pair) else 2
    axes.xaxis.set_major_locator(MaxNLocator(ticks))
    axes.yaxis.set_major_locator(MaxNLocator(ticks + 1))
    for axis, middle, length in zip((axes.xaxis, axes.yaxis), center, half, strict=True):
        # Numbers of many digits would leave no room for the panels.
        formatter = ScalarFormatter(useOffset=bool(length < MIN_RATIO * abs(middle)))
        axis.set_major_formatter(formatter)
    correlation = fit.correlation[pair]
    digits = 2 if abs(correlation) < 0.99 else 4  # noqa: PLR2004 - 1.00 would hide a difference
    axes.set_title(f"Correlation {correlation:z.{digits}f}".replace("-", "−"))


def _label(name: str, unit: str, letters: float) -> str:
    """Return a parameter with its unit, on two lines if it does not fit on one."""
    text = humanize(name).capitalize()
    if not unit:
        return text
    line = f"{text}, {unit}"
    return line if len(line) <= letters else f"{text},\n{unit}"
