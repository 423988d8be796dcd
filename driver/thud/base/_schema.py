"""Groups of the input, keys and results as the library declares them.

Made by ``./bootstrap schema`` from ``thud --schema``; do not edit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

from thud.base.key import Group, Key, Quantity

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = [
    "Ball",
    "Compression",
    "Drop",
    "FiniteElement",
    "FloorName",
    "FloorOptions",
    "HollowSphere",
    "HuntCrossley",
    "InfinitePlate",
    "JoistFloor",
    "LaminateFloor",
    "Levels",
    "Limits",
    "MeasuredMobility",
    "MeasuredModes",
    "ModalBall",
    "ModalFloor",
    "ModelName",
    "ModelOptions",
    "Modes",
    "Oscillator",
    "Plate",
    "RectangularFloor",
    "Rigid",
    "Room",
    "Sampling",
    "TwoMass",
    "Unknowns",
]

# Choices of keys.
CompressionGas = Literal["vented", "isothermal", "adiabatic"]
ModelName = Literal[
    "modal_ball",
    "finite_element",
    "hollow_sphere",
    "measured_modes",
    "hunt_crossley",
    "two_mass",
]
ModalBallDampingLaw = Literal["constant", "rising", "fractional"]
ModalBallFloorFriction = Literal["none", "stick"]
FiniteElementLaw = Literal["neo_hookean", "mooney_rivlin"]
FiniteElementViscosity = Literal["none", "kelvin_voigt", "fractional", "constant_loss", "prony"]
HollowSphereMomentumFlux = Literal["momentum_balance", "retarding", "conservative", "none"]
LevelsMethod = Literal["exact", "fft"]
LevelsBands = Literal["octave", "third", "both"]
LevelsForce = Literal["floor", "elastic"]
LimitsSource = Literal["rubber_ball", "tyre"]
FloorName = Literal[
    "rigid",
    "infinite_plate",
    "oscillator",
    "plate",
    "laminate_floor",
    "joist_floor",
    "measured_mobility",
    "modal_floor",
]
PlateEdges = Literal["building", "laboratory", "absorption"]
JoistFloorSourceOn = Literal["sheathing", "joist", "position"]
MeasuredMobilityEdges = Literal["building", "laboratory", "absorption"]
RoomReverberationOf = Literal["finished", "bare"]
RoomWallJunction = Literal["cross", "t", "index"]
RoomRadiation = Literal["modes", "iso_12354"]
RoomPositions = Literal["rating", "standard", "even"]
RoomRating = Literal["octaves", "thirds", "standardized"]
RectangularFloorSupport = Literal["unknown", "simple", "clamped", "free", "elastic"]
BandSet = Literal["octave", "third"]


@dataclass(frozen=True)
class Ball(Group):
    """The ball or another source: geometry, mass and material (group ``&ball``).

    Attributes
    ----------
    outer_radius : float
        Outer radius, m; (0, 10].
    wall_thickness : float
        Wall thickness, less than the outer radius, m; (0, `outer_radius`).
    mass : float
        Mass, kg; [1e-12, 1e6].
    youngs_modulus : float | None
        Modulus of elasticity, Pa; (0, 1e13]; None: that of the standard ball by the model.
    poisson_ratio : float | None
        Poisson's ratio; (-1, 0.5]; None: that of the standard ball by the model.
    gauge_pressure : float
        Overpressure of the gas in the undeformed ball, Pa; [0, 1e8].
    ambient_pressure : float
        Pressure of the air around the ball, Pa; [0, 1e8].
    heat_capacity_ratio : float
        Ratio of specific heats of the enclosed gas; [1, 2].
    """

    outer_radius: float = 0.089
    wall_thickness: float = 0.032
    mass: float = 2.5
    youngs_modulus: float | None = None
    poisson_ratio: float | None = None
    gauge_pressure: float = 0.0
    ambient_pressure: float = 101325.0
    heat_capacity_ratio: float = 1.4


@dataclass(frozen=True)
class Drop(Group):
    """The drop: height and gravity (group ``&drop``).

    Attributes
    ----------
    height : float
        Height of the ball's lowest point above the floor, m; [1e-12, 1e6].
    gravity : float
        Acceleration of free fall, m/s2; [1e-12, 1000].
    """

    height: float = 1.0
    gravity: float = 9.81


@dataclass(frozen=True)
class Sampling(Group):
    """Samples of the force: rate, duration and steps between them (group ``&sampling``).

    Attributes
    ----------
    sample_rate : float
        Samples per second; from 16000 with finite_element, Hz; [2000, 1e7].
    duration : float
        Duration of the record from first touch, s; [0.001, 10].
    substeps : int
        Integration steps per sampling interval; [1, 10000].
    verify : bool
        Compute again at a finer resolution, and state the changes.
    """

    sample_rate: float = 44100.0
    duration: float = 0.05
    substeps: int = 1
    verify: bool = False


@dataclass(frozen=True)
class Levels(Group):
    """How levels are computed, and of which force (group ``&levels``).

    Attributes
    ----------
    method : str
        Method of computing the levels; `'exact'`, `'fft'`.
    bands : str
        Bands of levels.csv; `'octave'`, `'third'`, `'both'`.
    force : str
        Assessed force, for which levels, peak force and verdict are reported; `'floor'`,
        `'elastic'`.
    """

    method: LevelsMethod = "exact"
    bands: LevelsBands = "octave"
    force: LevelsForce = "floor"


@dataclass(frozen=True)
class Limits(Group):
    """The source whose limits apply (group ``&limits``).

    Attributes
    ----------
    source : str
        Source whose limits apply; `'rubber_ball'`, `'tyre'`.
    """

    source: LimitsSource = "rubber_ball"


@dataclass(frozen=True)
class Modes(Group):
    """Free modes that are requested.

    Attributes
    ----------
    count : int
        Number of elastic free modes; [1, 100].
    """

    count: int = 6


@dataclass(frozen=True)
class Compression(Group):
    """Quasi-static compression that is requested.

    Attributes
    ----------
    max_deflection : float
        Maximum approach of the plates, m; [1e-15, 10].
    points : int
        Number of points of the curve, including the undeformed ball; [2, 10000].
    gas : str
        Gas in the ball: leaves through the hole (vented), or is sealed in; `'vented'`,
        `'isothermal'`, `'adiabatic'`.
    """

    max_deflection: float = 0.04
    points: int = 41
    gas: CompressionGas = "vented"


@dataclass(frozen=True)
class Unknowns(Group):
    """What is not known of the source: keys, and the distributions of their values.

    Attributes
    ----------
    key : sequence of str
        Keys of ball, drop and model whose values are not known.
    low : sequence of float
        Their minima, in the units of the keys; [-1e30, 1e30].
    high : sequence of float
        Their maxima; [-1e30, 1e30].
    standard_deviation : sequence of float
        Standard deviations around the values of the case, truncated by low and high; 0: uniform;
        [0, 1e30].
    reason : sequence of str
        Reasons of the ranges, with their sources.
    """

    key: Sequence[str] = ()
    low: Sequence[float] = ()
    high: Sequence[float] = ()
    standard_deviation: Sequence[float] = ()
    reason: Sequence[str] = ()


@dataclass(frozen=True)
class Room(Group):
    """Room below the floor.

    Attributes
    ----------
    length : float
        Length of the room; 0: that of the floor, m; [0, 100].
    width : float
        Width of the room; 0: that of the floor, m; [0, 100].
    height : float
        Height of the room; 0: from the volume, without it 2.5 m, m; [0, 100].
    volume : float
        Volume of the room; 0: length times width times height, m3; [0, 100000].
    reverberation_time : float | sequence of float
        Reverberation time of the room: one, 4 for octaves or 12 for one-third octaves, s; [0.05,
        20].
    reverberation_of : str
        Room of the reverberation time: finished, or bare, without floor, walls and ceiling;
        `'finished'`, `'bare'`.
    air_density : float
        Density of the air, kg/m3; [0.5, 2].
    sound_speed : float
        Speed of sound in the air, m/s; [200, 500].
    wall_lengths : sequence of float
        Lengths of the flanking walls along the floor (default: no walls), m; [0.1, 100].
    wall_height : float
        Height of the walls, m; [0.5, 20].
    wall_thickness : float | sequence of float
        Thickness of the walls: one, or one for each of wall_lengths, m; [0.005, 2].
    wall_density : float | sequence of float
        Density of the walls: one, or one for each, kg/m3; [10, 20000].
    wall_wave_speed : float | sequence of float
        Speed of longitudinal waves in the walls: one, or one for each, m/s; [100, 10000].
    wall_loss_factor : float | sequence of float
        Internal loss factor of the walls: one, or one for each; [0, 1].
    wall_junction : str
        Junction of floor and walls: rigid cross or T, or described by junction_index; `'cross'`,
        `'t'`, `'index'`.
    junction_index : float | sequence of float
        Vibration reduction index from floor to wall, for wall_junction index: one, or one for each
        wall, dB; [-10, 80].
    ceiling_mass : float
        Mass per unit area of a suspended ceiling; 0: none, kg/m2; [0, 200].
    ceiling_depth : float
        Depth of the air cavity above the ceiling, m; [0.01, 2].
    ceiling_loss_factor : float
        Loss factor of the ceiling cavity; [0.001, 1].
    corner_x : float
        Position of the room along the length of a larger floor, m; [0, 100).
    corner_y : float
        Position of the room along the width of a larger floor, m; [0, 100).
    radiation : str
        Radiation factor of the floor, by its modes or by ISO 12354-1; `'modes'`, `'iso_12354'`.
    positions : str
        Positions of ball and microphone: those of the rating, 5 standard ones each (octaves), or
        16 even ones each; `'rating'`, `'standard'`, `'even'`.
    rating : str
        Rating that is asked for (KS F ISO 717-2, ISO 717-2, ISO 16283-2); `'octaves'`, `'thirds'`,
        `'standardized'`.
    required : float
        Maximum of that rating that is required; 0: none, dB; [0, 200].
    """

    length: float = 0.0
    width: float = 0.0
    height: float = 0.0
    volume: float = 0.0
    reverberation_time: float | Sequence[float] = (0.5,)
    reverberation_of: RoomReverberationOf = "finished"
    air_density: float = 1.2
    sound_speed: float = 343.0
    wall_lengths: Sequence[float] = ()
    wall_height: float = 2.5
    wall_thickness: float | Sequence[float] = (0.2,)
    wall_density: float | Sequence[float] = (2300.0,)
    wall_wave_speed: float | Sequence[float] = (3500.0,)
    wall_loss_factor: float | Sequence[float] = (0.005,)
    wall_junction: RoomWallJunction = "cross"
    junction_index: float | Sequence[float] = (10.0,)
    ceiling_mass: float = 0.0
    ceiling_depth: float = 0.1
    ceiling_loss_factor: float = 0.3
    corner_x: float = 0.0
    corner_y: float = 0.0
    radiation: RoomRadiation = "modes"
    positions: RoomPositions = "rating"
    rating: RoomRating = "thirds"
    required: float = 0.0


@dataclass(frozen=True)
class ModalBall(Group):
    """Options of the source model ``modal_ball``.

    Attributes
    ----------
    highest_frequency : float
        Highest frequency of oscillating modes; faster ones follow without inertia; 0: automatic,
        Hz; [0, 20000].
    rings : int
        Number of rings on the surface, from the lowest point to 60 degrees; 0: automatic; [0,
        400].
    damping_law : str
        Damping law: loss factor as a function of frequency; `'constant'`, `'rising'`,
        `'fractional'`.
    loss_factor : float | None
        Loss factor, twice the damping ratio; [0, 1.9]; None: that of the standard ball by the
        model.
    loss_frequency : float | None
        Frequency at which loss_factor (rising, fractional) and the modulus (fractional) apply, Hz;
        [0.1, 100000]; None: that of the standard ball by the model.
    fractional_order : float
        Order of the derivative, for fractional; 1: as rising; (0, 1].
    cavity_gas : bool
        The gas in the cavity resists volume changes.
    contact_gravity : bool
        Gravity acts also during the contact.
    floor_friction : str
        Friction of the floor: none or infinite (sticking); `'none'`, `'stick'`.
    static_families : sequence of int
        Harmonics treated as quasi-static; [0, 400].
    """

    name: ClassVar[ModelName] = "modal_ball"
    highest_frequency: float = 0.0
    rings: int = 0
    damping_law: ModalBallDampingLaw = "rising"
    loss_factor: float | None = None
    loss_frequency: float | None = None
    fractional_order: float = 0.3
    cavity_gas: bool = True
    contact_gravity: bool = False
    floor_friction: ModalBallFloorFriction = "none"
    static_families: Sequence[int] = ()


@dataclass(frozen=True)
class FiniteElement(Group):
    """Options of the source model ``finite_element``.

    Attributes
    ----------
    bounces : int
        Number of contacts to compute; [1, 100].
    flight_before : float
        Duration of free flight before first touch, s; [0, 1].
    flight_after : float
        Duration of free flight after the last contact, s; [0, 10].
    step_safety : float
        Time step divided by a bound on stable steps; [0.01, 0.98].
    radial_elements : int
        Number of elements through the wall; 0: automatic; [0, 64]; group ``&mesh``.
    polar_elements : int
        Number of elements from pole to pole, from 8; 0: automatic; [0, 1024]; group ``&mesh``.
    law : str
        Law of elasticity; `'neo_hookean'`, `'mooney_rivlin'`; group ``&material``.
    mooney_share : float
        Second-invariant fraction of the shear modulus, for mooney_rivlin; [0, 1]; group
        ``&material``.
    bulk_ratio : float
        Maximum ratio of bulk to shear modulus; lower if Poisson's ratio implies a lower one; [2,
        100000]; group ``&material``.
    viscosity : str
        Law of viscosity; `'none'`, `'kelvin_voigt'`, `'fractional'`, `'constant_loss'`, `'prony'`;
        group ``&material``.
    loss_factor : float | None
        Loss factor: at loss_frequency (kelvin_voigt, fractional), or from 10 to 1000 Hz
        (constant_loss); (0, 1]; None: that of the standard ball by the model; group ``&material``.
    loss_frequency : float | None
        Frequency at which the ball's modulus is the storage modulus, Hz; [1, 10000]; None: that of
        the standard ball by the model; group ``&material``.
    fractional_order : float | None
        Order of the derivative, for fractional; 1: as kelvin_voigt; (0, 1]; None: that of the
        standard ball by the model; group ``&material``.
    prony_share : sequence of float
        Moduli of the branches divided by the long-term modulus, for prony; [0, 1000]; group
        ``&material``.
    prony_time : sequence of float
        Relaxation times of the branches, for prony, s; (0, 1000]; group ``&material``.
    friction : float | None
        Coefficient of friction between ball and floor; [0, 100]; None: that of the standard ball
        by the model; group ``&contact``.
    layer_stiffness : float
        Stiffness per area of a thin layer on the floor; 0: hard floor without a layer, N/m3; [0,
        1e13]; group ``&contact``.
    snapshot_interval : float
        Time between snapshots of the deformed ball; 0: none, s; [0, 10]; group ``&output``.
    """

    name: ClassVar[ModelName] = "finite_element"
    bounces: int = 1
    flight_before: float = 0.0
    flight_after: float = 0.0
    step_safety: float = 0.85
    radial_elements: int = 0
    polar_elements: int = 0
    law: FiniteElementLaw = "neo_hookean"
    mooney_share: float = 0.2
    bulk_ratio: float = 200.0
    viscosity: FiniteElementViscosity = "fractional"
    loss_factor: float | None = None
    loss_frequency: float | None = None
    fractional_order: float | None = None
    prony_share: Sequence[float] = ()
    prony_time: Sequence[float] = ()
    friction: float | None = None
    layer_stiffness: float = 0.0
    snapshot_interval: float = 0.0


@dataclass(frozen=True)
class HollowSphere(Group):
    """Options of the source model ``hollow_sphere``.

    Attributes
    ----------
    momentum_flux : str
        Term for the momentum of wall that enters or leaves the flat cap; `'momentum_balance'`,
        `'retarding'`, `'conservative'`, `'none'`.
    """

    name: ClassVar[ModelName] = "hollow_sphere"
    momentum_flux: HollowSphereMomentumFlux = "momentum_balance"


@dataclass(frozen=True)
class MeasuredModes(Group):
    """Options of the source model ``measured_modes``.

    Attributes
    ----------
    frequency : sequence of float
        Natural frequencies of the ball on the floor, Hz; [0.001, 1e6].
    damping_ratio : sequence of float
        Damping ratios, one per mode; [0, 1).
    effective_mass : sequence of float
        Effective masses, one per mode, kg; [1e-12, 1e6].
    allow_mass_mismatch : bool
        Effective masses need not add up to the mass of the ball.
    """

    name: ClassVar[ModelName] = "measured_modes"
    frequency: Sequence[float] = ()
    damping_ratio: Sequence[float] = ()
    effective_mass: Sequence[float] = ()
    allow_mass_mismatch: bool = False


@dataclass(frozen=True)
class HuntCrossley(Group):
    """Options of the source model ``hunt_crossley``.

    Attributes
    ----------
    stiffness : float
        Contact stiffness, N/m^exponent; 0: derived from contact_time; [0, 1e15].
    contact_time : float
        Target contact time; 0: derived from stiffness, s; [0, 10].
    exponent : float
        Exponent of the deflection in the contact force; [1, 5].
    damping : float
        Damping coefficient alpha; 0: derived from restitution, s/m; [0, 100].
    restitution : float
        Target coefficient of restitution; 0: derived from damping; [0, 1].
    """

    name: ClassVar[ModelName] = "hunt_crossley"
    stiffness: float = 0.0
    contact_time: float = 0.0
    exponent: float = 1.5
    damping: float = 0.0
    restitution: float = 0.0


@dataclass(frozen=True)
class TwoMass(Group):
    """Options of the source model ``two_mass``.

    Attributes
    ----------
    belt_mass : float
        Mass of belt and tread, less than the mass of the source, kg; (0, 1e6).
    inflation_pressure : float
        Inflation pressure, Pa; [0, 1e8].
    contact_width : float
        Contact area divided by deflection of the contact patch, m; [0, 100].
    carcass_stiffness : float
        Force of the carcass divided by its deflection, at 20 mm, N/m; [0, 1e12].
    carcass_exponent : float
        Exponent of the deflection in the force of the carcass; [1.5, 5].
    contact_damping : float
        Damping force of the contact divided by elastic force and velocity, s/m; [0, 100].
    belt_frequency : float
        Natural frequency of the belt on the sidewall with fixed rim, Hz; (0, 1e6].
    belt_damping : float
        Damping ratio of the belt on the sidewall with fixed rim; [0, 10].
    """

    name: ClassVar[ModelName] = "two_mass"
    belt_mass: float = 2.0
    inflation_pressure: float = 240000.0
    contact_width: float = 0.4
    carcass_stiffness: float = 90000.0
    carcass_exponent: float = 2.5
    contact_damping: float = 0.06
    belt_frequency: float = 85.0
    belt_damping: float = 0.2


@dataclass(frozen=True, kw_only=True)
class RectangularFloor(Group):
    """What all floors of rectangular plates have.

    Attributes
    ----------
    source_x : float
        Relative source position along the length; levels in the room are means over positions; (0,
        1).
    source_y : float
        Relative source position along the width; (0, 1).
    support : str
        Support of the edges; `'unknown'`, `'simple'`, `'clamped'`, `'free'`, `'elastic'`.
    support_stiffness : sequence of float
        Stiffness of elastic edges against deflection per length: 1 value, or 4 (x at 0 and length,
        y at 0 and width), N/m2; [0, 1e14].
    support_rotation : sequence of float
        Stiffness of elastic edges against rotation per length: 1 or 4 values, N; [0, 1e14].
    line_x : sequence of float
        Positions along the length of walls or beams on which the floor rests, m; (0, 100).
    line_y : sequence of float
        Positions along the width of walls or beams on which the floor rests, m; (0, 100).
    screed_thickness : float
        Thickness of a floating plate; 0: none, m; [0, 0.5].
    screed_density : float
        Density of the floating plate, kg/m3; [10, 20000].
    screed_wave_speed : float
        Speed of longitudinal waves in the floating plate, m/s; [100, 10000].
    screed_loss_factor : float
        Loss factor of the floating plate; [0, 1].
    layer_stiffness : float
        Dynamic stiffness of the resilient layer per unit area (ISO 9052-1), N/m3; [10000, 1e12].
    layer_loss_factor : float
        Loss factor of the resilient layer; [0, 1].
    subceiling_thickness : float
        Thickness of a subceiling that radiates instead of the floor; 0: none, m; [0, 0.2].
    subceiling_density : float
        Density of the subceiling, kg/m3; [10, 20000].
    subceiling_modulus : float
        Modulus of elasticity of the subceiling in bending, Pa; [1e7, 1e12].
    subceiling_loss_factor : float
        Loss factor of the subceiling; [0, 1].
    channel_stiffness : float
        Stiffness per length of each line that holds the subceiling (channels, battens, hangers),
        N/m2; [0, 1e12].
    channel_loss_factor : float
        Loss factor of these lines; [0, 1].
    cavity_depth : float
        Depth of the air between floor and subceiling, m; [0.005, 2].
    cavity_loss_factor : float
        Loss factor of this air, high with absorber in it; [0, 1].
    covering_stiffness : float
        Stiffness of a covering under the source; 0: none, N/m; [0, 1e12].
    covering_loss_factor : float
        Loss factor of the covering at 50 Hz; [0.01, 2].
    covering_improvement : sequence of float
        Measured reduction of heavy impact sound by a covering, in octaves 63 to 500 Hz or one-
        third octaves 50 to 630 Hz, dB; [-30, 60].
    point_x : sequence of float
        Positions along the length of points whose velocity is computed, m; [0, 1000].
    point_y : sequence of float
        Positions of these points along the width, m; [0, 1000].
    """

    source_x: float = 0.5
    source_y: float = 0.5
    support: RectangularFloorSupport = "unknown"
    support_stiffness: Sequence[float] = ()
    support_rotation: Sequence[float] = ()
    line_x: Sequence[float] = ()
    line_y: Sequence[float] = ()
    screed_thickness: float = 0.0
    screed_density: float = 2000.0
    screed_wave_speed: float = 3500.0
    screed_loss_factor: float = 0.03
    layer_stiffness: float = 10000000.0
    layer_loss_factor: float = 0.1
    subceiling_thickness: float = 0.0
    subceiling_density: float = 720.0
    subceiling_modulus: float = 2500000000.0
    subceiling_loss_factor: float = 0.02
    channel_stiffness: float = 100000.0
    channel_loss_factor: float = 0.1
    cavity_depth: float = 0.1
    cavity_loss_factor: float = 0.3
    covering_stiffness: float = 0.0
    covering_loss_factor: float = 0.2
    covering_improvement: Sequence[float] = ()
    point_x: Sequence[float] = ()
    point_y: Sequence[float] = ()


@dataclass(frozen=True)
class Rigid(Group):
    """Floor ``rigid``."""

    name: ClassVar[FloorName] = "rigid"


@dataclass(frozen=True)
class InfinitePlate(Group):
    """Floor ``infinite_plate``.

    Attributes
    ----------
    resistance : float
        Driving-point resistance: force divided by velocity, N s/m; [1, 1e15].
    """

    name: ClassVar[FloorName] = "infinite_plate"
    resistance: float = 1600.0


@dataclass(frozen=True)
class Oscillator(Group):
    """Floor ``oscillator``.

    Attributes
    ----------
    mass : float
        Moving mass under the source, kg; [0.001, 1e12].
    stiffness : float
        Stiffness of the support, N/m; [0, 1e15].
    damping : float
        Damping coefficient of the support, N s/m; [0, 1e12].
    """

    name: ClassVar[FloorName] = "oscillator"
    mass: float = 100.0
    stiffness: float = 2467000.0
    damping: float = 785.0


@dataclass(frozen=True)
class Plate(RectangularFloor):
    """Floor ``plate``, with all keys of `RectangularFloor`.

    Attributes
    ----------
    length : float
        Length of the floor, m; [0.5, 100].
    width : float
        Width of the floor, m; [0.5, 100].
    thickness : float
        Thickness of the floor, m; [0.001, 2].
    density : float
        Density of the floor, kg/m3; [10, 20000].
    wave_speed : float
        Speed of longitudinal waves in the floor, m/s; [100, 10000].
    stiffness_ratio : float
        Ratio of the bending stiffness along the width to that along the length; [0.0001, 10000].
    torsion_ratio : float
        Ratio of the twisting stiffness to the geometric mean of both bending stiffnesses; [0, 1].
    loss_factor : float
        Internal loss factor of the floor; [0, 1].
    edges : str
        Losses at the edges of the floor; `'building'`, `'laboratory'`, `'absorption'`.
    edge_absorption : float
        Sum of edge lengths times absorption coefficients, for absorption, m; [0, 1000].
    channel_spacing : float
        Distance of the lines that hold the subceiling, which run along the length, m; [0.05, 100].
    """

    name: ClassVar[FloorName] = "plate"
    length: float = 5.0
    width: float = 4.0
    thickness: float = 0.18
    density: float = 2300.0
    wave_speed: float = 3500.0
    stiffness_ratio: float = 1.0
    torsion_ratio: float = 1.0
    loss_factor: float = 0.005
    edges: PlateEdges = "building"
    edge_absorption: float = 0.0
    channel_spacing: float = 0.5


@dataclass(frozen=True)
class LaminateFloor(RectangularFloor):
    """Floor ``laminate_floor``, with all keys of `RectangularFloor`.

    Attributes
    ----------
    length : float
        Length of the floor, along the grain of the first layer, m; [0.5, 100].
    width : float
        Width of the floor, m; [0.5, 100].
    layer_thickness : sequence of float
        Thicknesses of the crossed layers from the top (default: 40, 20, 40, 20, 40 mm), m; [0.003,
        0.5].
    youngs_modulus : float
        Modulus of elasticity along the grain, Pa; [1e8, 1e12].
    cross_modulus : float
        Modulus of elasticity across the grain, Pa; [0, 1e12].
    shear_modulus : float
        Shear modulus along the grain, Pa; [1e6, 1e12].
    rolling_shear_modulus : float
        Modulus of rolling shear, Pa; [1e6, 1e12].
    torsion_factor : float
        Fraction of the torsional stiffness that joints between boards leave; [0, 1].
    density : float
        Density of the layers, kg/m3; [10, 20000].
    added_mass : float
        Mass without stiffness on the plate, as gravel, kg/m2; [0, 1000].
    loss_factor : float
        Loss factor of the floor including its edges, without radiation; (0, 1].
    channel_spacing : float
        Distance of the lines that hold the subceiling, which run along the length, m; [0.05, 100].
    """

    name: ClassVar[FloorName] = "laminate_floor"
    length: float = 5.0
    width: float = 4.0
    layer_thickness: Sequence[float] = ()
    youngs_modulus: float = 11000000000.0
    cross_modulus: float = 370000000.0
    shear_modulus: float = 690000000.0
    rolling_shear_modulus: float = 50000000.0
    torsion_factor: float = 0.65
    density: float = 470.0
    added_mass: float = 0.0
    loss_factor: float = 0.03
    channel_spacing: float = 0.5


@dataclass(frozen=True)
class JoistFloor(RectangularFloor):
    """Floor ``joist_floor``, with all keys of `RectangularFloor`.

    Attributes
    ----------
    length : float
        Span of the joists, m; [0.5, 100].
    width : float
        Width of the floor across the joists, m; [0.5, 100].
    sheathing_thickness : float
        Thickness of the sheathing, m; [0.003, 0.3].
    sheathing_density : float
        Density of the sheathing, kg/m3; [10, 20000].
    sheathing_modulus : float
        Modulus of elasticity of the sheathing in bending, Pa; [1e7, 1e12].
    spacing : float
        Distance between the axes of adjacent joists, m; (`joist_width`, `width`).
    joist_width : float
        Width of a joist, m; [0.005, 1].
    joist_height : float
        Height of a joist, m; [0.01, 2].
    joist_density : float
        Density of the joists, kg/m3; [10, 20000].
    joist_modulus : float
        Modulus of elasticity of the joists, Pa; [1e7, 1e12].
    connection : float
        Composite action of sheathing and joists over the span, 0 (loose) to 1 (glued), EN 1995-1-1
        annex B; [0, 1].
    loss_factor : float
        Loss factor of the floor including its edges, without radiation; (0, 1].
    source_on : str
        Impact location: midway between the next joists, on the next joist, or exactly the
        position; `'sheathing'`, `'joist'`, `'position'`.
    """

    name: ClassVar[FloorName] = "joist_floor"
    length: float = 4.0
    width: float = 5.0
    sheathing_thickness: float = 0.022
    sheathing_density: float = 650.0
    sheathing_modulus: float = 3000000000.0
    spacing: float = 0.4
    joist_width: float = 0.06
    joist_height: float = 0.22
    joist_density: float = 420.0
    joist_modulus: float = 11000000000.0
    connection: float = 0.1
    loss_factor: float = 0.05
    source_on: JoistFloorSourceOn = "sheathing"


@dataclass(frozen=True)
class MeasuredMobility(Group):
    """Floor ``measured_mobility``.

    Attributes
    ----------
    direct : float
        Limit of the mobility at high frequencies, m/(N s); [0, 1000].
    pole_frequency : sequence of float
        Magnitudes of the poles divided by 2 pi, Hz; [1e-6, 1e7].
    damping_ratio : sequence of float
        Damping ratios of the poles; 1 for a real pole; [1e-12, 1].
    residue_real : sequence of float
        Real parts of the residues, doubled for a pair of poles, m/(N s2); [-1e12, 1e12].
    residue_imaginary : sequence of float
        Imaginary parts of the residues, doubled for a pair of poles, m/(N s2); [-1e12, 1e12].
    lowest_frequency : float
        Lowest frequency of the measurement, Hz; (0, `highest_frequency`).
    highest_frequency : float
        Highest frequency of the measurement, Hz; (0, 1e7].
    length : float
        Length of the floor, m; [0.5, 100].
    width : float
        Width of the floor, m; [0.5, 100].
    thickness : float
        Thickness of the plate that radiates into a room; 0: none, m; [0, 2].
    density : float
        Density of the floor, kg/m3; [10, 20000].
    wave_speed : float
        Speed of longitudinal waves in the floor, m/s; [100, 10000].
    stiffness_ratio : float
        Ratio of the bending stiffness along the width to that along the length; [0.0001, 10000].
    torsion_ratio : float
        Ratio of the twisting stiffness to the geometric mean of both bending stiffnesses; [0, 1].
    loss_factor : float
        Internal loss factor of the floor; [0, 1].
    edges : str
        Losses at the edges of the floor; `'building'`, `'laboratory'`, `'absorption'`.
    edge_absorption : float
        Sum of edge lengths times absorption coefficients, for absorption, m; [0, 1000].
    """

    name: ClassVar[FloorName] = "measured_mobility"
    direct: float = 0.0
    pole_frequency: Sequence[float] = ()
    damping_ratio: Sequence[float] = ()
    residue_real: Sequence[float] = ()
    residue_imaginary: Sequence[float] = ()
    lowest_frequency: float = 10.0
    highest_frequency: float = 1000.0
    length: float = 5.0
    width: float = 4.0
    thickness: float = 0.0
    density: float = 2300.0
    wave_speed: float = 3500.0
    stiffness_ratio: float = 1.0
    torsion_ratio: float = 1.0
    loss_factor: float = 0.005
    edges: MeasuredMobilityEdges = "building"
    edge_absorption: float = 0.0


@dataclass(frozen=True)
class ModalFloor(Group):
    """Floor ``modal_floor``.

    Attributes
    ----------
    file : str
        File of the modes: frequencies, loss factors, shapes on a grid.
    source_x : float
        Relative source position along the length; levels in the room are means over positions; (0,
        1).
    source_y : float
        Relative source position along the width; (0, 1).
    residual_compliance : float
        Static compliance at the source of the modes above those of the file; 0: that of the plate,
        m/N; [0, 1].
    thickness : float
        Thickness of the plate that radiates into a room; 0: none, m; [0, 2].
    density : float
        Density of the floor, kg/m3; [10, 20000].
    wave_speed : float
        Speed of longitudinal waves in the floor, m/s; [100, 10000].
    stiffness_ratio : float
        Ratio of the bending stiffness along the width to that along the length; [0.0001, 10000].
    torsion_ratio : float
        Ratio of the twisting stiffness to the geometric mean of both bending stiffnesses; [0, 1].
    point_x : sequence of float
        Positions along the length of points whose velocity is computed, m; [0, 1000].
    point_y : sequence of float
        Positions of these points along the width, m; [0, 1000].
    """

    name: ClassVar[FloorName] = "modal_floor"
    file: str = ""
    source_x: float = 0.5
    source_y: float = 0.5
    residual_compliance: float = 0.0
    thickness: float = 0.0
    density: float = 2300.0
    wave_speed: float = 3500.0
    stiffness_ratio: float = 1.0
    torsion_ratio: float = 1.0
    point_x: Sequence[float] = ()
    point_y: Sequence[float] = ()


ModelOptions = ModalBall | FiniteElement | HollowSphere | MeasuredModes | HuntCrossley | TwoMass
FloorOptions = (
    Rigid
    | InfinitePlate
    | Oscillator
    | Plate
    | LaminateFloor
    | JoistFloor
    | MeasuredMobility
    | ModalFloor
)

# Source models by name, the default first.
MODELS: dict[str, type[ModelOptions]] = {
    ModalBall.name: ModalBall,
    FiniteElement.name: FiniteElement,
    HollowSphere.name: HollowSphere,
    MeasuredModes.name: MeasuredModes,
    HuntCrossley.name: HuntCrossley,
    TwoMass.name: TwoMass,
}

# Floors by name, the default first.
FLOORS: dict[str, type[FloorOptions]] = {
    Rigid.name: Rigid,
    InfinitePlate.name: InfinitePlate,
    Oscillator.name: Oscillator,
    Plate.name: Plate,
    LaminateFloor.name: LaminateFloor,
    JoistFloor.name: JoistFloor,
    MeasuredMobility.name: MeasuredMobility,
    ModalFloor.name: ModalFloor,
}

# Groups that every model uses.
GROUPS: dict[str, type[Group]] = {
    "ball": Ball,
    "drop": Drop,
    "sampling": Sampling,
    "levels": Levels,
    "limits": Limits,
}

# Groups that a case may have.
OPTIONAL_GROUPS: dict[str, type[Group]] = {
    "modes": Modes,
    "compression": Compression,
    "unknowns": Unknowns,
    "room": Room,
}


@dataclass(frozen=True, eq=False, kw_only=True)
class ImpactQuantities:
    """Numbers that describe an impact.

    Attributes
    ----------
    contact_time : float
        Contact time, s.
    peak_force : float
        Maximum force on the floor, N.
    peak_elastic_force : float
        Maximum elastic force, N.
    max_deflection : float
        Maximum deflection, m.
    restitution : float
        Coefficient of restitution.
    impulse : float
        Time integral of the force on the floor, N s.
    impact_velocity : float
        Velocity at first touch, m/s.
    exact_contact_time : float
        Contact time, resolved between time steps, s.
    touch_time : float
        Time of first touch in the record, s.
    sample_rate : float
        Samples per second, Hz.
    impulse_residual : float
        Relative residual of the momentum balance.
    energy_residual : float
        Relative residual of the energy balance.
    octave_31_5_error : float
        Numerical error of the level of the 31.5 Hz octave, dB.
    octave_63_error : float
        Numerical error of the level of the 63 Hz octave, dB.
    octave_125_error : float
        Numerical error of the level of the 125 Hz octave, dB.
    octave_250_error : float
        Numerical error of the level of the 250 Hz octave, dB.
    octave_500_error : float
        Numerical error of the level of the 500 Hz octave, dB.
    contact_time_error : float
        Numerical error of the contact time, s.
    restitution_error : float
        Numerical error of the coefficient of restitution.
    peak_force_error : float
        Numerical error of the maximum force on the floor, N.
    """

    contact_time: float
    peak_force: float
    peak_elastic_force: float
    max_deflection: float
    restitution: float
    impulse: float
    impact_velocity: float
    exact_contact_time: float
    touch_time: float
    sample_rate: float
    impulse_residual: float
    energy_residual: float
    octave_31_5_error: float
    octave_63_error: float
    octave_125_error: float
    octave_250_error: float
    octave_500_error: float
    contact_time_error: float
    restitution_error: float
    peak_force_error: float


@dataclass(frozen=True, eq=False, kw_only=True)
class SampleQuantities:
    """Numbers that describe each of many samples.

    Attributes
    ----------
    contact_time : ndarray, shape (n_sample,)
        Contact time, s.
    peak_force : ndarray, shape (n_sample,)
        Maximum force on the floor, N.
    peak_elastic_force : ndarray, shape (n_sample,)
        Maximum elastic force, N.
    max_deflection : ndarray, shape (n_sample,)
        Maximum deflection, m.
    restitution : ndarray, shape (n_sample,)
        Coefficient of restitution.
    impulse : ndarray, shape (n_sample,)
        Time integral of the force on the floor, N s.
    """

    contact_time: NDArray[np.float64]
    peak_force: NDArray[np.float64]
    peak_elastic_force: NDArray[np.float64]
    max_deflection: NDArray[np.float64]
    restitution: NDArray[np.float64]
    impulse: NDArray[np.float64]

# The table of quantities.
QUANTITIES = {
    "contact_time": Quantity("contact_time", "contact time", "T", "s", "ms", 1000.0, 2, "contact time"),
    "peak_force": Quantity("peak_force", "peak force", "F_{max}", "N", "N", 1.0, 0, "maximum force on the floor"),
    "peak_elastic_force": Quantity("peak_elastic_force", "peak elastic force", "F_{E,max}", "N", "N", 1.0, 0, "maximum elastic force"),
    "max_deflection": Quantity("max_deflection", "peak deflection", "d_{max}", "m", "mm", 1000.0, 2, "maximum deflection"),
    "restitution": Quantity("restitution", "restitution", "e", "", "", 1.0, 3, "coefficient of restitution"),
    "impulse": Quantity("impulse", "impulse", "I", "N s", "N s", 1.0, 2, "time integral of the force on the floor"),
    "impact_velocity": Quantity("impact_velocity", "impact velocity", "v_0", "m/s", "m/s", 1.0, 3, "velocity at first touch"),
    "exact_contact_time": Quantity("exact_contact_time", "exact contact time", "T", "s", "ms", 1000.0, 3, "contact time, resolved between time steps"),
    "touch_time": Quantity("touch_time", "time of first touch", "t_0", "s", "ms", 1000.0, 3, "time of first touch in the record"),
    "sample_rate": Quantity("sample_rate", "sample rate", "f_s", "Hz", "kHz", 0.001, 3, "samples per second"),
    "impulse_residual": Quantity("impulse_residual", "impulse residual", "", "", "", 1.0, 6, "relative residual of the momentum balance"),
    "energy_residual": Quantity("energy_residual", "energy residual", "", "", "", 1.0, 6, "relative residual of the energy balance"),
    "octave_31_5_error": Quantity("octave_31_5_error", "error at 31.5 Hz", "", "dB", "dB", 1.0, 2, "numerical error of the level of the 31.5 Hz octave"),
    "octave_63_error": Quantity("octave_63_error", "error at 63 Hz", "", "dB", "dB", 1.0, 2, "numerical error of the level of the 63 Hz octave"),
    "octave_125_error": Quantity("octave_125_error", "error at 125 Hz", "", "dB", "dB", 1.0, 2, "numerical error of the level of the 125 Hz octave"),
    "octave_250_error": Quantity("octave_250_error", "error at 250 Hz", "", "dB", "dB", 1.0, 2, "numerical error of the level of the 250 Hz octave"),
    "octave_500_error": Quantity("octave_500_error", "error at 500 Hz", "", "dB", "dB", 1.0, 2, "numerical error of the level of the 500 Hz octave"),
    "contact_time_error": Quantity("contact_time_error", "error of contact time", "", "s", "ms", 1000.0, 3, "numerical error of the contact time"),
    "restitution_error": Quantity("restitution_error", "error of restitution", "", "", "", 1.0, 4, "numerical error of the coefficient of restitution"),
    "peak_force_error": Quantity("peak_force_error", "error of peak force", "", "N", "N", 1.0, 1, "numerical error of the maximum force on the floor"),
    "peak_count": Quantity("peak_count", "force peaks", "", "", "", 1.0, 0, "number of peaks of the assessed force"),
    "mass": Quantity("mass", "mass", "M", "kg", "kg", 1.0, 3, "mass of the source"),
    "drop_height": Quantity("drop_height", "drop height", "h", "m", "m", 1.0, 3, "drop height"),
    "effective_mass": Quantity("effective_mass", "effective mass", "M", "kg", "kg", 1.0, 3, "impulse divided by the change of velocity"),
    "margin": Quantity("margin", "margin", "", "dB", "dB", 1.0, 2, "minimum distance of the assessed octave levels to limits, > 0 inside"),
    "floor_work": Quantity("floor_work", "energy to the floor", "W", "J", "mJ", 1000.0, 1, "energy that the source gives to the floor"),
    "room_rating": Quantity("room_rating", "level in the room", "L_{iA,Fmax}", "dB", "dB", 1.0, 1, "A-weighted maximum Fast level in the room, re 20 uPa"),
    "standardized_rating": Quantity("standardized_rating", "standardized level", "L'_{iA,Fmax,V,T}", "dB", "dB", 1.0, 1, "A-weighted maximum Fast level, standardized, re 20 uPa"),
}

# Those of them that describe a single impact, and each of many samples.
IMPACT_QUANTITIES = tuple(QUANTITIES)[:20]
SAMPLE_QUANTITIES = tuple(QUANTITIES)[:6]

# Nominal and exact mid frequencies, and edges of the bands of each set, Hz.
BANDS: dict[BandSet, dict[str, tuple[float, ...]]] = {
    "octave": {"nominal": (31.5, 63.0, 125.0, 250.0, 500.0), "center": (31.622776601683793, 63.09573444801933, 125.89254117941672, 251.188643150958, 501.18723362727224), "lower": (22.3872113856834, 44.6683592150963, 89.12509381337455, 177.8279410038923, 354.8133892335755), "upper": (44.6683592150963, 89.12509381337455, 177.8279410038923, 354.8133892335755, 707.9457843841379)},
    "third": {"nominal": (25.0, 31.5, 40.0, 50.0, 63.0, 80.0, 100.0, 125.0, 160.0, 200.0, 250.0, 315.0, 400.0, 500.0, 630.0), "center": (25.118864315095795, 31.622776601683793, 39.810717055349734, 50.11872336272722, 63.09573444801933, 79.43282347242814, 100.0, 125.89254117941672, 158.48931924611134, 199.526231496888, 251.188643150958, 316.22776601683796, 398.1071705534972, 501.18723362727224, 630.9573444801932), "lower": (22.3872113856834, 28.183829312644537, 35.48133892335755, 44.6683592150963, 56.23413251903491, 70.79457843841381, 89.12509381337455, 112.20184543019636, 141.25375446227545, 177.8279410038923, 223.87211385683395, 281.83829312644536, 354.8133892335755, 446.68359215096314, 562.341325190349), "upper": (28.183829312644537, 35.48133892335755, 44.6683592150963, 56.23413251903491, 70.79457843841381, 89.12509381337455, 112.20184543019636, 141.25375446227545, 177.8279410038923, 223.87211385683395, 281.83829312644536, 354.8133892335755, 446.68359215096314, 562.341325190349, 707.9457843841379)},
}

# Nominal frequencies of the bands of each set that a rating is made of, Hz.
RATED_BANDS: dict[BandSet, tuple[float, ...]] = {
    "octave": (63.0, 125.0, 250.0, 500.0),
    "third": (50.0, 63.0, 80.0, 100.0, 125.0, 160.0, 200.0, 250.0, 315.0, 400.0, 500.0, 630.0),
}

# Name, unit, lower and upper limit of the criteria of each source.
LIMITS: dict[LimitsSource, tuple[tuple[str, str, float, float], ...]] = {
    "rubber_ball": (("octave_31_5", "dB", 38.0, 40.0), ("octave_63", "dB", 29.5, 32.5), ("octave_125", "dB", 21.5, 24.5), ("octave_250", "dB", 15.0, 19.0), ("octave_500", "dB", 10.5, 14.5), ("contact_time", "s", 0.018, 0.022), ("restitution", "", 0.7, 0.9), ("peak_count", "", 1.0, 1.0), ("mass", "kg", 2.4, 2.6), ("drop_height", "m", 0.99, 1.01)),
    "tyre": (("octave_31_5", "dB", 46.0, 48.0), ("octave_63", "dB", 38.5, 41.5), ("octave_125", "dB", 20.5, 23.5), ("octave_250", "dB", 9.5, 13.5), ("octave_500", "dB", 3.5, 7.5), ("contact_time", "s", 0.018, 0.022), ("restitution", "", 0.7, 0.9), ("peak_count", "", 1.0, 1.0), ("mass", "kg", 7.1, 7.5), ("drop_height", "m", 0.84, 0.86)),
}

# Verdicts on a criterion, a source or a room.
VERDICTS = ("conforms", "does not conform", "undecided")

# Maximum A-weighted levels of the classes 1, 2, ... of KS F 2863-2, dB.
CLASS_LIMITS = (37.0, 41.0, 45.0, 49.0)

# Probability from which a requirement on a rating is met.
MET_FROM = 0.84

# Single-number ratings of a level in a room, with symbols, bands and standards.
RATINGS: dict[RoomRating, str] = {
    "octaves": "L_iA,Fmax of octaves (KS F ISO 717-2)",
    "thirds": "L_iA,Fmax of one-third octaves (ISO 717-2)",
    "standardized": "standardized L_iA,Fmax of one-third octaves (ISO 16283-2)",
}

# Values of the standard ball by model and key; without a model for free modes alone.
STANDARD_BALL: dict[tuple[str, str], float] = {
    ("", "youngs_modulus"): 2060000.0,
    ("", "poisson_ratio"): 0.5,
    ("modal_ball", "youngs_modulus"): 1560000.0,
    ("modal_ball", "poisson_ratio"): 0.5,
    ("modal_ball", "loss_factor"): 0.31,
    ("modal_ball", "loss_frequency"): 74.0,
    ("finite_element", "youngs_modulus"): 2060000.0,
    ("finite_element", "poisson_ratio"): 0.5,
    ("finite_element", "loss_factor"): 0.21,
    ("finite_element", "loss_frequency"): 74.0,
    ("finite_element", "fractional_order"): 0.75,
    ("finite_element", "friction"): 0.0,
    ("hollow_sphere", "youngs_modulus"): 1600000.0,
    ("hollow_sphere", "poisson_ratio"): 0.5,
    ("measured_modes", "youngs_modulus"): 1560000.0,
    ("measured_modes", "poisson_ratio"): 0.5,
    ("hunt_crossley", "youngs_modulus"): 1560000.0,
    ("hunt_crossley", "poisson_ratio"): 0.5,
    ("two_mass", "youngs_modulus"): 1560000.0,
    ("two_mass", "poisson_ratio"): 0.5,
}

# Every key, in the order of an input file.
KEYS = (
    Key("", "case", "name", "text", "", "name of the case and of its output directory"),
    Key("", "ball", "outer_radius", "real", "m", "outer radius", (), 0.0, 10.0, lower_open=True),
    Key("", "ball", "wall_thickness", "real", "m", "wall thickness, less than the outer radius", (), 0.0, "outer_radius", lower_open=True, upper_open=True),
    Key("", "ball", "mass", "real", "kg", "mass", (), 1e-12, 1000000.0),
    Key("", "ball", "youngs_modulus", "real", "Pa", "modulus of elasticity", (), 0.0, 10000000000000.0, lower_open=True),
    Key("", "ball", "poisson_ratio", "real", "", "Poisson's ratio", (), -1.0, 0.5, lower_open=True),
    Key("", "ball", "gauge_pressure", "real", "Pa", "overpressure of the gas in the undeformed ball", (), 0.0, 100000000.0),
    Key("", "ball", "ambient_pressure", "real", "Pa", "pressure of the air around the ball", (), 0.0, 100000000.0),
    Key("", "ball", "heat_capacity_ratio", "real", "", "ratio of specific heats of the enclosed gas", (), 1.0, 2.0),
    Key("modes", "modes", "count", "whole", "", "number of elastic free modes", (), 1.0, 100.0, True),
    Key("compression", "compression", "max_deflection", "real", "m", "maximum approach of the plates", (), 1e-15, 10.0),
    Key("compression", "compression", "points", "whole", "", "number of points of the curve, including the undeformed ball", (), 2.0, 10000.0, True),
    Key("compression", "compression", "gas", "choice", "", "gas in the ball: leaves through the hole (vented), or is sealed in", ('vented', 'isothermal', 'adiabatic')),
    Key("", "drop", "height", "real", "m", "height of the ball's lowest point above the floor", (), 1e-12, 1000000.0),
    Key("", "drop", "gravity", "real", "m/s2", "acceleration of free fall", (), 1e-12, 1000.0),
    Key("", "model", "name", "choice", "", "source model", ('modal_ball', 'finite_element', 'hollow_sphere', 'measured_modes', 'hunt_crossley', 'two_mass')),
    Key("modal_ball", "modal_ball", "highest_frequency", "real", "Hz", "highest frequency of oscillating modes; faster ones follow without inertia; 0: automatic", (), 0.0, 20000.0),
    Key("modal_ball", "modal_ball", "rings", "whole", "", "number of rings on the surface, from the lowest point to 60 degrees; 0: automatic", (), 0.0, 400.0, True),
    Key("modal_ball", "modal_ball", "damping_law", "choice", "", "damping law: loss factor as a function of frequency", ('constant', 'rising', 'fractional')),
    Key("modal_ball", "modal_ball", "loss_factor", "real", "", "loss factor, twice the damping ratio", (), 0.0, 1.9, needs=('damping_law', 'rising', 'fractional', 'constant')),
    Key("modal_ball", "modal_ball", "loss_frequency", "real", "Hz", "frequency at which loss_factor (rising, fractional) and the modulus (fractional) apply", (), 0.1, 100000.0, needs=('damping_law', 'rising', 'fractional')),
    Key("modal_ball", "modal_ball", "fractional_order", "real", "", "order of the derivative, for fractional; 1: as rising", (), 0.0, 1.0, lower_open=True, needs=('damping_law', 'fractional')),
    Key("modal_ball", "modal_ball", "cavity_gas", "flag", "", "the gas in the cavity resists volume changes"),
    Key("modal_ball", "modal_ball", "contact_gravity", "flag", "", "gravity acts also during the contact"),
    Key("modal_ball", "modal_ball", "floor_friction", "choice", "", "friction of the floor: none or infinite (sticking)", ('none', 'stick')),
    Key("modal_ball", "modal_ball", "static_families", "list", "", "harmonics treated as quasi-static", (), 0.0, 400.0, True),
    Key("finite_element", "finite_element", "bounces", "whole", "", "number of contacts to compute", (), 1.0, 100.0, True),
    Key("finite_element", "finite_element", "flight_before", "real", "s", "duration of free flight before first touch", (), 0.0, 1.0),
    Key("finite_element", "finite_element", "flight_after", "real", "s", "duration of free flight after the last contact", (), 0.0, 10.0),
    Key("finite_element", "finite_element", "step_safety", "real", "", "time step divided by a bound on stable steps", (), 0.01, 0.98),
    Key("finite_element", "mesh", "radial_elements", "whole", "", "number of elements through the wall; 0: automatic", (), 0.0, 64.0, True),
    Key("finite_element", "mesh", "polar_elements", "whole", "", "number of elements from pole to pole, from 8; 0: automatic", (), 0.0, 1024.0, True),
    Key("finite_element", "material", "law", "choice", "", "law of elasticity", ('neo_hookean', 'mooney_rivlin')),
    Key("finite_element", "material", "mooney_share", "real", "", "second-invariant fraction of the shear modulus, for mooney_rivlin", (), 0.0, 1.0, needs=('law', 'mooney_rivlin')),
    Key("finite_element", "material", "bulk_ratio", "real", "", "maximum ratio of bulk to shear modulus; lower if Poisson's ratio implies a lower one", (), 2.0, 100000.0),
    Key("finite_element", "material", "viscosity", "choice", "", "law of viscosity", ('none', 'kelvin_voigt', 'fractional', 'constant_loss', 'prony')),
    Key("finite_element", "material", "loss_factor", "real", "", "loss factor: at loss_frequency (kelvin_voigt, fractional), or from 10 to 1000 Hz (constant_loss)", (), 0.0, 1.0, lower_open=True, needs=('viscosity', 'fractional', 'kelvin_voigt', 'constant_loss')),
    Key("finite_element", "material", "loss_frequency", "real", "Hz", "frequency at which the ball's modulus is the storage modulus", (), 1.0, 10000.0, needs=('viscosity', 'fractional', 'kelvin_voigt', 'constant_loss', 'prony')),
    Key("finite_element", "material", "fractional_order", "real", "", "order of the derivative, for fractional; 1: as kelvin_voigt", (), 0.0, 1.0, lower_open=True, needs=('viscosity', 'fractional')),
    Key("finite_element", "material", "prony_share", "list", "", "moduli of the branches divided by the long-term modulus, for prony", (), 0.0, 1000.0, needs=('viscosity', 'prony')),
    Key("finite_element", "material", "prony_time", "list", "s", "relaxation times of the branches, for prony", (), 0.0, 1000.0, lower_open=True, needs=('viscosity', 'prony')),
    Key("finite_element", "contact", "friction", "real", "", "coefficient of friction between ball and floor", (), 0.0, 100.0),
    Key("finite_element", "contact", "layer_stiffness", "real", "N/m3", "stiffness per area of a thin layer on the floor; 0: hard floor without a layer", (), 0.0, 10000000000000.0),
    Key("finite_element", "output", "snapshot_interval", "real", "s", "time between snapshots of the deformed ball; 0: none", (), 0.0, 10.0),
    Key("hollow_sphere", "hollow_sphere", "momentum_flux", "choice", "", "term for the momentum of wall that enters or leaves the flat cap", ('momentum_balance', 'retarding', 'conservative', 'none')),
    Key("measured_modes", "measured_modes", "frequency", "list", "Hz", "natural frequencies of the ball on the floor", (), 0.001, 1000000.0),
    Key("measured_modes", "measured_modes", "damping_ratio", "list", "", "damping ratios, one per mode", (), 0.0, 1.0, upper_open=True),
    Key("measured_modes", "measured_modes", "effective_mass", "list", "kg", "effective masses, one per mode", (), 1e-12, 1000000.0),
    Key("measured_modes", "measured_modes", "allow_mass_mismatch", "flag", "", "effective masses need not add up to the mass of the ball"),
    Key("hunt_crossley", "hunt_crossley", "stiffness", "real", "", "contact stiffness, N/m^exponent; 0: derived from contact_time", (), 0.0, 1000000000000000.0),
    Key("hunt_crossley", "hunt_crossley", "contact_time", "real", "s", "target contact time; 0: derived from stiffness", (), 0.0, 10.0),
    Key("hunt_crossley", "hunt_crossley", "exponent", "real", "", "exponent of the deflection in the contact force", (), 1.0, 5.0),
    Key("hunt_crossley", "hunt_crossley", "damping", "real", "s/m", "damping coefficient alpha; 0: derived from restitution", (), 0.0, 100.0),
    Key("hunt_crossley", "hunt_crossley", "restitution", "real", "", "target coefficient of restitution; 0: derived from damping", (), 0.0, 1.0),
    Key("two_mass", "two_mass", "belt_mass", "real", "kg", "mass of belt and tread, less than the mass of the source", (), 0.0, 1000000.0, lower_open=True, upper_open=True),
    Key("two_mass", "two_mass", "inflation_pressure", "real", "Pa", "inflation pressure", (), 0.0, 100000000.0),
    Key("two_mass", "two_mass", "contact_width", "real", "m", "contact area divided by deflection of the contact patch", (), 0.0, 100.0),
    Key("two_mass", "two_mass", "carcass_stiffness", "real", "N/m", "force of the carcass divided by its deflection, at 20 mm", (), 0.0, 1000000000000.0),
    Key("two_mass", "two_mass", "carcass_exponent", "real", "", "exponent of the deflection in the force of the carcass", (), 1.5, 5.0),
    Key("two_mass", "two_mass", "contact_damping", "real", "s/m", "damping force of the contact divided by elastic force and velocity", (), 0.0, 100.0),
    Key("two_mass", "two_mass", "belt_frequency", "real", "Hz", "natural frequency of the belt on the sidewall with fixed rim", (), 0.0, 1000000.0, lower_open=True),
    Key("two_mass", "two_mass", "belt_damping", "real", "", "damping ratio of the belt on the sidewall with fixed rim", (), 0.0, 10.0),
    Key("", "sampling", "sample_rate", "real", "Hz", "samples per second; from 16000 with finite_element", (), 2000.0, 10000000.0),
    Key("", "sampling", "duration", "real", "s", "duration of the record from first touch", (), 0.001, 10.0),
    Key("", "sampling", "substeps", "whole", "", "integration steps per sampling interval", (), 1.0, 10000.0, True),
    Key("", "sampling", "verify", "flag", "", "compute again at a finer resolution, and state the changes"),
    Key("", "levels", "method", "choice", "", "method of computing the levels", ('exact', 'fft')),
    Key("", "levels", "bands", "choice", "", "bands of levels.csv", ('octave', 'third', 'both')),
    Key("", "levels", "force", "choice", "", "assessed force, for which levels, peak force and verdict are reported", ('floor', 'elastic')),
    Key("", "limits", "source", "choice", "", "source whose limits apply", ('rubber_ball', 'tyre')),
    Key("unknowns", "unknowns", "key", "texts", "", "keys of ball, drop and model whose values are not known"),
    Key("unknowns", "unknowns", "low", "list", "", "their minima, in the units of the keys", (), -1e+30, 1e+30),
    Key("unknowns", "unknowns", "high", "list", "", "their maxima", (), -1e+30, 1e+30),
    Key("unknowns", "unknowns", "standard_deviation", "list", "", "standard deviations around the values of the case, truncated by low and high; 0: uniform", (), 0.0, 1e+30),
    Key("unknowns", "unknowns", "reason", "texts", "", "reasons of the ranges, with their sources"),
    Key("floor", "floor", "name", "choice", "", "floor under the source", ('rigid', 'infinite_plate', 'oscillator', 'plate', 'laminate_floor', 'joist_floor', 'measured_mobility', 'modal_floor')),
    Key("infinite_plate", "infinite_plate", "resistance", "real", "N s/m", "driving-point resistance: force divided by velocity", (), 1.0, 1000000000000000.0),
    Key("oscillator", "oscillator", "mass", "real", "kg", "moving mass under the source", (), 0.001, 1000000000000.0),
    Key("oscillator", "oscillator", "stiffness", "real", "N/m", "stiffness of the support", (), 0.0, 1000000000000000.0),
    Key("oscillator", "oscillator", "damping", "real", "N s/m", "damping coefficient of the support", (), 0.0, 1000000000000.0),
    Key("plate", "plate", "length", "real", "m", "length of the floor", (), 0.5, 100.0),
    Key("plate", "plate", "width", "real", "m", "width of the floor", (), 0.5, 100.0),
    Key("plate", "plate", "thickness", "real", "m", "thickness of the floor", (), 0.001, 2.0),
    Key("plate", "plate", "density", "real", "kg/m3", "density of the floor", (), 10.0, 20000.0),
    Key("plate", "plate", "wave_speed", "real", "m/s", "speed of longitudinal waves in the floor", (), 100.0, 10000.0),
    Key("plate", "plate", "stiffness_ratio", "real", "", "ratio of the bending stiffness along the width to that along the length", (), 0.0001, 10000.0),
    Key("plate", "plate", "torsion_ratio", "real", "", "ratio of the twisting stiffness to the geometric mean of both bending stiffnesses", (), 0.0, 1.0),
    Key("plate", "plate", "loss_factor", "real", "", "internal loss factor of the floor", (), 0.0, 1.0),
    Key("plate", "plate", "edges", "choice", "", "losses at the edges of the floor", ('building', 'laboratory', 'absorption')),
    Key("plate", "plate", "edge_absorption", "real", "m", "sum of edge lengths times absorption coefficients, for absorption", (), 0.0, 1000.0),
    Key("plate", "plate", "source_x", "real", "", "relative source position along the length; levels in the room are means over positions", (), 0.0, 1.0, lower_open=True, upper_open=True),
    Key("plate", "plate", "source_y", "real", "", "relative source position along the width", (), 0.0, 1.0, lower_open=True, upper_open=True),
    Key("plate", "plate", "support", "choice", "", "support of the edges", ('unknown', 'simple', 'clamped', 'free', 'elastic')),
    Key("plate", "plate", "support_stiffness", "list", "N/m2", "stiffness of elastic edges against deflection per length: 1 value, or 4 (x at 0 and length, y at 0 and width)", (), 0.0, 100000000000000.0, needs=('support', 'elastic')),
    Key("plate", "plate", "support_rotation", "list", "N", "stiffness of elastic edges against rotation per length: 1 or 4 values", (), 0.0, 100000000000000.0, needs=('support', 'elastic')),
    Key("plate", "plate", "line_x", "list", "m", "positions along the length of walls or beams on which the floor rests", (), 0.0, 100.0, lower_open=True, upper_open=True),
    Key("plate", "plate", "line_y", "list", "m", "positions along the width of walls or beams on which the floor rests", (), 0.0, 100.0, lower_open=True, upper_open=True),
    Key("plate", "plate", "screed_thickness", "real", "m", "thickness of a floating plate; 0: none", (), 0.0, 0.5),
    Key("plate", "plate", "screed_density", "real", "kg/m3", "density of the floating plate", (), 10.0, 20000.0, needs=('screed_thickness',)),
    Key("plate", "plate", "screed_wave_speed", "real", "m/s", "speed of longitudinal waves in the floating plate", (), 100.0, 10000.0, needs=('screed_thickness',)),
    Key("plate", "plate", "screed_loss_factor", "real", "", "loss factor of the floating plate", (), 0.0, 1.0, needs=('screed_thickness',)),
    Key("plate", "plate", "layer_stiffness", "real", "N/m3", "dynamic stiffness of the resilient layer per unit area (ISO 9052-1)", (), 10000.0, 1000000000000.0, needs=('screed_thickness',)),
    Key("plate", "plate", "layer_loss_factor", "real", "", "loss factor of the resilient layer", (), 0.0, 1.0, needs=('screed_thickness',)),
    Key("plate", "plate", "subceiling_thickness", "real", "m", "thickness of a subceiling that radiates instead of the floor; 0: none", (), 0.0, 0.2),
    Key("plate", "plate", "subceiling_density", "real", "kg/m3", "density of the subceiling", (), 10.0, 20000.0, needs=('subceiling_thickness',)),
    Key("plate", "plate", "subceiling_modulus", "real", "Pa", "modulus of elasticity of the subceiling in bending", (), 10000000.0, 1000000000000.0, needs=('subceiling_thickness',)),
    Key("plate", "plate", "subceiling_loss_factor", "real", "", "loss factor of the subceiling", (), 0.0, 1.0, needs=('subceiling_thickness',)),
    Key("plate", "plate", "channel_stiffness", "real", "N/m2", "stiffness per length of each line that holds the subceiling (channels, battens, hangers)", (), 0.0, 1000000000000.0, needs=('subceiling_thickness',)),
    Key("plate", "plate", "channel_loss_factor", "real", "", "loss factor of these lines", (), 0.0, 1.0, needs=('subceiling_thickness',)),
    Key("plate", "plate", "cavity_depth", "real", "m", "depth of the air between floor and subceiling", (), 0.005, 2.0, needs=('subceiling_thickness',)),
    Key("plate", "plate", "cavity_loss_factor", "real", "", "loss factor of this air, high with absorber in it", (), 0.0, 1.0, needs=('subceiling_thickness',)),
    Key("plate", "plate", "channel_spacing", "real", "m", "distance of the lines that hold the subceiling, which run along the length", (), 0.05, 100.0, needs=('subceiling_thickness',)),
    Key("plate", "plate", "covering_stiffness", "real", "N/m", "stiffness of a covering under the source; 0: none", (), 0.0, 1000000000000.0),
    Key("plate", "plate", "covering_loss_factor", "real", "", "loss factor of the covering at 50 Hz", (), 0.01, 2.0, needs=('covering_stiffness',)),
    Key("plate", "plate", "covering_improvement", "list", "dB", "measured reduction of heavy impact sound by a covering, in octaves 63 to 500 Hz or one-third octaves 50 to 630 Hz", (), -30.0, 60.0),
    Key("plate", "plate", "point_x", "list", "m", "positions along the length of points whose velocity is computed", (), 0.0, 1000.0),
    Key("plate", "plate", "point_y", "list", "m", "positions of these points along the width", (), 0.0, 1000.0),
    Key("laminate_floor", "laminate_floor", "length", "real", "m", "length of the floor, along the grain of the first layer", (), 0.5, 100.0),
    Key("laminate_floor", "laminate_floor", "width", "real", "m", "width of the floor", (), 0.5, 100.0),
    Key("laminate_floor", "laminate_floor", "layer_thickness", "list", "m", "thicknesses of the crossed layers from the top (default: 40, 20, 40, 20, 40 mm)", (), 0.003, 0.5),
    Key("laminate_floor", "laminate_floor", "youngs_modulus", "real", "Pa", "modulus of elasticity along the grain", (), 100000000.0, 1000000000000.0),
    Key("laminate_floor", "laminate_floor", "cross_modulus", "real", "Pa", "modulus of elasticity across the grain", (), 0.0, 1000000000000.0),
    Key("laminate_floor", "laminate_floor", "shear_modulus", "real", "Pa", "shear modulus along the grain", (), 1000000.0, 1000000000000.0),
    Key("laminate_floor", "laminate_floor", "rolling_shear_modulus", "real", "Pa", "modulus of rolling shear", (), 1000000.0, 1000000000000.0),
    Key("laminate_floor", "laminate_floor", "torsion_factor", "real", "", "fraction of the torsional stiffness that joints between boards leave", (), 0.0, 1.0),
    Key("laminate_floor", "laminate_floor", "density", "real", "kg/m3", "density of the layers", (), 10.0, 20000.0),
    Key("laminate_floor", "laminate_floor", "added_mass", "real", "kg/m2", "mass without stiffness on the plate, as gravel", (), 0.0, 1000.0),
    Key("laminate_floor", "laminate_floor", "loss_factor", "real", "", "loss factor of the floor including its edges, without radiation", (), 0.0, 1.0, lower_open=True),
    Key("laminate_floor", "laminate_floor", "source_x", "real", "", "relative source position along the length; levels in the room are means over positions", (), 0.0, 1.0, lower_open=True, upper_open=True),
    Key("laminate_floor", "laminate_floor", "source_y", "real", "", "relative source position along the width", (), 0.0, 1.0, lower_open=True, upper_open=True),
    Key("laminate_floor", "laminate_floor", "support", "choice", "", "support of the edges", ('unknown', 'simple', 'clamped', 'free', 'elastic')),
    Key("laminate_floor", "laminate_floor", "support_stiffness", "list", "N/m2", "stiffness of elastic edges against deflection per length: 1 value, or 4 (x at 0 and length, y at 0 and width)", (), 0.0, 100000000000000.0, needs=('support', 'elastic')),
    Key("laminate_floor", "laminate_floor", "support_rotation", "list", "N", "stiffness of elastic edges against rotation per length: 1 or 4 values", (), 0.0, 100000000000000.0, needs=('support', 'elastic')),
    Key("laminate_floor", "laminate_floor", "line_x", "list", "m", "positions along the length of walls or beams on which the floor rests", (), 0.0, 100.0, lower_open=True, upper_open=True),
    Key("laminate_floor", "laminate_floor", "line_y", "list", "m", "positions along the width of walls or beams on which the floor rests", (), 0.0, 100.0, lower_open=True, upper_open=True),
    Key("laminate_floor", "laminate_floor", "screed_thickness", "real", "m", "thickness of a floating plate; 0: none", (), 0.0, 0.5),
    Key("laminate_floor", "laminate_floor", "screed_density", "real", "kg/m3", "density of the floating plate", (), 10.0, 20000.0, needs=('screed_thickness',)),
    Key("laminate_floor", "laminate_floor", "screed_wave_speed", "real", "m/s", "speed of longitudinal waves in the floating plate", (), 100.0, 10000.0, needs=('screed_thickness',)),
    Key("laminate_floor", "laminate_floor", "screed_loss_factor", "real", "", "loss factor of the floating plate", (), 0.0, 1.0, needs=('screed_thickness',)),
    Key("laminate_floor", "laminate_floor", "layer_stiffness", "real", "N/m3", "dynamic stiffness of the resilient layer per unit area (ISO 9052-1)", (), 10000.0, 1000000000000.0, needs=('screed_thickness',)),
    Key("laminate_floor", "laminate_floor", "layer_loss_factor", "real", "", "loss factor of the resilient layer", (), 0.0, 1.0, needs=('screed_thickness',)),
    Key("laminate_floor", "laminate_floor", "subceiling_thickness", "real", "m", "thickness of a subceiling that radiates instead of the floor; 0: none", (), 0.0, 0.2),
    Key("laminate_floor", "laminate_floor", "subceiling_density", "real", "kg/m3", "density of the subceiling", (), 10.0, 20000.0, needs=('subceiling_thickness',)),
    Key("laminate_floor", "laminate_floor", "subceiling_modulus", "real", "Pa", "modulus of elasticity of the subceiling in bending", (), 10000000.0, 1000000000000.0, needs=('subceiling_thickness',)),
    Key("laminate_floor", "laminate_floor", "subceiling_loss_factor", "real", "", "loss factor of the subceiling", (), 0.0, 1.0, needs=('subceiling_thickness',)),
    Key("laminate_floor", "laminate_floor", "channel_stiffness", "real", "N/m2", "stiffness per length of each line that holds the subceiling (channels, battens, hangers)", (), 0.0, 1000000000000.0, needs=('subceiling_thickness',)),
    Key("laminate_floor", "laminate_floor", "channel_loss_factor", "real", "", "loss factor of these lines", (), 0.0, 1.0, needs=('subceiling_thickness',)),
    Key("laminate_floor", "laminate_floor", "cavity_depth", "real", "m", "depth of the air between floor and subceiling", (), 0.005, 2.0, needs=('subceiling_thickness',)),
    Key("laminate_floor", "laminate_floor", "cavity_loss_factor", "real", "", "loss factor of this air, high with absorber in it", (), 0.0, 1.0, needs=('subceiling_thickness',)),
    Key("laminate_floor", "laminate_floor", "channel_spacing", "real", "m", "distance of the lines that hold the subceiling, which run along the length", (), 0.05, 100.0, needs=('subceiling_thickness',)),
    Key("laminate_floor", "laminate_floor", "covering_stiffness", "real", "N/m", "stiffness of a covering under the source; 0: none", (), 0.0, 1000000000000.0),
    Key("laminate_floor", "laminate_floor", "covering_loss_factor", "real", "", "loss factor of the covering at 50 Hz", (), 0.01, 2.0, needs=('covering_stiffness',)),
    Key("laminate_floor", "laminate_floor", "covering_improvement", "list", "dB", "measured reduction of heavy impact sound by a covering, in octaves 63 to 500 Hz or one-third octaves 50 to 630 Hz", (), -30.0, 60.0),
    Key("laminate_floor", "laminate_floor", "point_x", "list", "m", "positions along the length of points whose velocity is computed", (), 0.0, 1000.0),
    Key("laminate_floor", "laminate_floor", "point_y", "list", "m", "positions of these points along the width", (), 0.0, 1000.0),
    Key("joist_floor", "joist_floor", "length", "real", "m", "span of the joists", (), 0.5, 100.0),
    Key("joist_floor", "joist_floor", "width", "real", "m", "width of the floor across the joists", (), 0.5, 100.0),
    Key("joist_floor", "joist_floor", "sheathing_thickness", "real", "m", "thickness of the sheathing", (), 0.003, 0.3),
    Key("joist_floor", "joist_floor", "sheathing_density", "real", "kg/m3", "density of the sheathing", (), 10.0, 20000.0),
    Key("joist_floor", "joist_floor", "sheathing_modulus", "real", "Pa", "modulus of elasticity of the sheathing in bending", (), 10000000.0, 1000000000000.0),
    Key("joist_floor", "joist_floor", "spacing", "real", "m", "distance between the axes of adjacent joists", (), "joist_width", "width", lower_open=True, upper_open=True),
    Key("joist_floor", "joist_floor", "joist_width", "real", "m", "width of a joist", (), 0.005, 1.0),
    Key("joist_floor", "joist_floor", "joist_height", "real", "m", "height of a joist", (), 0.01, 2.0),
    Key("joist_floor", "joist_floor", "joist_density", "real", "kg/m3", "density of the joists", (), 10.0, 20000.0),
    Key("joist_floor", "joist_floor", "joist_modulus", "real", "Pa", "modulus of elasticity of the joists", (), 10000000.0, 1000000000000.0),
    Key("joist_floor", "joist_floor", "connection", "real", "", "composite action of sheathing and joists over the span, 0 (loose) to 1 (glued), EN 1995-1-1 annex B", (), 0.0, 1.0),
    Key("joist_floor", "joist_floor", "loss_factor", "real", "", "loss factor of the floor including its edges, without radiation", (), 0.0, 1.0, lower_open=True),
    Key("joist_floor", "joist_floor", "source_x", "real", "", "relative source position along the length; levels in the room are means over positions", (), 0.0, 1.0, lower_open=True, upper_open=True),
    Key("joist_floor", "joist_floor", "source_y", "real", "", "relative source position along the width", (), 0.0, 1.0, lower_open=True, upper_open=True),
    Key("joist_floor", "joist_floor", "source_on", "choice", "", "impact location: midway between the next joists, on the next joist, or exactly the position", ('sheathing', 'joist', 'position')),
    Key("joist_floor", "joist_floor", "support", "choice", "", "support of the edges", ('unknown', 'simple', 'clamped', 'free', 'elastic')),
    Key("joist_floor", "joist_floor", "support_stiffness", "list", "N/m2", "stiffness of elastic edges against deflection per length: 1 value, or 4 (x at 0 and length, y at 0 and width)", (), 0.0, 100000000000000.0, needs=('support', 'elastic')),
    Key("joist_floor", "joist_floor", "support_rotation", "list", "N", "stiffness of elastic edges against rotation per length: 1 or 4 values", (), 0.0, 100000000000000.0, needs=('support', 'elastic')),
    Key("joist_floor", "joist_floor", "line_x", "list", "m", "positions along the length of walls or beams on which the floor rests", (), 0.0, 100.0, lower_open=True, upper_open=True),
    Key("joist_floor", "joist_floor", "line_y", "list", "m", "positions along the width of walls or beams on which the floor rests", (), 0.0, 100.0, lower_open=True, upper_open=True),
    Key("joist_floor", "joist_floor", "screed_thickness", "real", "m", "thickness of a floating plate; 0: none", (), 0.0, 0.5),
    Key("joist_floor", "joist_floor", "screed_density", "real", "kg/m3", "density of the floating plate", (), 10.0, 20000.0, needs=('screed_thickness',)),
    Key("joist_floor", "joist_floor", "screed_wave_speed", "real", "m/s", "speed of longitudinal waves in the floating plate", (), 100.0, 10000.0, needs=('screed_thickness',)),
    Key("joist_floor", "joist_floor", "screed_loss_factor", "real", "", "loss factor of the floating plate", (), 0.0, 1.0, needs=('screed_thickness',)),
    Key("joist_floor", "joist_floor", "layer_stiffness", "real", "N/m3", "dynamic stiffness of the resilient layer per unit area (ISO 9052-1)", (), 10000.0, 1000000000000.0, needs=('screed_thickness',)),
    Key("joist_floor", "joist_floor", "layer_loss_factor", "real", "", "loss factor of the resilient layer", (), 0.0, 1.0, needs=('screed_thickness',)),
    Key("joist_floor", "joist_floor", "subceiling_thickness", "real", "m", "thickness of a subceiling that radiates instead of the floor; 0: none", (), 0.0, 0.2),
    Key("joist_floor", "joist_floor", "subceiling_density", "real", "kg/m3", "density of the subceiling", (), 10.0, 20000.0, needs=('subceiling_thickness',)),
    Key("joist_floor", "joist_floor", "subceiling_modulus", "real", "Pa", "modulus of elasticity of the subceiling in bending", (), 10000000.0, 1000000000000.0, needs=('subceiling_thickness',)),
    Key("joist_floor", "joist_floor", "subceiling_loss_factor", "real", "", "loss factor of the subceiling", (), 0.0, 1.0, needs=('subceiling_thickness',)),
    Key("joist_floor", "joist_floor", "channel_stiffness", "real", "N/m2", "stiffness per length of each line that holds the subceiling (channels, battens, hangers)", (), 0.0, 1000000000000.0, needs=('subceiling_thickness',)),
    Key("joist_floor", "joist_floor", "channel_loss_factor", "real", "", "loss factor of these lines", (), 0.0, 1.0, needs=('subceiling_thickness',)),
    Key("joist_floor", "joist_floor", "cavity_depth", "real", "m", "depth of the air between floor and subceiling", (), 0.005, 2.0, needs=('subceiling_thickness',)),
    Key("joist_floor", "joist_floor", "cavity_loss_factor", "real", "", "loss factor of this air, high with absorber in it", (), 0.0, 1.0, needs=('subceiling_thickness',)),
    Key("joist_floor", "joist_floor", "covering_stiffness", "real", "N/m", "stiffness of a covering under the source; 0: none", (), 0.0, 1000000000000.0),
    Key("joist_floor", "joist_floor", "covering_loss_factor", "real", "", "loss factor of the covering at 50 Hz", (), 0.01, 2.0, needs=('covering_stiffness',)),
    Key("joist_floor", "joist_floor", "covering_improvement", "list", "dB", "measured reduction of heavy impact sound by a covering, in octaves 63 to 500 Hz or one-third octaves 50 to 630 Hz", (), -30.0, 60.0),
    Key("joist_floor", "joist_floor", "point_x", "list", "m", "positions along the length of points whose velocity is computed", (), 0.0, 1000.0),
    Key("joist_floor", "joist_floor", "point_y", "list", "m", "positions of these points along the width", (), 0.0, 1000.0),
    Key("measured_mobility", "measured_mobility", "direct", "real", "m/(N s)", "limit of the mobility at high frequencies", (), 0.0, 1000.0),
    Key("measured_mobility", "measured_mobility", "pole_frequency", "list", "Hz", "magnitudes of the poles divided by 2 pi", (), 1e-06, 10000000.0),
    Key("measured_mobility", "measured_mobility", "damping_ratio", "list", "", "damping ratios of the poles; 1 for a real pole", (), 1e-12, 1.0),
    Key("measured_mobility", "measured_mobility", "residue_real", "list", "m/(N s2)", "real parts of the residues, doubled for a pair of poles", (), -1000000000000.0, 1000000000000.0),
    Key("measured_mobility", "measured_mobility", "residue_imaginary", "list", "m/(N s2)", "imaginary parts of the residues, doubled for a pair of poles", (), -1000000000000.0, 1000000000000.0),
    Key("measured_mobility", "measured_mobility", "lowest_frequency", "real", "Hz", "lowest frequency of the measurement", (), 0.0, "highest_frequency", lower_open=True, upper_open=True),
    Key("measured_mobility", "measured_mobility", "highest_frequency", "real", "Hz", "highest frequency of the measurement", (), 0.0, 10000000.0, lower_open=True),
    Key("measured_mobility", "measured_mobility", "length", "real", "m", "length of the floor", (), 0.5, 100.0),
    Key("measured_mobility", "measured_mobility", "width", "real", "m", "width of the floor", (), 0.5, 100.0),
    Key("measured_mobility", "measured_mobility", "thickness", "real", "m", "thickness of the plate that radiates into a room; 0: none", (), 0.0, 2.0),
    Key("measured_mobility", "measured_mobility", "density", "real", "kg/m3", "density of the floor", (), 10.0, 20000.0),
    Key("measured_mobility", "measured_mobility", "wave_speed", "real", "m/s", "speed of longitudinal waves in the floor", (), 100.0, 10000.0),
    Key("measured_mobility", "measured_mobility", "stiffness_ratio", "real", "", "ratio of the bending stiffness along the width to that along the length", (), 0.0001, 10000.0),
    Key("measured_mobility", "measured_mobility", "torsion_ratio", "real", "", "ratio of the twisting stiffness to the geometric mean of both bending stiffnesses", (), 0.0, 1.0),
    Key("measured_mobility", "measured_mobility", "loss_factor", "real", "", "internal loss factor of the floor", (), 0.0, 1.0),
    Key("measured_mobility", "measured_mobility", "edges", "choice", "", "losses at the edges of the floor", ('building', 'laboratory', 'absorption')),
    Key("measured_mobility", "measured_mobility", "edge_absorption", "real", "m", "sum of edge lengths times absorption coefficients, for absorption", (), 0.0, 1000.0),
    Key("modal_floor", "modal_floor", "file", "text", "", "file of the modes: frequencies, loss factors, shapes on a grid"),
    Key("modal_floor", "modal_floor", "source_x", "real", "", "relative source position along the length; levels in the room are means over positions", (), 0.0, 1.0, lower_open=True, upper_open=True),
    Key("modal_floor", "modal_floor", "source_y", "real", "", "relative source position along the width", (), 0.0, 1.0, lower_open=True, upper_open=True),
    Key("modal_floor", "modal_floor", "residual_compliance", "real", "m/N", "static compliance at the source of the modes above those of the file; 0: that of the plate", (), 0.0, 1.0),
    Key("modal_floor", "modal_floor", "thickness", "real", "m", "thickness of the plate that radiates into a room; 0: none", (), 0.0, 2.0),
    Key("modal_floor", "modal_floor", "density", "real", "kg/m3", "density of the floor", (), 10.0, 20000.0),
    Key("modal_floor", "modal_floor", "wave_speed", "real", "m/s", "speed of longitudinal waves in the floor", (), 100.0, 10000.0),
    Key("modal_floor", "modal_floor", "stiffness_ratio", "real", "", "ratio of the bending stiffness along the width to that along the length", (), 0.0001, 10000.0),
    Key("modal_floor", "modal_floor", "torsion_ratio", "real", "", "ratio of the twisting stiffness to the geometric mean of both bending stiffnesses", (), 0.0, 1.0),
    Key("modal_floor", "modal_floor", "point_x", "list", "m", "positions along the length of points whose velocity is computed", (), 0.0, 1000.0),
    Key("modal_floor", "modal_floor", "point_y", "list", "m", "positions of these points along the width", (), 0.0, 1000.0),
    Key("room", "room", "length", "real", "m", "length of the room; 0: that of the floor", (), 0.0, 100.0),
    Key("room", "room", "width", "real", "m", "width of the room; 0: that of the floor", (), 0.0, 100.0),
    Key("room", "room", "height", "real", "m", "height of the room; 0: from the volume, without it 2.5 m", (), 0.0, 100.0),
    Key("room", "room", "volume", "real", "m3", "volume of the room; 0: length times width times height", (), 0.0, 100000.0),
    Key("room", "room", "reverberation_time", "list", "s", "reverberation time of the room: one, 4 for octaves or 12 for one-third octaves", (), 0.05, 20.0),
    Key("room", "room", "reverberation_of", "choice", "", "room of the reverberation time: finished, or bare, without floor, walls and ceiling", ('finished', 'bare')),
    Key("room", "room", "air_density", "real", "kg/m3", "density of the air", (), 0.5, 2.0),
    Key("room", "room", "sound_speed", "real", "m/s", "speed of sound in the air", (), 200.0, 500.0),
    Key("room", "room", "wall_lengths", "list", "m", "lengths of the flanking walls along the floor (default: no walls)", (), 0.1, 100.0),
    Key("room", "room", "wall_height", "real", "m", "height of the walls", (), 0.5, 20.0, needs=('wall_lengths',)),
    Key("room", "room", "wall_thickness", "list", "m", "thickness of the walls: one, or one for each of wall_lengths", (), 0.005, 2.0, needs=('wall_lengths',)),
    Key("room", "room", "wall_density", "list", "kg/m3", "density of the walls: one, or one for each", (), 10.0, 20000.0, needs=('wall_lengths',)),
    Key("room", "room", "wall_wave_speed", "list", "m/s", "speed of longitudinal waves in the walls: one, or one for each", (), 100.0, 10000.0, needs=('wall_lengths',)),
    Key("room", "room", "wall_loss_factor", "list", "", "internal loss factor of the walls: one, or one for each", (), 0.0, 1.0, needs=('wall_lengths',)),
    Key("room", "room", "wall_junction", "choice", "", "junction of floor and walls: rigid cross or T, or described by junction_index", ('cross', 't', 'index'), needs=('wall_lengths',)),
    Key("room", "room", "junction_index", "list", "dB", "vibration reduction index from floor to wall, for wall_junction index: one, or one for each wall", (), -10.0, 80.0, needs=('wall_junction', 'index')),
    Key("room", "room", "ceiling_mass", "real", "kg/m2", "mass per unit area of a suspended ceiling; 0: none", (), 0.0, 200.0),
    Key("room", "room", "ceiling_depth", "real", "m", "depth of the air cavity above the ceiling", (), 0.01, 2.0, needs=('ceiling_mass',)),
    Key("room", "room", "ceiling_loss_factor", "real", "", "loss factor of the ceiling cavity", (), 0.001, 1.0, needs=('ceiling_mass',)),
    Key("room", "room", "corner_x", "real", "m", "position of the room along the length of a larger floor", (), 0.0, 100.0, upper_open=True),
    Key("room", "room", "corner_y", "real", "m", "position of the room along the width of a larger floor", (), 0.0, 100.0, upper_open=True),
    Key("room", "room", "radiation", "choice", "", "radiation factor of the floor, by its modes or by ISO 12354-1", ('modes', 'iso_12354')),
    Key("room", "room", "positions", "choice", "", "positions of ball and microphone: those of the rating, 5 standard ones each (octaves), or 16 even ones each", ('rating', 'standard', 'even')),
    Key("room", "room", "rating", "choice", "", "rating that is asked for (KS F ISO 717-2, ISO 717-2, ISO 16283-2)", ('octaves', 'thirds', 'standardized')),
    Key("room", "room", "required", "real", "dB", "maximum of that rating that is required; 0: none", (), 0.0, 200.0),
)
_CLASSES = {**GROUPS, **OPTIONAL_GROUPS, **MODELS, **FLOORS}
for _name, _class in _CLASSES.items():
    _class.keys = {key.name: key for key in KEYS if (key.owner or key.group) == _name}
