"""A measured mobility, and the passive sum of poles that was fitted to it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from thud.plot.style import COLOURS, SIZE, legend_above, new_figure, own_style, style_axes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from thud.floors.mobility_fit import MobilityFit


@own_style()
def mobility_fit(found: MobilityFit) -> Figure:
    """Draw magnitude and phase of measurement and fit against frequency."""
    figure = new_figure(3.6)
    upper, lower = (style_axes(axes) for axes in figure.subplots(2, sharex=True))
    lines = np.geomspace(found.frequency[0], found.frequency[-1], 2000)
    fitted = found.mobility(lines)
    upper.loglog(
        found.frequency, abs(found.measured), ".", color="0.55", markersize=2.5, label="measured"
    )
    upper.loglog(
        lines, abs(fitted), color=COLOURS[0], linewidth=1.2,
        label=f"fitted: relative error {100 * found.error:.2g} %",
    )  # fmt: skip
    lower.semilogx(
        found.frequency, np.degrees(np.angle(found.measured)), ".", color="0.55", markersize=2.5
    )
    lower.semilogx(lines, np.degrees(np.angle(fitted)), color=COLOURS[0], linewidth=1.2)
    upper.set_ylabel("Mobility, m/(N s)", fontsize=SIZE)
    lower.set_ylabel("Phase, degrees", fontsize=SIZE)
    lower.set_yticks([-90, 0, 90])
    lower.set_xlabel("Frequency, Hz", fontsize=SIZE)
    legend_above(upper)
    return figure
