"""Change of octave levels against a reference."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from thud.base._schema import LevelsForce, ModalBall
from thud.impact.impact import Impact
from thud.impact.solve import solve
from thud.plot.style import (
    SIZE,
    empty_axes,
    escape_label,
    iterate_curves,
    legend_above,
    level_label,
    line_style,
    marker_style,
    octave_axis,
    own_style,
)


@own_style()
def level_changes(
    reference: Impact, impacts: Mapping[str, Impact], force: LevelsForce | None = None
) -> Figure:
    """Draw how octave levels change against a reference.

    Parameters
    ----------
    reference
        The impact that the others are compared with.
    impacts
        Impacts by their names in the legend.
    force
        ``"floor"`` or ``"elastic"``; by default that of each case.

    Returns
    -------
    Figure
        Octave bands in Hz, change of the force exposure level in dB.
    """
    figure, axes = empty_axes(2.8)
    axes.axhline(0, color="0.45", linewidth=0.8)
    for i, (name, impact, kind) in enumerate(iterate_curves(impacts, force)):
        change = impact.levels(force=kind) - reference.levels(force=kind)
        axes.plot(
            np.arange(len(change)),
            change,
            label=escape_label(name),
            **line_style(i),
            **marker_style(i),
        )
    octave_axis(axes)
    axes.set_ylabel(level_label(impacts, force, "Change of the level, dB"), fontsize=SIZE)
    legend_above(axes)
    return figure


def _draw_families() -> Figure:
    """Draw which modes carry which octave: families that answer statically, one at a time."""
    static = {f"n = {n} static": [n] for n in range(2, 7)}
    static["all static"] = list(range(ModalBall.harmonics + 1))
    impacts = {
        name: solve(model="modal_ball", static_families=families)
        for name, families in static.items()
    }
    return level_changes(solve(model="modal_ball"), impacts)


DOCUMENTATION_FIGURES = {"modal_families": _draw_families}
