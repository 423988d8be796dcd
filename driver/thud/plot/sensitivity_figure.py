"""Sobol indices of parameters, with their intervals."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from thud.case.keys import humanize
from thud.plot.style import COLOURS, FORCE_WORDS, HATCHES, SIZE, empty_axes, legend_above, own_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from thud.studies.sensitivity import Sensitivity


@own_style()
def draw_sensitivity(result: Sensitivity) -> Figure:
    """Draw total Sobol indices as bars, first orders as marks on them, both with intervals.

    There is one group of bars for each output.
    """
    indices = result.indices
    parameters = [str(name) for name in indices["parameter"].values]
    outputs = [str(name) for name in indices["output"].values]
    thickness = 0.84 / len(parameters)
    figure, axes = empty_axes(0.8 + 0.075 * len(outputs) * (len(parameters) + 1))
    place = np.arange(len(outputs), dtype=float)
    for i, name in enumerate(parameters):
        row = indices.sel(parameter=name)
        at = place + (i - (len(parameters) - 1) / 2) * thickness
        axes.barh(
            at, row["total"], 0.9 * thickness, color=COLOURS[i % len(COLOURS)],
            hatch=HATCHES[i % len(HATCHES)], edgecolor="white", linewidth=0,
            label=humanize(name),
        )  # fmt: skip
        look: dict[str, Any] = {"color": "black", "linestyle": "none", "elinewidth": 0.6}
        axes.errorbar(
            row["total"], at - thickness / 5, xerr=row["total_interval"], marker="|", markersize=3,
            label="total index" if i == len(parameters) - 1 else None, **look,
        )  # fmt: skip
        axes.errorbar(
            row["first_order"], at + thickness / 5, xerr=row["first_order_interval"], marker="D",
            markersize=2, markerfacecolor="white", markeredgewidth=0.5,
            label="first order" if i == len(parameters) - 1 else None, **look,
        )  # fmt: skip
    axes.set_yticks(place, outputs)
    axes.set_ylim(len(outputs) - 0.5, -0.5)
    axes.set_xlim(left=min(0.0, axes.get_xlim()[0]))
    words = FORCE_WORDS[result.dataset.attrs["assessed_force"]]
    axes.set_xlabel(f"Sobol index, with its interval of 95 %\n({words})", fontsize=SIZE)
    legend_above(axes)
    return figure
