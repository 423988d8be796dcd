"""The calls of `thud.solve` by model, for type checkers.

Made by ``./bootstrap schema`` from ``thud --schema``; do not edit.
"""

from collections.abc import Sequence
from typing import Literal, TypedDict, Unpack, overload

from thud.base._schema import (
    Ball,
    Drop,
    FiniteElementLaw,
    FiniteElementViscosity,
    FloorOptions,
    HollowSphereMomentumFlux,
    ModalBallDampingLaw,
    ModalBallFloorFriction,
    ModelName,
    ModelOptions,
    Room,
)
from thud.case.case import Case
from thud.case.constructions import Construction
from thud.impact.impact import Impact

class SamplingOptions(TypedDict, total=False):
    sample_rate: float
    duration: float
    substeps: int
    verify: bool
    floor: FloorOptions | Construction | str | None
    room: Room | None

class ModalBallOptions(SamplingOptions, total=False):
    highest_frequency: float
    rings: int
    damping_law: ModalBallDampingLaw
    loss_factor: float | None
    loss_frequency: float | None
    fractional_order: float
    cavity_gas: bool
    contact_gravity: bool
    floor_friction: ModalBallFloorFriction
    static_families: Sequence[int]

class FiniteElementOptions(SamplingOptions, total=False):
    bounces: int
    flight_before: float
    flight_after: float
    step_safety: float
    radial_elements: int
    polar_elements: int
    law: FiniteElementLaw
    mooney_share: float
    bulk_ratio: float
    viscosity: FiniteElementViscosity
    loss_factor: float | None
    loss_frequency: float | None
    fractional_order: float | None
    prony_share: Sequence[float]
    prony_time: Sequence[float]
    friction: float | None
    layer_stiffness: float
    snapshot_interval: float

class HollowSphereOptions(SamplingOptions, total=False):
    momentum_flux: HollowSphereMomentumFlux

class MeasuredModesOptions(SamplingOptions, total=False):
    frequency: Sequence[float]
    damping_ratio: Sequence[float]
    effective_mass: Sequence[float]
    allow_mass_mismatch: bool

class HuntCrossleyOptions(SamplingOptions, total=False):
    stiffness: float
    contact_time: float
    exponent: float
    damping: float
    restitution: float

class TwoMassOptions(SamplingOptions, total=False):
    belt_mass: float
    inflation_pressure: float
    contact_width: float
    carcass_stiffness: float
    carcass_exponent: float
    contact_damping: float
    belt_frequency: float
    belt_damping: float

@overload
def solve(ball: Case) -> Impact:
    """Compute the impact of a case."""

@overload
def solve(
    ball: Ball | None = ..., drop: Drop | None = ..., model: Literal["modal_ball"] = ...,
    **options: Unpack[ModalBallOptions],
) -> Impact:
    """Drop a ball on a floor by the model ``modal_ball``."""

@overload
def solve(
    ball: Ball | None, drop: Drop | None, model: Literal["finite_element"],
    **options: Unpack[FiniteElementOptions],
) -> Impact:
    """Drop a ball on a floor by the model ``finite_element``."""

@overload
def solve(
    ball: Ball | None = ..., drop: Drop | None = ..., *, model: Literal["finite_element"],
    **options: Unpack[FiniteElementOptions],
) -> Impact:
    """Drop a ball on a floor by the model ``finite_element``."""

@overload
def solve(
    ball: Ball | None, drop: Drop | None, model: Literal["hollow_sphere"],
    **options: Unpack[HollowSphereOptions],
) -> Impact:
    """Drop a ball on a floor by the model ``hollow_sphere``."""

@overload
def solve(
    ball: Ball | None = ..., drop: Drop | None = ..., *, model: Literal["hollow_sphere"],
    **options: Unpack[HollowSphereOptions],
) -> Impact:
    """Drop a ball on a floor by the model ``hollow_sphere``."""

@overload
def solve(
    ball: Ball | None, drop: Drop | None, model: Literal["measured_modes"],
    **options: Unpack[MeasuredModesOptions],
) -> Impact:
    """Drop a ball on a floor by the model ``measured_modes``."""

@overload
def solve(
    ball: Ball | None = ..., drop: Drop | None = ..., *, model: Literal["measured_modes"],
    **options: Unpack[MeasuredModesOptions],
) -> Impact:
    """Drop a ball on a floor by the model ``measured_modes``."""

@overload
def solve(
    ball: Ball | None, drop: Drop | None, model: Literal["hunt_crossley"],
    **options: Unpack[HuntCrossleyOptions],
) -> Impact:
    """Drop a ball on a floor by the model ``hunt_crossley``."""

@overload
def solve(
    ball: Ball | None = ..., drop: Drop | None = ..., *, model: Literal["hunt_crossley"],
    **options: Unpack[HuntCrossleyOptions],
) -> Impact:
    """Drop a ball on a floor by the model ``hunt_crossley``."""

@overload
def solve(
    ball: Ball | None, drop: Drop | None, model: Literal["two_mass"],
    **options: Unpack[TwoMassOptions],
) -> Impact:
    """Drop a ball on a floor by the model ``two_mass``."""

@overload
def solve(
    ball: Ball | None = ..., drop: Drop | None = ..., *, model: Literal["two_mass"],
    **options: Unpack[TwoMassOptions],
) -> Impact:
    """Drop a ball on a floor by the model ``two_mass``."""

@overload
def solve(
    ball: Ball | None = ..., drop: Drop | None = ..., model: ModelName | ModelOptions = ...,
    **options: Unpack[SamplingOptions],
) -> Impact:
    """Drop a ball on a floor."""
