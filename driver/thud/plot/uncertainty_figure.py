"""Distribution of the octave levels over the tolerances of the standards."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

import numpy as np

from thud.level.assessment import octave_limits
from thud.plot.style import (
    COLOURS,
    FORCE_WORDS,
    SIZE,
    empty_axes,
    legend_above,
    octave_axis,
    octave_boxes,
    own_style,
)

if TYPE_CHECKING:
    from matplotlib.collections import PolyCollection
    from matplotlib.figure import Figure

    from thud.studies.uncertainty import Uncertainty


@own_style()
def draw_uncertainty(result: Uncertainty) -> Figure:
    """Draw the distribution of octave levels over the tolerances of the standards.

    Levels are relative to the nominal ones, dB; bars cover 95 % of the sets.
    """
    lower, upper = octave_limits(result.source)
    nominal = (lower + upper) / 2
    figure, axes = empty_axes(2.8)
    label = f"Tolerance, {result.source.replace('_', ' ')}"
    octave_boxes(axes, lower - nominal, upper - nominal, label)
    levels = result.levels - nominal
    place = np.arange(len(nominal))
    shapes = axes.violinplot(levels, place, widths=0.6, showextrema=False)
    for i, shape in enumerate(cast("list[PolyCollection]", shapes["bodies"])):
        shape.set(
            facecolor=COLOURS[5], alpha=1, edgecolor="none", label=None if i else "Distribution"
        )
    low, middle, high = np.quantile(levels, [0.025, 0.5, 0.975], axis=0)
    axes.errorbar(
        place, middle, (middle - low, high - middle), fmt="o", color="black", markersize=2.5,
        elinewidth=0.8, capsize=2, label="Median, 95 % of sets",
    )  # fmt: skip
    octave_axis(axes)
    words = FORCE_WORDS[result.dataset.attrs["assessed_force"]]
    axes.set_ylabel(f"Level − nominal, dB\n({words})", fontsize=SIZE)
    low, high = result.interval
    share = f"{100 * result.probability:.1f} % ({100 * low:.1f} to {100 * high:.1f} %)"
    title = f"All criteria met: {share}"
    if result.surrogate_range:
        low, high = result.surrogate_range
        title += f"\nby errors of the surrogate {100 * low:.1f} to {100 * high:.1f} %"
    legend_above(axes, title)
    return figure
