"""thud: the force that heavy/soft impact sources put into floors.

>>> import thud
>>> impact = thud.solve(thud.Ball(), thud.Drop(height=1.0))
>>> round(1000 * impact.contact_time, 2)
20.43
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from thud.base.bridge import version
from thud.base.schema import *  # noqa: F403 - the groups and models that the library declares
from thud.base.schema import __all__ as _groups
from thud.case.case import Case, read_case, write_case
from thud.base.checks import suggestion
from thud.impact.compression import CompressionCurve, compress
from thud.level.criteria import Conformity, Criterion
from thud.base.display import MAKERS
from thud.impact.ensemble import solve_many
from thud.base.errors import (
    FitWarning,
    InputError,
    LockWarning,
    NumericalError,
    PlausibilityWarning,
    ThudError,
    WorkerWarning,
)
from thud.base.extras import require_extra
from thud.impact.floor_impact import FloorEnergy, FloorImpact, new_floor_impact
from thud.impact.mobility import mobility
from thud.impact.free_modes import FreeModes, free_modes, loss_factors
from thud.impact.impact import Impact, solve_case
from thud.level.levels import Bands, force_exposure_levels, get_bands, judge
from thud.impact.motion import Motion
from thud.impact.outcomes import Ensemble
from thud.impact.results import read_results
from thud.studies import kinds

if TYPE_CHECKING:
    from collections.abc import Callable

    # For type checkers, the calls of `solve` by model and what is imported at first use.
    from thud.comparison import comparison
    from thud import plot as plot
    from thud._solve import solve as solve
    from thud.comparison.comparison import Comparison as Comparison
    from thud.comparison.comparison import compare as compare
    from thud.comparison.comparison import read_all as read_all
    from thud.studies.compression_fit import CompressionFit as CompressionFit
    from thud.studies.compression_fit import fit_compression as fit_compression
    from thud.floors.floor_comparison import FloorComparison as FloorComparison
    from thud.floors.floor_comparison import compare_floors as compare_floors
    from thud.floors.impedance import BallImpedance as BallImpedance
    from thud.floors.impedance import ball_impedance as ball_impedance
    from thud.floors.mobility_fit import MobilityFit as MobilityFit
    from thud.floors.mobility_fit import fit_mobility as fit_mobility
    from thud.floors.modal_room import ModalRoom as ModalRoom
    from thud.floors.modal_room import modal_room as modal_room
    from thud.floors.prediction import RoomPrediction as RoomPrediction
    from thud.floors.prediction import predict_level as predict_level
    from thud.floors.rating import Rating as Rating
    from thud.floors.rating import rating as rating
    from thud.floors.rating import standardised_level as standardised_level
    from thud.floors.survey import RoomLevels as RoomLevels
    from thud.floors.survey import read_room_levels as read_room_levels
    from thud.floors.tapping import TappingLevel as TappingLevel
    from thud.floors.tapping import tapping_level as tapping_level
    from thud.recordings.read_recording import read_recording as read_recording
    from thud.recordings.recording import Recording as Recording
    from thud.studies.blocks import read_sweep as read_sweep
    from thud.studies.design_map import DesignMap as DesignMap
    from thud.studies.design_map import design_map as design_map
    from thud.studies.emulation.surrogate import Surrogate as Surrogate
    from thud.studies.emulation.surrogate import read_surrogate as read_surrogate
    from thud.studies.fit import fit as fit
    from thud.studies.fitting.force_target import ForceTarget as ForceTarget
    from thud.studies.fitting.level_target import LevelTarget as LevelTarget
    from thud.studies.fitting.result import Fit as Fit
    from thud.studies.kinds import read_study as read_study
    from thud.studies.parameter import Parameter as Parameter
    from thud.studies.sensitivity import Sensitivity as Sensitivity
    from thud.studies.sensitivity import sensitivity as sensitivity
    from thud.studies.study import Study as Study
    from thud.studies.surrogate import surrogate as surrogate
    from thud.studies.sweep import sweep as sweep
    from thud.studies.uncertainty import Uncertainty as Uncertainty
    from thud.studies.uncertainty import uncertainty as uncertainty
    from thud.base.units import quantity as quantity
else:
    from thud.impact.impact import solve

__version__ = version()

# What is imported at first use, by its module; modules themselves have none.
_LATE = {
    "plot": "",
    "BallImpedance": "floors.impedance",
    "ball_impedance": "floors.impedance",
    "comparison": "",
    "Comparison": "comparison",
    "compare": "comparison",
    "compare_floors": "floors.floor_comparison",
    "CompressionFit": "compression_fit",
    "fit_compression": "compression_fit",
    "fit_mobility": "floors.mobility_fit",
    "read_all": "comparison",
    "FloorComparison": "floors.floor_comparison",
    "ModalRoom": "floors.modal_room",
    "MobilityFit": "floors.mobility_fit",
    "Rating": "floors.rating",
    "Recording": "recordings.recording",
    "RoomLevels": "floors.survey",
    "RoomPrediction": "floors.prediction",
    "TappingLevel": "floors.tapping",
    "modal_room": "floors.modal_room",
    "predict_level": "floors.prediction",
    "quantity": "units",
    "rating": "floors.rating",
    "read_recording": "recordings.read_recording",
    "read_room_levels": "floors.survey",
    "standardised_level": "floors.rating",
    "tapping_level": "floors.tapping",
}
__all__ = [  # noqa: PLE0604 - all are strings
    *_groups,
    *_LATE,
    *kinds.PUBLIC,
    "Bands",
    "Case",
    "CompressionCurve",
    "Conformity",
    "Criterion",
    "Ensemble",
    "FitWarning",
    "FloorEnergy",
    "FloorImpact",
    "FreeModes",
    "Impact",
    "InputError",
    "LockWarning",
    "Motion",
    "NumericalError",
    "PlausibilityWarning",
    "ThudError",
    "WorkerWarning",
    "compress",
    "force_exposure_levels",
    "free_modes",
    "get_bands",
    "judge",
    "loss_factors",
    "mobility",
    "read_case",
    "read_results",
    "solve",
    "solve_case",
    "solve_many",
    "write_case",
]

# Type checkers would take the name of anything for that of an object.
if not TYPE_CHECKING:

    def __getattr__(name: str) -> object:
        """Import slow modules at first use."""
        if name in kinds.PUBLIC:
            return kinds.public(name)
        if name not in _LATE:
            message = f"module 'thud' has no attribute {name!r}{suggestion(name, __all__)}"
            raise AttributeError(message)
        module = importlib.import_module(f"thud.{_LATE[name] or name}")
        return getattr(module, name) if _LATE[name] else module


def __dir__() -> list[str]:
    """Return the public names."""
    return [*__all__, "__version__"]


def _maker(module: str, function: str) -> Callable[..., object]:
    """Return a function of a module that is imported at first use."""

    def make(*arguments: object, **keywords: object) -> object:
        with require_extra("studies"):
            return getattr(importlib.import_module(f"thud.{module}"), function)(
                *arguments, **keywords
            )

    return make


MAKERS.update(
    figure=_maker("plot.overview", "overview"),
    floor=_maker("plot.floor", "draw_floor"),
    floor_impact=new_floor_impact,
    impedance=_maker("plot.impedance", "ball_impedances"),
    compression=_maker("plot.compression", "compression"),
    compression_table=_maker("export", "compression_table"),
    dataset=_maker("export", "dataset"),
    table=_maker("export", "table"),
    recording=_maker("plot.recording", "recording_figure"),
    floors=_maker("plot.floors", "draw_floors"),
    floors_html=_maker("plot.floors", "floors_html"),
    page_files=_maker("plot.look", "page_files"),
    modal_room=_maker("plot.modal_room", "draw_modal_room"),
    mobility_fit=_maker("plot.mobility_fit", "mobility_fit"),
    prediction=_maker("plot.prediction", "draw_prediction"),
    room=_maker("plot.room", "room_levels"),
    report=_maker("report", "write_report"),
)
