"""Base of what the stages of a measurement return."""

from __future__ import annotations

from typing import TYPE_CHECKING

from thud.base.immutable import Immutable

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Stage(Immutable):
    """What a stage of a measurement returns: its arrays are read-only, and it can be drawn."""

    def plot(self) -> Figure:
        """Draw what the stage has measured or changed."""
        from thud.plot.stage_figures import draw_stage

        return draw_stage(self)
