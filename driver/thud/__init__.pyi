from . import plot as plot, recordings as recordings
from .base.errors import (
    FitWarning as FitWarning,
    InputError as InputError,
    NumericalError as NumericalError,
    PlausibilityWarning as PlausibilityWarning,
    ThudError as ThudError,
)
from .case.case import Case as Case, read_case as read_case, write_case as write_case
from .case.constructions import (
    Construction as Construction,
    construction as construction,
    constructions as constructions,
)
from .comparison.comparison import Comparison as Comparison, compare as compare
from .export.floor_sound import FloorSound as FloorSound
from .export.force_files import BlockedForce as BlockedForce, blocked_force as blocked_force
from .export.room_sound import RoomSound as RoomSound, listen as listen
from .floors.floor_comparison import (
    FloorComparison as FloorComparison,
    compare_floors as compare_floors,
)
from .floors.impedance import BallImpedance as BallImpedance, ball_impedance as ball_impedance
from .floors.mobility import Mobility as Mobility, mobility as mobility
from .floors.mobility_fit import MobilityFit as MobilityFit, fit_mobility as fit_mobility
from .floors.mobility_table import read_mobility as read_mobility
from .floors.modal_room import ModalRoom as ModalRoom, modal_room as modal_room
from .floors.prediction import RoomPrediction as RoomPrediction, predict_level as predict_level
from .floors.survey import RoomLevels as RoomLevels, read_room_levels as read_room_levels
from .floors.tapping import TappingLevel as TappingLevel, tapping_level as tapping_level
from .floors.write_floor_modes import write_floor_modes as write_floor_modes
from .impact.compression import CompressionCurve as CompressionCurve, compress as compress
from .impact.ensemble import Ensemble as Ensemble, solve_many as solve_many
from .impact.floor_impact import FloorEnergy as FloorEnergy, FloorImpact as FloorImpact
from .impact.free_modes import (
    FreeModes as FreeModes,
    free_modes as free_modes,
    loss_factors as loss_factors,
)
from .impact.impact import Impact as Impact
from .impact.motion import Motion as Motion
from .impact.results import read_results as read_results
from .impact.solve import solve as solve
from .level.assessment import (
    Criterion as Criterion,
    Verdict as Verdict,
    assess_levels as assess_levels,
)
from .level.estimate import Estimate as Estimate
from .level.levels import (
    Bands as Bands,
    force_exposure_levels as force_exposure_levels,
    get_bands as get_bands,
)
from .level.rating import (
    Rating as Rating,
    rating as rating,
    standardized_level as standardized_level,
)
from .recordings.recording import Recording as Recording, read_recording as read_recording
from .report.recording_files import write_report as write_report
from .studies.calibrated_set import assess as assess
from .studies.design import Design as Design, design as design
from .studies.fit import fit as fit
from .studies.fitting.compression_target import CompressionTarget as CompressionTarget
from .studies.fitting.fit_result import Fit as Fit
from .studies.fitting.force_target import ForceTarget as ForceTarget
from .studies.fitting.level_target import LevelTarget as LevelTarget
from .studies.parameter import Parameter as Parameter
from .studies.sensitivity import Sensitivity as Sensitivity, sensitivity as sensitivity
from .studies.study import Study as Study, read_study as read_study
from .studies.surrogate import surrogate as surrogate
from .studies.sweep import Sweep as Sweep, read_sweep as read_sweep, sweep as sweep
from .studies.trained_surrogate import Surrogate as Surrogate, read_surrogate as read_surrogate
from .studies.uncertainty import Uncertainty as Uncertainty, uncertainty as uncertainty

__version__: str

# Made by ./bootstrap schema.
from .base._schema import (
    Ball as Ball,
    Compression as Compression,
    Drop as Drop,
    FiniteElement as FiniteElement,
    FloorName as FloorName,
    FloorOptions as FloorOptions,
    HollowSphere as HollowSphere,
    HuntCrossley as HuntCrossley,
    InfinitePlate as InfinitePlate,
    JoistFloor as JoistFloor,
    LaminateFloor as LaminateFloor,
    Levels as Levels,
    Limits as Limits,
    MeasuredMobility as MeasuredMobility,
    MeasuredModes as MeasuredModes,
    ModalBall as ModalBall,
    ModalFloor as ModalFloor,
    ModelName as ModelName,
    ModelOptions as ModelOptions,
    Modes as Modes,
    Oscillator as Oscillator,
    Plate as Plate,
    RectangularFloor as RectangularFloor,
    Rigid as Rigid,
    Room as Room,
    Sampling as Sampling,
    TwoMass as TwoMass,
    Unknowns as Unknowns,
)
