"""Errors of a surrogate in the drops that it was not trained on."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from thud.plot.style import COLOURS, SIZE, empty_axes, legend_above, own_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from thud.studies.trained_surrogate import Surrogate


@own_style()
def draw_surrogate(result: Surrogate) -> Figure:
    """Draw the error of each judged quantity in held-out drops, dB, and the bound.

    Quantities that are not levels have errors in 20 lg of their ratio.
    """
    labels = [name for name, judged in zip(result.labels, result.judged, strict=True) if judged]
    residuals = result.residuals[:, result.judged]
    figure, axes = empty_axes(0.9 + 0.2 * len(labels))
    bound = result.bound
    axes.axvspan(-bound, bound, color="0.85", linewidth=0, label=f"Bound of 95 %, {bound:g} dB")
    place = np.arange(len(labels), dtype=float)
    for i, values in enumerate(residuals.T):
        axes.plot(
            values, np.full(len(values), place[i]), "|", color=COLOURS[5], markersize=5,
            markeredgewidth=0.5, label=None if i else f"Each of {len(values)} held-out drops",
        )  # fmt: skip
    axes.errorbar(
        np.zeros(len(labels)), place, xerr=result.errors[result.judged], fmt="none", color="black",
        elinewidth=0.8, capsize=3, label="95 % of drops",
    )  # fmt: skip
    words = [label.replace("floor ", "").replace("elastic ", "") for label in labels]
    axes.set_yticks(place, [word[0].upper() + word[1:] for word in words], fontsize=SIZE)
    axes.set_ylim(len(labels) - 0.5, -0.5)
    axes.set_xlabel("Surrogate − model, dB", fontsize=SIZE)
    legend_above(axes)
    return figure
