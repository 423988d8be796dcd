"""Forces against time (paper, figure 2)."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from thud.base._schema import Drop, LevelsForce
from thud.impact.impact import Impact
from thud.impact.solve import solve
from thud.level.levels import record_force
from thud.plot.documentation_impacts import solve_published
from thud.plot.style import (
    SIZE,
    Curve,
    empty_axes,
    escape_label,
    force_words,
    iterate_curves,
    legend_above,
    line_style,
    named,
    own_style,
)

# Fraction of the maximum force that a contact exceeds.
NOISE = 0.01
# Time that is drawn before and after the contact, as fraction of it.
MARGIN = 0.04
TIME_LABEL = "Time since first touch, ms"


@own_style()
def force_history(impacts: Mapping[str, Impact], force: LevelsForce | None = None) -> Figure:
    """Draw forces against time, below 1.25 kHz as force plates record them (paper, figure 2).

    Parameters
    ----------
    impacts
        Impacts by their names in the legend.
    force
        ``"floor"`` or ``"elastic"`` (the paper's ball force); by default that of each case.

    Returns
    -------
    Figure
        Time from first touch to last release in ms, force in kN.
    """
    figure, axes = empty_axes(2.6)
    draw_forces(axes, impacts, force)
    legend_above(axes)
    return figure


def draw_forces(axes: Axes, impacts: Mapping[str, Curve], force: LevelsForce | None) -> None:
    """Draw forces against time."""
    for i, (name, impact, kind) in enumerate(iterate_curves(impacts, force)):
        axes.plot(*contact_force(impact, kind), label=escape_label(name), **line_style(i))
    axes.margins(x=0)
    axes.set_xlabel(TIME_LABEL, fontsize=SIZE)
    axes.set_ylabel(force_label(impacts, force), fontsize=SIZE)


def contact_force(
    impact: Curve, kind: LevelsForce
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return time since first touch, ms, and force below 1.25 kHz, kN, while there is contact.

    Force plates record no more (paper, section 3); above it, meshes and modes ring.
    """
    time = impact.time - impact.touch_time
    recorded = record_force(impact.force(kind), impact.sample_rate)
    end = time[recorded > NOISE * recorded.max()][-1]
    shown = (time >= -MARGIN * end) & (time <= (1 + MARGIN) * end)
    return 1e3 * time[shown], 1e-3 * recorded[shown]


def force_label(impacts: Mapping[str, Curve], force: LevelsForce | None) -> str:
    """Return the label of an axis of forces."""
    return f"{force_words(impacts, force).capitalize()}\nbelow 1.25 kHz, kN"


def _draw_heights() -> Figure:
    """Draw the three heights of the paper."""
    impacts = {f"{height:.2f} m": solve(drop=Drop(height)) for height in (0.1, 1, 1.6)}
    return force_history(impacts, "elastic")


def _draw_viscosity() -> Figure:
    """Draw the effect of the viscosity of the rubber on the force."""
    return force_history({"viscous": solve_published(), "elastic": solve_published("none")})


IMPACT_FIGURES = {"force": lambda impact: force_history(named(impact))}
DOCUMENTATION_FIGURES = {
    "figure2_force_history": _draw_heights,
    "finite_element_force": _draw_viscosity,
}
