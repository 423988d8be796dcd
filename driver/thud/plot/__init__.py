"""Figures by theme: impacts, ball, floors, rooms, recordings, fits, studies, pages.

`case_figures` draws the figures of a case.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from thud.base.checks import refuse

try:
    import matplotlib.figure  # noqa: F401 - to report a damaged matplotlibrc
except ValueError as error:
    refuse(
        f"matplotlib cannot be imported ({error})",
        "a matplotlibrc in UTF-8, and MPLBACKEND the name of a backend or not set",
        error,
    )

from thud.base._schema import JoistFloor, LaminateFloor, ModalFloor, Plate
from thud.base.display import draw_all, warn_if_not_drawn
from thud.plot.ball_figures import (
    animate as animate,
    compression as compression,
    mode_shapes as mode_shapes,
    motion as motion,
)
from thud.plot.floor_figures import ball_impedances as ball_impedances, plate_modes as plate_modes
from thud.plot.impact_figures import force_history as force_history, levels as levels
from thud.plot.pages import floor_steps as floor_steps
from thud.plot.recording_figures import (
    recording_forces as recording_forces,
    recording_levels as recording_levels,
)
from thud.plot.room_figures import draw_positions
from thud.plot.save_figures import FORMATS as FORMATS, figure_files as figure_files, save as save
from thud.plot.style import (
    COLORS as COLORS,
    LINES as LINES,
    MARKERS as MARKERS,
    WIDTH as WIDTH,
    add_curves as add_curves,
    add_levels as add_levels,
    band_axis as band_axis,
    empty_axes as empty_axes,
    legend_above as legend_above,
    named,
    own_style as own_style,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure

    from thud.impact.compression import CompressionCurve
    from thud.impact.free_modes import FreeModes
    from thud.impact.impact import Impact

# Maximum number of figures that a run draws by default.
DEFAULT_COUNT = 3


def case_figures(
    impact: Impact | None = None,
    modes: FreeModes | None = None,
    curve: CompressionCurve | None = None,
    count: int | None = None,
) -> dict[str, Figure]:
    """Draw the figures of a case: impact, floor, room below, free modes, quasi-static compression.

    Parameters
    ----------
    impact, modes, curve
        Results of the case.
    count
        Number of figures, the most informative first; by default all.

    Returns
    -------
    dict of str to Figure
        Figures by the names of their files; a warning replaces a figure that cannot be drawn.
    """
    draws: dict[str, Callable[[], Figure | None]] = {}
    if impact:
        draws["force"] = partial(force_history, named(impact))
        draws["levels"] = partial(levels, named(impact))
    if impact and impact.case.room:
        # SciPy is slow to import.
        from thud.floors.prediction import predict_level

        with warn_if_not_drawn("the level in the room"):
            prediction = predict_level(impact)
            draws["room"] = prediction.plot
            draws["room_positions"] = partial(draw_positions, prediction)
    if impact and impact.on_floor:
        draws["floor"] = impact.on_floor.plot
    if modes:
        draws["modes"] = modes.plot
    if curve:
        draws["compression"] = curve.plot
    if impact and isinstance(impact.case.floor, Plate | LaminateFloor | JoistFloor | ModalFloor):
        draws["floor_modes"] = partial(plate_modes, impact.case.floor)
    for name, drop in (("motion", impact), ("floor_motion", impact and impact.on_floor)):
        if drop and drop.motion:
            draws[name] = partial(motion, drop)
    return draw_all(dict([*draws.items()][:count]))
