"""Figures, each in a file of its own.

A file holds the function that draws its figure, as wide as a column of a journal page, and declares
its use: ``thud-driver run`` adds ``IMPACT_FIGURES``, ``ROOM_FIGURES``, ``MODES_FIGURES`` and
``COMPRESSION_FIGURES`` to the results of a case, ``thud-driver figures`` draws
``DOCUMENTATION_FIGURES``.
"""

import importlib
import pkgutil
from collections.abc import Callable
from functools import partial
from typing import Any

from thud.base.checks import refuse

try:
    from matplotlib.figure import Figure
except ValueError as error:
    refuse(
        f"matplotlib cannot be imported ({error})",
        "a matplotlibrc in UTF-8, and MPLBACKEND the name of a backend or not set",
        error,
    )

from thud.base.display import draw_all, left_out
from thud.floors.prediction import predict_level
from thud.impact.compression import CompressionCurve
from thud.impact.free_modes import FreeModes
from thud.impact.impact import Impact
from thud.plot.comparison_page import comparison_page as comparison_page
from thud.plot.compression_figure import compression as compression
from thud.plot.design_figure import draw_design as draw_design
from thud.plot.fit_figure import draw_fit as draw_fit, target_and_fit as target_and_fit
from thud.plot.floor_figure import draw_floor as draw_floor
from thud.plot.floor_mobilities_figure import floor_mobilities as floor_mobilities
from thud.plot.force_history_figure import force_history as force_history
from thud.plot.impedance_figure import ball_impedances as ball_impedances
from thud.plot.level_changes_figure import level_changes as level_changes
from thud.plot.levels_figure import levels as levels
from thud.plot.loss_factor_figure import loss_factor as loss_factor
from thud.plot.mobility_fit_figure import mobility_fit as mobility_fit
from thud.plot.modes_figure import mode_shapes as mode_shapes
from thud.plot.motion_figure import animate as animate, motion as motion
from thud.plot.plate_modes_figure import plate_modes as plate_modes
from thud.plot.prediction_figure import draw_decay as draw_decay, draw_prediction as draw_prediction
from thud.plot.recording_figure import (
    recording_forces as recording_forces,
    recording_levels as recording_levels,
)
from thud.plot.room_figure import room_levels as room_levels
from thud.plot.sensitivity_figure import draw_sensitivity as draw_sensitivity
from thud.plot.style import (
    COLOURS as COLOURS,
    FORMATS as FORMATS,
    LINES as LINES,
    MARKERS as MARKERS,
    SIZE as SIZE,
    WIDTH as WIDTH,
    add_curves as add_curves,
    empty_axes as empty_axes,
    legend_above as legend_above,
    octave_axis as octave_axis,
    picture_files as picture_files,
    save as save,
    save_all as save_all,
    style_axes as style_axes,
)
from thud.plot.surrogate_figure import draw_surrogate as draw_surrogate
from thud.plot.sweep_figure import draw_sweep as draw_sweep
from thud.plot.uncertainty_figure import draw_uncertainty as draw_uncertainty


def case_figures(
    impact: Impact | None = None,
    modes: FreeModes | None = None,
    curve: CompressionCurve | None = None,
) -> dict[str, Figure]:
    """Draw the figures of a case: of its impact, the level below, free modes, slow compression.

    Return the figures by the names of their files, without those that have nothing to show or, with
    a warning, cannot be drawn.
    """
    prediction = None
    if impact and impact.case.room:
        with left_out("the level in the room"):
            prediction = predict_level(impact)
    given = {
        "IMPACT_FIGURES": impact,
        "ROOM_FIGURES": prediction,
        "MODES_FIGURES": modes,
        "COMPRESSION_FIGURES": curve,
    }
    return draw_all(
        {
            name: partial(draw, results)
            for kind, results in given.items()
            if results
            for name, draw in _declared(kind).items()
        }
    )


def documentation_figures() -> dict[str, Callable[[], Figure]]:
    """Return functions that compute and draw the figures of the documentation, by name."""
    return _declared("DOCUMENTATION_FIGURES")


def _declared(kind: str) -> dict[str, Callable[..., Any]]:
    """Return the figures that the files of this package declare under a name."""
    found = pkgutil.iter_modules(__path__, f"{__name__}.")
    modules = [importlib.import_module(file.name) for file in found]
    return {name: draw for module in modules for name, draw in getattr(module, kind, {}).items()}
