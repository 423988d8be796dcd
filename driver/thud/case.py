"""Input of a run: dataclasses that mirror the namelist groups, read and written with f90nml."""

from __future__ import annotations

import os
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any

import f90nml
import numpy as np

from thud._api import api, call, text
from thud.checks import LARGEST, replace_file, require_kind, shown
from thud.errors import InputError
from thud.models import LISTS, MODELS, FiniteElement, HollowSphere, ModelOptions, group_of

if TYPE_CHECKING:
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
class Modes:
    """Free modes that are asked for.

    Attributes
    ----------
    count : int
        Number of elastic modes.
    radial_elements, polar_elements : int
        Elements through the wall and from pole to pole (group ``&mesh``).
    """

    count: int = 6
    radial_elements: int = FiniteElement.radial_elements
    polar_elements: int = FiniteElement.polar_elements


@dataclass(frozen=True)
class Case:
    """Everything that one run needs.

    Attributes
    ----------
    name : str
        Name of the case, also of its output directory.
    model : HollowSphere, ModalBall, FiniteElement, MeasuredModes, HuntCrossley or None
        The source model, by its options; None where no impact is asked for.
    modes : Modes or None
        The free modes that are asked for.
    ball, drop, sampling, levels, limits
        The other namelist groups.
    """

    name: str = "python"
    ball: Ball = field(default_factory=Ball)
    drop: Drop = field(default_factory=Drop)
    model: ModelOptions | None = field(default_factory=HollowSphere)
    sampling: Sampling = field(default_factory=Sampling)
    levels: Levels = field(default_factory=Levels)
    limits: Limits = field(default_factory=Limits)
    modes: Modes | None = None

    def to_namelist(self) -> f90nml.Namelist:
        """Return the case as a namelist with every key.

        Raises
        ------
        InputError
            Where a value is neither a number nor text, nor a list of numbers where one is due.
        """
        for group, kind in _GROUPS.items():
            require_kind(group, getattr(self, group), kind)
        require_kind("model", self.model, ModelOptions | None)
        require_kind("modes", self.modes, Modes | None)
        groups: dict[str, dict[str, object]] = {
            "case": {"name": self.name},
            "ball": vars(self.ball),
        }
        if self.modes:
            groups["modes"] = {"count": self.modes.count}
            groups["mesh"] = {key: getattr(self.modes, key) for key in _MESH}
        if self.model:
            groups["model"] = {"name": self.model.name}
            groups |= {group: vars(getattr(self, group)) for group in _GROUPS}
            for option in fields(self.model):
                values = groups.setdefault(group_of(self.model.name, option), {})
                value = getattr(self.model, option.name)
                if self.modes and option.name in _MESH and values[option.name] != value:
                    message = (
                        f"&mesh: {option.name} = {value} of the model is not that of the modes, "
                        f"{values[option.name]}; allowed: one mesh for both"
                    )
                    raise InputError(message)
                values[option.name] = value
        namelist = f90nml.Namelist()
        for group, options in groups.items():
            plain = {key: _plain(group, key, value) for key, value in options.items()}
            namelist[group] = {key: value for key, value in plain.items() if value != []}
        return namelist

    @classmethod
    def from_namelist(cls, namelist: f90nml.Namelist) -> Self:
        """Return the case of a namelist; keys that it lacks have their default value."""
        groups = {
            group: kind(**namelist[group]) for group, kind in _GROUPS.items() if group in namelist
        }
        model = modes = None
        if "modes" in namelist:
            modes = Modes(**namelist["modes"], **namelist.get("mesh", {}))
        if "model" in namelist or not modes:
            name = namelist.get("model", {}).get("name", HollowSphere.name)
            options = {}
            for option in fields(MODELS[name]):
                given = namelist.get(group_of(name, option), {})
                if option.name in given:
                    entries = given[option.name]
                    if option.name in LISTS:
                        entries = tuple(entries) if isinstance(entries, list) else (entries,)
                    options[option.name] = entries
            model = MODELS[name](**options)
        title = namelist.get("case", {}).get("name", cls.name)
        return cls(name=title, model=model, modes=modes, **groups)


_GROUPS: dict[str, type[Any]] = {
    "ball": Ball,
    "drop": Drop,
    "sampling": Sampling,
    "levels": Levels,
    "limits": Limits,
}

# Keys of the mesh, which free modes and finite elements share.
_MESH = ("radial_elements", "polar_elements")


def _plain(group: str, key: str, value: object) -> float | str | list[float | str]:
    """Return a value as f90nml knows it."""
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(value, list | tuple) and key in LISTS:
        return [_plain(group, key, entry) for entry in value]  # type: ignore[misc]
    known = isinstance(value, int | float) or (isinstance(value, str) and value.isprintable())
    if not known or (isinstance(value, int) and abs(value) > LARGEST):
        message = (
            f"&{group}: {key} = {shown(value)} is not allowed; allowed: a number or plain text"
        )
        raise InputError(message)
    return value  # type: ignore[return-value]


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
    (effective,) = call(api.effective_case, os.fsencode(path))
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
    call(api.get_sizes, content)
    replace_file(path, content)
