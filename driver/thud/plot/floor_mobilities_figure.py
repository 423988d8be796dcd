"""Mobilities of floors under the source."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from thud.base._schema import FloatingFloor, FloorOptions, JoistFloor, Plate
from thud.base.checks import refuse_value, require_kind
from thud.impact.mobility import mobility
from thud.plot.style import SIZE, add_curves, empty_axes, legend_above, own_style

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure

# Octaves 16 to 1000 Hz.
_FROM, _TO = 11.0, 1400.0


@own_style()
def floor_mobilities(floors: Mapping[str, FloorOptions]) -> Figure:
    """Draw the magnitudes of the mobilities of floors, by name, against frequency."""
    if not floors:
        refuse_value("floors", floors, "a mapping of names to floors")
    for name, floor in floors.items():
        require_kind(name, floor, FloorOptions)
    figure, axes = empty_axes(3.0)
    frequency = np.geomspace(_FROM, _TO, 1500)
    add_curves(
        axes,
        {name: (frequency, np.abs(mobility(floor, frequency))) for name, floor in floors.items()},
    )
    axes.set_xscale("log")
    axes.set_yscale("log")
    marks = [16, 31.5, 63, 125, 250, 500, 1000]
    axes.set_xticks(marks, [f"{mark:g}" for mark in marks])
    axes.minorticks_off()
    axes.set_xlabel("Frequency, Hz", fontsize=SIZE)
    axes.set_ylabel("Mobility, m/(N s)", fontsize=SIZE)
    legend_above(axes)
    return figure


def _draw_floors() -> Figure:
    """Draw floors of the folder inputs/floors."""
    concrete = Plate(source_x=0.4, source_y=0.35)
    timber = replace(concrete, edges="absorption")
    return floor_mobilities(
        {
            "180 mm of concrete": concrete,
            "screed on a soft layer on it": FloatingFloor(
                layer_stiffness=8e6, layer_loss_factor=0.15, screed_loss_factor=0.02,
                source_x=0.4, source_y=0.35,
            ),
            "200 mm of cross-laminated timber": replace(
                timber, thickness=0.2, density=470, wave_speed=3180, stiffness_ratio=0.293,
                torsion_ratio=0.25, loss_factor=0.03,
            ),
            "timber joists, between two": JoistFloor(
                sheathing_modulus=3.1e9, source_x=0.4, source_y=0.35
            ),
            "22 mm of chipboard": replace(
                timber, length=2.4, width=1.8, thickness=0.022, density=650, wave_speed=2200,
                loss_factor=0.02,
            ),
        }
    )  # fmt: skip


DOCUMENTATION_FIGURES = {"floor_mobilities": _draw_floors}
