"""Source models by their options: dataclasses that mirror the namelist groups of each model."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

from thud.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from typing import Any


@dataclass(frozen=True)
class HollowSphere:
    """Options of the paper's analytical model.

    Attributes
    ----------
    momentum_flux : str
        ``"momentum_balance"``, ``"retarding"``, ``"conservative"`` or ``"none"``.
    """

    name: ClassVar[str] = "hollow_sphere"
    momentum_flux: str = "momentum_balance"


@dataclass(frozen=True)
class ModalBall:
    """Options of the modal ball, the improved analytical model.

    Attributes
    ----------
    harmonics : int
        Highest harmonic n whose modes oscillate.
    radial_modes : int
        Modes of each harmonic that oscillate.
    static_harmonics : int
        Highest harmonic whose static flexibility counts.
    rings : int
        Rings of the lower half of the surface; at most half of `static_harmonics`.
    damping_law : str
        ``"constant"`` loss factor, or ``"rising"`` in proportion to frequency.
    loss_factor : float
        Loss factor, twice the damping ratio.
    loss_frequency : float
        Frequency of a rising loss factor, Hz.
    cavity_gas : bool
        The gas in the cavity resists changes of its volume.
    static_families : sequence of int
        Harmonics that answer statically instead of oscillating.
    """

    name: ClassVar[str] = "modal_ball"
    harmonics: int = 32
    radial_modes: int = 5
    static_harmonics: int = 96
    rings: int = 44
    damping_law: str = "constant"
    loss_factor: float = 0.1
    loss_frequency: float = 74.0
    cavity_gas: bool = True
    static_families: Sequence[int] = ()


def _key(group: str, default: Any) -> Any:  # noqa: ANN401 - a field of any type
    """Return a field that stands in a namelist group of its own name."""
    return field(default=default, metadata={"group": group})


@dataclass(frozen=True)
class FiniteElement:
    """Options of the transient finite-element model.

    Attributes
    ----------
    bounces : int
        Contacts to be followed.
    flight_before, flight_after : float
        Free flight before first touch and after the last contact, s.
    step_safety : float
        Part of the limit of stability that a step uses.
    radial_elements, polar_elements : int
        Elements through the wall and from pole to pole (group ``&mesh``).
    law : str
        ``"neo_hookean"`` or ``"mooney_rivlin"`` (group ``&material``, as all up to `prony_time`).
    mooney_share : float
        Part of the shear modulus with the second invariant, of a Mooney-Rivlin solid.
    bulk_ratio : float
        Most bulk modulus over shear modulus; less where Poisson's ratio says so.
    viscosity : str
        ``"none"``, ``"kelvin_voigt"``, ``"constant_loss"`` (10 to 1000 Hz) or ``"prony"``.
    loss_factor : float
        Loss factor, of Kelvin-Voigt at `loss_frequency`.
    loss_frequency : float
        Frequency at which the ball's modulus of elasticity is the storage modulus, Hz.
    prony_share, prony_time : sequence of float
        Moduli over the long-term modulus, and relaxation times, s.
    treatment : str
        ``"impulse"`` or ``"penalty"``: how the floor holds the ball (group ``&contact``).
    penalty_ratio : float
        Stiffness of the penalty over that of the elements above it, per area.
    snapshot_interval : float
        Time between snapshots of the deformed ball, s; 0 for none (group ``&output``).
    """

    name: ClassVar[str] = "finite_element"
    bounces: int = 1
    flight_before: float = 0.0
    flight_after: float = 0.0
    step_safety: float = 0.85
    radial_elements: int = _key("mesh", 8)
    polar_elements: int = _key("mesh", 64)
    law: str = _key("material", "neo_hookean")
    mooney_share: float = _key("material", 0.2)
    bulk_ratio: float = _key("material", 200.0)
    viscosity: str = _key("material", "kelvin_voigt")
    loss_factor: float = _key("material", 0.2)
    loss_frequency: float = _key("material", 74.0)
    prony_share: Sequence[float] = _key("material", ())
    prony_time: Sequence[float] = _key("material", ())
    treatment: str = _key("contact", "impulse")
    penalty_ratio: float = _key("contact", 3.0)
    snapshot_interval: float = _key("output", 1e-3)


@dataclass(frozen=True)
class MeasuredModes:
    """Options of the model of measured modes (after Park et al. 2010), one entry per mode.

    Attributes
    ----------
    frequency : sequence of float
        Natural frequencies of the ball on the floor, Hz.
    damping_ratio : sequence of float
        Damping ratios.
    effective_mass : sequence of float
        Effective masses, kg.
    allow_mass_mismatch : bool
        The masses need not add up to that of the ball.
    """

    name: ClassVar[str] = "measured_modes"
    frequency: Sequence[float] = ()
    damping_ratio: Sequence[float] = ()
    effective_mass: Sequence[float] = ()
    allow_mass_mismatch: bool = False


@dataclass(frozen=True)
class HuntCrossley:
    """Options of the lumped source; exactly one of stiffness and contact time is above 0.

    Attributes
    ----------
    stiffness : float
        Stiffness, N/m^exponent; 0: from `contact_time`.
    contact_time : float
        Wanted contact time, s; 0: from `stiffness`.
    exponent : float
        Exponent of the deflection; 3/2 is Hertz's.
    damping : float
        Damping, s/m; 0: from `restitution`.
    restitution : float
        Wanted coefficient of restitution; 0: from `damping`.
    """

    name: ClassVar[str] = "hunt_crossley"
    stiffness: float = 0.0
    contact_time: float = 0.0
    exponent: float = 1.5
    damping: float = 0.0
    restitution: float = 0.0


ModelOptions = HollowSphere | ModalBall | FiniteElement | MeasuredModes | HuntCrossley

MODELS: dict[str, type[ModelOptions]] = {
    kind.name: kind
    for kind in (HollowSphere, ModalBall, FiniteElement, MeasuredModes, HuntCrossley)
}

# The keys that take lists of numbers.
LISTS = {
    option.name
    for kind in MODELS.values()
    for option in dataclasses.fields(kind)
    if option.default == ()
}


def group_of(model: str, option: dataclasses.Field[Any]) -> str:
    """Return the namelist group of an option of a model."""
    group: str = option.metadata.get("group", model)
    return group


def new_model(name: str, options: dict[str, object]) -> ModelOptions:
    """Return the options of a model by its name.

    Raises
    ------
    InputError
        Where the model or an option is not known; lists those that are.
    """
    if name not in MODELS:
        message = f"&model: name = {name!r} is not allowed; allowed: {_listed(MODELS)}"
        raise InputError(message)
    known = [option.name for option in dataclasses.fields(MODELS[name])]
    for option in options:
        if option not in known:
            message = f"&{name}: {option} is not a known key; allowed: {_listed(known)}"
            raise InputError(message)
    return MODELS[name](**options)  # type: ignore[arg-type]


def _listed(words: Iterable[str]) -> str:
    """Return words in quotes with commas between."""
    return ", ".join(map(repr, words))
