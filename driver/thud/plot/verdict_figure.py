"""Figure of a verdict: where the criteria lie in their ranges."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from thud.base._schema import VERDICTS
from thud.plot.style import COLORS, ERROR_BARS, GRAY, finish, own_or, own_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from thud.level.assessment import Verdict

# Colors of the verdicts: green, vermilion, orange.
_COLORS = dict(zip(VERDICTS, (COLORS[2], COLORS[1], COLORS[4]), strict=True))
# Distance beyond the limits that is drawn, in ranges; farther values stand at the edge.
_BEYOND = 1.0


@own_style()
def draw_verdict(verdict: Verdict, ax: Axes | None = None) -> Figure:
    """Draw values with their uncertainties, or ranges over what is not known, between the limits.

    Values are drawn as fractions of the range of each criterion, and those beyond the axis at its
    edge; unknown values and criteria without a range are omitted.
    """
    axes = own_or(ax, 3.2)
    shown = [c for c in verdict.criteria if c.upper > c.lower and math.isfinite(c.value)]
    axes.axvspan(0, 1, color=GRAY, linewidth=0)
    for row, criterion in enumerate(shown):
        length, unsure = criterion.upper - criterion.lower, criterion.estimate.expanded
        ends = criterion.range or (criterion.value - unsure, criterion.value + unsure)
        at, low, high = (
            min(max((value - criterion.lower) / length, -_BEYOND), 1 + _BEYOND)
            for value in (criterion.value, *ends)
        )
        errors = [[max(at - low, 0.0)], [max(high - at, 0.0)]]
        axes.errorbar(at, row, xerr=errors, **ERROR_BARS | {"color": _COLORS[criterion.conforms]})
    axes.set_yticks(range(len(shown)), [criterion.quantity.label for criterion in shown])
    axes.set_ylim(len(shown) - 0.5, -0.5)
    axes.set_xlim(-_BEYOND - 0.1, 1.1 + _BEYOND)
    axes.set_xticks([0, 1], ["lower\nlimit", "upper\nlimit"])
    return finish(axes, ax)
