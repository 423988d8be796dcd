"""Figures of a fit: target and model with their difference, and confidence regions."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

import numpy as np
from matplotlib.ticker import NullLocator

from thud.plot.confidence_figure import confidence
from thud.plot.style import (
    BAND_WORDS,
    COLOURS,
    FORCE_WORDS,
    GREY,
    LEVEL,
    SIZE,
    legend_above,
    new_figure,
    own_style,
    style_axes,
)
from thud.studies.fitting.misfit import SHIFT

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from thud.studies.fitting.force_misfit import ForceMisfit
    from thud.studies.fitting.level_target import LevelMisfit
    from thud.studies.fitting.result import Fit, FittedTarget

# More names of bands are rotated.
MAX_UPRIGHT = 5
# Names that are too long for the axis.
BROKEN = {"contact time": "contact\ntime", "restitution": "resti-\ntution"}
# Median difference, relative to the maximum force, above which the unfiltered record is drawn too.
VISIBLE = 0.003
# Time that is drawn before and after the contact, as fraction of it.
BEFORE, AFTER = 0.15, 0.4


@own_style()
def draw_fit(fit: Fit, units: Mapping[str, tuple[str, float]]) -> dict[str, Figure]:
    """Draw a fit: ``"fit"``, or ``"fit_1"`` and so on, and of several parameters ``"confidence"``.

    Units are given by name and size in SI units.
    """
    figures = {
        f"fit{end}": target_and_fit(fit, number) for number, end in enumerate(fit.ends, start=1)
    }
    if len(fit.names) > 1:
        figures["confidence"] = confidence(fit, units)
    return figures


@own_style()
def target_and_fit(fit: Fit, number: int = 1) -> Figure:
    """Draw a target and the model, in kN against ms or in dB, and below it their difference."""
    target = fit.targets[number - 1]
    deviation = fit.deviation_of(target)
    figure = new_figure(3.6)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=[2.2, 1])
    style_axes(above)
    style_axes(below)
    below.axhline(0, color="0.45", linewidth=0.8)
    if target.misfit.deviation_unit == "N":
        _draw_force(target, deviation, above, below)
    else:
        _draw_levels(target, deviation, above, below)
    above.tick_params(axis="x", labelbottom=False)
    figure.align_ylabels()
    return figure


def _draw_force(fitted: FittedTarget, deviation: float, above: Axes, below: Axes) -> None:
    """Draw record, fit with its background, and residual."""
    misfit = cast("ForceMisfit", fitted.misfit)
    column = misfit.columns(fitted.impact, fitted.own)
    time = 1e3 * column["time_s"]
    record, target = column["record_N"], column["target_N"]
    band = f"below {misfit.below / 1e3:.3g} kHz"
    if np.median(np.abs(record - target)) > VISIBLE * target.max():
        above.plot(time, record / 1e3, color="0.6", linewidth=0.5, label="Record")
    above.plot(
        time, target / 1e3, color=COLOURS[5], linewidth=2.8, alpha=0.6, label=f"Record {band}"
    )
    fit = column["model_N"] + column["background_N"]
    above.plot(time, fit / 1e3, color=COLOURS[1], linestyle="--", linewidth=1.1, label="Fit")
    width = 2 * misfit.band_share * deviation
    below.axhspan(-width, width, color=GREY, linewidth=0)
    below.plot(time, column["residual_N"], color=COLOURS[6], linewidth=0.7)
    contact, touch = fitted.impact.contact_time, fitted.own_value(SHIFT, 0.0)
    begin, end = touch - BEFORE * contact, touch + (1 + AFTER) * contact
    below.set_xlim(1e3 * max(begin, misfit.time[0]), 1e3 * min(end, misfit.time[-1]))
    below.set_xlabel("Time, ms", fontsize=SIZE)
    above.set_ylabel(f"{FORCE_WORDS[misfit.kind].capitalize()}, kN", fontsize=SIZE)
    below.set_ylabel("Fit − target, N", fontsize=SIZE)
    limit = 1.1 * max(np.abs(column["residual_N"]).max(), width)
    below.set_ylim(-limit, limit)
    # Below, it would cover the curve.
    above.fill_between([], [], color=GREY, linewidth=0, label=f"Noise {band}, ±2σ")
    legend_above(above)


def _draw_levels(fitted: FittedTarget, scale: float, above: Axes, below: Axes) -> None:
    """Draw levels with their uncertainty times a scale, and the residuals of all quantities."""
    misfit = cast("LevelMisfit", fitted.misfit)
    column = misfit.columns(fitted.impact, fitted.own)
    residuals = misfit.residual(fitted.impact, fitted.own) / scale
    names = [str(name).removesuffix(" Hz") for name in column["quantity"]]
    values = {
        name: np.array(column[name], dtype=np.float64)
        for name in ("target", "uncertainty", "model")
    }
    place = np.arange(len(names))
    count = sum(str(name).endswith(" Hz") for name in column["quantity"])
    for i in range(count):
        edge = values["target"][i] + scale * np.array([-1, 1]) * values["uncertainty"][i]
        name = "Target" if i == 0 else None
        band = "Standard deviation of the target" if i == 0 else None
        above.fill_between([i - 0.35, i + 0.35], *edge, color="0.75", linewidth=0, label=band)
        above.plot(
            [i - 0.35, i + 0.35], 2 * [values["target"][i]], color=COLOURS[0], linewidth=1.2,
            label=name,
        )  # fmt: skip
    above.plot(
        place[:count], values["model"][:count], color=COLOURS[1], linestyle="--", linewidth=1,
        marker="o", markersize=4, label="Fit",
    )  # fmt: skip
    below.axhspan(-1, 1, color=GREY, linewidth=0)
    below.plot(place, residuals, color=COLOURS[1], marker="o", markersize=4, linestyle="none")
    limit = 1.2 * max(1.2, np.abs(residuals).max())
    below.set_ylim(-limit, limit)
    below.set_xticks(place, [BROKEN.get(name, name) for name in names], fontsize=SIZE - 1)
    below.xaxis.set_minor_locator(NullLocator())
    below.set_xlim(-0.6, len(names) - 0.4)
    if count > MAX_UPRIGHT:
        below.tick_params(axis="x", labelrotation=90)
    below.set_xlabel(f"{BAND_WORDS[misfit.bands]}, Hz", fontsize=SIZE)
    above.set_ylabel(
        f"{LEVEL}\n({FORCE_WORDS[fitted.impact.assessed_force(misfit.kind)]})", fontsize=SIZE
    )
    below.set_ylabel("(Fit − target)\n/ uncertainty", fontsize=SIZE)
    legend_above(above)
