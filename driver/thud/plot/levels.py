"""Octave levels over the tolerance band of the standards (paper, figure 3)."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from thud.impact import Impact, solve
from thud.levels import octave_limits
from thud.plot.examples import solve_published
from thud.plot.look import (
    SIZE,
    add_legend,
    empty_axes,
    iterate_curves,
    line_style,
    marker_style,
    named,
    octave_axis,
    octave_boxes,
)


def levels(
    impacts: Mapping[str, Impact],
    force: str | None = None,
    source: str = "rubber_ball",
    method: str | None = None,
) -> Figure:
    """Draw octave levels over the tolerance band of the standards (paper, figure 3).

    Parameters
    ----------
    impacts
        Impacts by their names in the legend.
    force
        ``"elastic"`` (the paper's ball force), ``"floor"``, or None for both.
    source
        ``"rubber_ball"`` or ``"tyre"``: whose tolerance band is drawn.
    method
        ``"exact"`` or ``"fft"``; by default that of each case.

    Returns
    -------
    Figure
        Octave bands in Hz, force exposure level in dB re 1 N.
    """
    figure, axes = empty_axes(2.8)
    draw_tolerance(axes, source)
    for i, (name, impact, kind) in enumerate(iterate_curves(impacts, force)):
        values = impact.levels(method=method, force=kind)
        axes.plot(np.arange(len(values)), values, label=name, **line_style(i), **marker_style(i))
    octave_axis(axes)
    axes.set_ylabel("Force exposure level, dB re 1 N", fontsize=SIZE)
    add_legend(axes, impacts)
    return figure


def draw_tolerance(axes: Axes, source: str) -> None:
    """Draw the range of each octave as a grey box with its nominal value."""
    lower, upper = octave_limits(source)
    octave_boxes(axes, lower, upper, f"Tolerance, {source.replace('_', ' ')}")
    for place, nominal in enumerate((lower + upper) / 2):
        line = [place - 0.4, place + 0.4]
        label = "Nominal" if place == 0 else None
        axes.plot(line, [nominal, nominal], color="0.45", linewidth=0.8, label=label)


def _draw_models() -> Figure:
    """Draw the model of the paper, its improvement, and the finite elements."""
    impacts = {
        "hollow sphere": solve(),
        "modal ball": solve(model="modal_ball"),
        "finite elements": solve_published(),
    }
    return levels(impacts, "floor")


def _draw_fluxes() -> Figure:
    """Draw the interpretations of the flux term of the paper."""
    choices = ("momentum_balance", "retarding", "conservative", "none")
    return levels({choice: solve(momentum_flux=choice) for choice in choices}, "elastic")


IMPACT_FIGURES = {"levels": lambda impact: levels(named(impact), source=impact.case.limits.source)}
DOCUMENTATION_FIGURES = {
    "figure3_levels": lambda: levels({"hollow sphere": solve()}),
    "finite_element_levels": _draw_models,
    "momentum_flux": _draw_fluxes,
}
