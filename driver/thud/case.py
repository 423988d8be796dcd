"""Input of a run: dataclasses that mirror the namelist groups, read and written with f90nml."""

from __future__ import annotations

import dataclasses
import errno
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, get_args

import f90nml
import numpy as np

from thud._library import call, door, text
from thud.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from types import UnionType
    from typing import Self


@dataclass(frozen=True)
class Ball:
    """A hollow ball; the default is the rubber ball of Schoenwald and Zeitler (2011).

    Attributes
    ----------
    outer_radius : float
        Outer radius R, m.
    wall_thickness : float
        Wall thickness h, m.
    mass : float
        Mass M, kg.
    youngs_modulus : float
        Modulus of elasticity E, Pa.
    poisson_ratio : float
        Poisson's ratio.
    gauge_pressure : float
        Overpressure of the gas in the undeformed ball, Pa; 0 for a ball with a hole.
    ambient_pressure : float
        Pressure of the air around the ball, Pa.
    heat_capacity_ratio : float
        Ratio of specific heats of the enclosed gas.
    """

    outer_radius: float = 0.089
    wall_thickness: float = 0.032
    mass: float = 2.5
    youngs_modulus: float = 1.6e6
    poisson_ratio: float = 0.5
    gauge_pressure: float = 0.0
    ambient_pressure: float = 101325.0
    heat_capacity_ratio: float = 1.4


@dataclass(frozen=True)
class Drop:
    """A free fall onto the floor; the default is the standards' drop.

    Attributes
    ----------
    height : float
        Height of the ball's lowest point over the floor, m.
    gravity : float
        Acceleration of free fall, m/s2.
    """

    height: float = 1.0
    gravity: float = 9.81


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
    static_families: Sequence[float] = ()


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


ModelOptions = HollowSphere | ModalBall | MeasuredModes | HuntCrossley

MODELS: dict[str, type[ModelOptions]] = {
    kind.name: kind for kind in (HollowSphere, ModalBall, MeasuredModes, HuntCrossley)
}


@dataclass(frozen=True)
class Sampling:
    """Sampling of the force.

    Attributes
    ----------
    sample_rate : float
        Samples per second, Hz.
    duration : float
        Length of the record from first touch, s.
    substeps : int
        Integration steps per sampling interval.
    """

    sample_rate: float = 44100.0
    duration: float = 0.05
    substeps: int = 1


@dataclass(frozen=True)
class Levels:
    """How levels are computed and which force is judged.

    Attributes
    ----------
    method : str
        ``"exact"`` (band energy of the record) or ``"fft"`` (1 Hz bins of a 1 s record).
    bands : str
        ``"octave"``, ``"third"`` or ``"both"``: the bands of ``levels.csv``.
    force : str
        ``"elastic"`` or ``"floor"``.
    """

    method: str = "exact"
    bands: str = "octave"
    force: str = "elastic"


@dataclass(frozen=True)
class Limits:
    """The standards' limits that apply.

    Attributes
    ----------
    source : str
        ``"rubber_ball"`` or ``"tyre"``.
    """

    source: str = "rubber_ball"


@dataclass(frozen=True)
class Case:
    """Everything that one run needs.

    Attributes
    ----------
    name : str
        Name of the case, also of its output directory.
    model : HollowSphere, ModalBall, MeasuredModes or HuntCrossley
        The source model, by its options.
    ball, drop, sampling, levels, limits
        The other namelist groups.
    """

    name: str = "python"
    ball: Ball = field(default_factory=Ball)
    drop: Drop = field(default_factory=Drop)
    model: ModelOptions = field(default_factory=HollowSphere)
    sampling: Sampling = field(default_factory=Sampling)
    levels: Levels = field(default_factory=Levels)
    limits: Limits = field(default_factory=Limits)

    def to_namelist(self) -> f90nml.Namelist:
        """Return the case as a namelist with every key.

        Raises
        ------
        InputError
            Where a value is neither a number nor text, nor a list of numbers where one is due.
        """
        groups = {group: getattr(self, group) for group in _GROUPS}
        for group, kind in _GROUPS.items():
            require_kind(group, groups[group], kind)
        require_kind("model", self.model, ModelOptions)
        groups[self.model.name] = self.model
        name = _plain("case", "name", self.name)
        namelist = f90nml.Namelist({"case": {"name": name}, "model": {"name": self.model.name}})
        for group, options in groups.items():
            values = {key: _plain(group, key, value) for key, value in vars(options).items()}
            namelist[group] = {key: value for key, value in values.items() if value != []}
        return namelist

    @classmethod
    def from_namelist(cls, namelist: f90nml.Namelist) -> Self:
        """Return the case of a namelist; keys that it lacks have their default value."""
        groups = {
            group: kind(**namelist[group]) for group, kind in _GROUPS.items() if group in namelist
        }
        model = namelist.get("model", {}).get("name", HollowSphere.name)
        options = dict(namelist.get(model, {}))
        for key, default in MODELS[model]().__dict__.items():
            if isinstance(default, tuple) and key in options:
                entries = options[key]
                options[key] = tuple(entries) if isinstance(entries, list) else (entries,)
        return cls(
            name=namelist.get("case", {}).get("name", cls.name),
            model=MODELS[model](**options),
            **groups,
        )


_GROUPS: dict[str, type[Any]] = {
    "ball": Ball,
    "drop": Drop,
    "sampling": Sampling,
    "levels": Levels,
    "limits": Limits,
}


def require_kind(name: str, value: object, kind: type[Any] | UnionType) -> None:
    """Complain about an argument of another kind."""
    if not isinstance(value, kind):
        expected = getattr(kind, "__name__", None) or " or ".join(
            k.__name__ for k in get_args(kind)
        )
        message = f"{name} = {value!r} is not allowed; allowed: an object of {expected}"
        raise InputError(message)


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


def _plain(group: str, key: str, value: object) -> float | str | list[float | str]:
    """Return a value as f90nml knows it."""
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(value, list | tuple) and key in _LISTS:
        return [_plain(group, key, entry) for entry in value]  # type: ignore[misc]
    known = isinstance(value, int | float) or (isinstance(value, str) and value.isprintable())
    if not known or (isinstance(value, int) and abs(value) > _LARGEST):
        shown = "a very large number" if isinstance(value, int) else repr(value)
        message = f"&{group}: {key} = {shown} is not allowed; allowed: a number or plain text"
        raise InputError(message)
    return value  # type: ignore[return-value]


# No key takes a larger number, and Python would not print it.
_LARGEST = 10**300

# The keys that take lists of numbers.
_LISTS = {
    option.name
    for kind in MODELS.values()
    for option in dataclasses.fields(kind)
    if option.default == ()
}


def case_text(case: Case) -> bytes:
    """Return the text of the namelist file of a case, for the library."""
    return f"{case.to_namelist()}\n".encode(errors="surrogateescape")


def read_case(path: str | os.PathLike[str]) -> Case:
    """Read a case from a namelist file.

    Parameters
    ----------
    path
        Path of the file.

    Returns
    -------
    Case
        The case with every key.

    Raises
    ------
    InputError
        Names file, group, key, value and allowed range.
    """
    (effective,) = call(door.effective_case, os.fsencode(path))
    return Case.from_namelist(f90nml.reads(text(effective)))


def write_case(case: Case, path: str | os.PathLike[str]) -> None:
    """Write a case as a namelist file, completely or not at all.

    Parameters
    ----------
    case
        The case.
    path
        Path of the file; an older one is replaced.

    Raises
    ------
    InputError
        Where the case holds a value that is not allowed; nothing is written.
    OSError
        Where the file cannot be written.
    """
    content = case_text(case)
    call(door.count_samples, content)
    replace_file(path, content)


def replace_file(path: str | os.PathLike[str], content: bytes) -> None:
    """Write a file under another name, then give it its own: nobody sees half a file.

    Raises
    ------
    OSError
        With the path that was asked for, where it cannot be written.
    """
    target = Path(path)
    try:
        if target.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(target))
        part = target.with_name(f".{target.name}.{os.getpid()}.part")
        try:
            part.write_bytes(content)
            part.replace(target)
        finally:
            part.unlink(missing_ok=True)
    except ValueError as error:  # a path that no file system can hold
        message = f"{path!r} is not allowed; allowed: the path of a file"
        raise InputError(message) from error
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(target)) from error
