"""Forces against time (paper, figure 2)."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from thud._schema import Drop
from thud.impact import Impact, solve
from thud.levels import record_force
from thud.plot.examples import solve_published
from thud.plot.look import SIZE, Curve, add_legend, empty_axes, iterate_curves, line_style, named

# Unrecorded part, relative to the maximum force, above which the unfiltered force is drawn too.
UNSEEN = 0.02


def force_history(impacts: Mapping[str, Impact], force: str | None = "elastic") -> Figure:
    """Draw forces against time (paper, figure 2).

    Parameters
    ----------
    impacts
        Impacts by their names in the legend.
    force
        ``"elastic"`` (the paper's ball force), ``"floor"``, or None for both.

    Returns
    -------
    Figure
        Time in ms, force in kN.
    """
    figure, axes = empty_axes(2.5)
    draw_forces(axes, impacts, force)
    add_legend(axes, impacts)
    return figure


def draw_forces(axes: Axes, impacts: Mapping[str, Curve], force: str | None) -> None:
    """Draw forces against time as force plates record them, and unfiltered ones in grey."""
    peak = end = 0.0
    band = ""
    for i, (name, impact, kind) in enumerate(iterate_curves(impacts, force)):
        whole = impact.force(kind)
        time = 1e3 * (impact.time - impact.touch_time)
        recorded = record_force(whole, impact.sample_rate)
        if np.abs(whole - recorded).max() > UNSEEN * whole.max():
            # One entry of the legend for all of them.
            unfiltered = None if band else "unfiltered"
            axes.plot(time, 1e-3 * whole, color="0.75", linewidth=0.4, zorder=1, label=unfiltered)
            shown, band = recorded, " below 1.25 kHz"
        else:
            shown = whole
        axes.plot(time, 1e-3 * shown, label=name, **line_style(i))
        end = max(end, time[np.flatnonzero(whole > 0)[-1]])
        peak = max(peak, whole.max())
    axes.set_xlim(0, 1.15 * end)
    axes.set_ylim(0, 1.05e-3 * peak)
    axes.set_xlabel("Time since first touch, ms", fontsize=SIZE)
    name = force.capitalize() if force else "Blocked"
    axes.set_ylabel(f"{name} force{band}, kN", fontsize=SIZE)


def _draw_heights() -> Figure:
    """Draw the three heights of the paper."""
    return force_history({f"{height:.2f} m": solve(drop=Drop(height)) for height in (0.1, 1, 1.6)})


def _draw_viscosity() -> Figure:
    """Draw the effect of the viscosity of the rubber on the force."""
    impacts = {"viscous": solve_published(), "elastic": solve_published("none")}
    return force_history(impacts, "floor")


IMPACT_FIGURES = {"force": lambda impact: force_history(named(impact), None)}
DOCUMENTATION_FIGURES = {
    "figure2_force_history": _draw_heights,
    "finite_element_force": _draw_viscosity,
}
