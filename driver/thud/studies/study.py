"""Studies: what varies around which case, read from TOML."""

from __future__ import annotations

import hashlib
import json
import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

import thud
from thud.case import Case, read_case
from thud.checks import require_kind, require_words, shown
from thud.errors import InputError
from thud.keys import DENSITY, TEMPERATURE, Value, find_key, put
from thud.models import MODELS, FiniteElement, new_model
from thud.studies.designs import makers, read_design
from thud.studies.parameters import Parameter, checked, new_parameter, within
from thud.units import power_of

# What `read_study` reads.
Source: TypeAlias = "str | os.PathLike[str] | Mapping[str, Any] | Study"

FORMATS = ("auto", "netcdf", "zarr")
_WORDS = ("name", "case", "format", "fixed", "design", "temperature", "parameters")


@dataclass(frozen=True)
class Temperature:
    """How the modulus of elasticity falls with temperature: E (1 + c (T - T_ref)).

    Attributes
    ----------
    reference : float
        Temperature T_ref at which the modulus is that of the case, degrees Celsius.
    coefficient : float
        Relative change c of the modulus, 1/K.
    """

    reference: float
    coefficient: float


@dataclass(frozen=True)
class Study:
    """A study, complete and checked; `read_study` makes one.

    Attributes
    ----------
    name : str
        Name of the study, also of its files.
    kind : str
        ``"sweep"``, ``"sensitivity"``, ``"design"`` or ``"uncertainty"``.
    base : Case
        The case from which sets differ.
    parameters : tuple of Parameter
        What varies.
    design : str
        ``"grid"``, ``"list"``, ``"random"``, ``"latin_hypercube"``, ``"sobol"`` or ``"saltelli"``.
    size, seed : int
        Number of sets that are drawn (of base samples for ``"saltelli"``), and the seed.
    density : float or None
        Density of the wall where it is given instead of the mass, kg/m3.
    temperature : Temperature or None
        Law of the modulus where the temperature varies.
    format : str
        ``"netcdf"``, ``"zarr"``, or ``"auto"``: Zarr for what is large.
    text : str
        The text of the study.
    """

    name: str
    kind: str
    base: Case
    parameters: tuple[Parameter, ...]
    design: str
    size: int = 0
    seed: int = 0
    density: float | None = None
    temperature: Temperature | None = None
    format: str = "auto"
    text: str = field(default="", compare=False, repr=False)

    @property
    def model(self) -> str:
        """Name of the source model."""
        return self.base.model.name  # type: ignore[union-attr]

    @property
    def fingerprint(self) -> str:
        """What tells studies with other results apart; comments and formats do not count."""
        versions = {"thud_version": thud.__version__, **makers(self.design)}
        return hashlib.sha256(f"{versions} {replace(self, format='')}".encode()).hexdigest()


def read_study(source: Source, kind: str = "sweep") -> Study:
    """Read a study.

    Parameters
    ----------
    source
        Path of a TOML file, or what would stand in it.
    kind
        ``"sweep"``, ``"sensitivity"``, ``"design"`` or ``"uncertainty"``.

    Returns
    -------
    Study
        The study.

    Raises
    ------
    InputError
        Names file, table, key and what is allowed.
    """
    if isinstance(source, Study):
        if source.kind != kind:
            message = f"{source.name} is a {source.kind} study; allowed: a {kind} study"
            raise InputError(message)
        return source
    if isinstance(source, Mapping):
        text = _text(source)
        return _new_study(json.loads(text), kind, Path(), "python", text)
    require_kind("study", source, str | Path)
    path = Path(source)
    try:
        content = path.read_text(encoding="utf-8")
        return _new_study(tomllib.loads(content), kind, path.parent, path.stem, content)
    except InputError as error:
        message = f"{path}: {error}"
        raise InputError(message) from error
    except ValueError as error:  # no TOML, no UTF-8, or a number of thousands of digits
        message = f"{path}: {error}; allowed: TOML"
        raise InputError(message) from error


def _text(source: Mapping[str, Any]) -> str:
    """Return what would stand in a file as JSON, whatever kinds of numbers and tables it has."""
    try:
        return json.dumps(source, default=_plain)
    except (TypeError, ValueError, RecursionError) as error:
        message = f"the study is no text ({error}); allowed: tables, lists, numbers and text"
        raise InputError(message) from error


def _plain(value: object) -> object:
    """Return tables, paths, and numbers and arrays of NumPy as what JSON knows."""
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    message = f"an object of {type(value).__name__}"
    raise TypeError(message)


def _new_study(given: dict[str, Any], kind: str, folder: Path, name: str, text: str) -> Study:
    """Return the study that a table describes."""
    require_words("the study", given, _WORDS)
    for table in ("fixed", "design", "temperature", "parameters"):
        if not isinstance(given.get(table, {}), dict):
            message = f"{table} = {given[table]!r} is not allowed; allowed: a table [{table}]"
            raise InputError(message)
    name = given.get("name", name)
    if (
        not isinstance(name, str)
        or not name.strip()
        or not name.isprintable()
        or Path(name).name != name
        or name == ".."
    ):
        message = f"name = {name!r} is not allowed; allowed: the name of a file, without folders"
        raise InputError(message)
    written = given.get("format", FORMATS[0])
    if written not in FORMATS:
        message = f"format = {written!r} is not known; allowed: {', '.join(FORMATS)}"
        raise InputError(message)
    fixed = given.get("fixed", {})
    base, density = _fix(_base_case(given, folder), fixed)
    parameters = _parameters(given.get("parameters", {}), base, density)
    _require_use(fixed, given["parameters"])
    temperature = _temperature(given.get("temperature"), parameters)
    design, size, seed = read_design(given.get("design", {}), kind, parameters)
    return Study(
        name, kind, base, parameters, design, size, seed, density, temperature, written, text
    )


def _base_case(given: Mapping[str, Any], folder: Path) -> Case:
    """Return the case from which sets differ: of a file, or the default, with its model."""
    path = given.get("case")
    if path is not None and not isinstance(path, str):
        message = f"case = {path!r} is not allowed; allowed: the path of a namelist file"
        raise InputError(message)
    case = Case() if path is None else read_case(folder / path)
    model = given.get("fixed", {}).get("model")
    if model is not None and not isinstance(model, str):
        message = f"[fixed] model = {shown(model)} is not allowed; allowed: {', '.join(MODELS)}"
        raise InputError(message)
    if model is not None and (case.model is None or model != case.model.name):
        case = replace(case, model=new_model(model, {}))
    if case.model is None:
        message = f"case = {path!r} has no source model; allowed: a case with one"
        raise InputError(message)
    if isinstance(case.model, FiniteElement):
        case = replace(case, model=replace(case.model, snapshot_interval=0.0))
    return replace(case, modes=None)


def _fix(case: Case, fixed: Mapping[str, Any]) -> tuple[Case, float | None]:
    """Return the case with the keys that the study fixes, and a density if it fixes one."""
    values: dict[str, object] = {}
    for name, entry in fixed.items():
        if name == "model":
            continue
        place = f"[fixed] {name}"
        key, place_in_list = find_key(name, case.model.name)  # type: ignore[union-attr]
        if key == TEMPERATURE:
            message = f"{place} is not allowed; allowed: temperature in [parameters]"
            raise InputError(message)
        given = entry if isinstance(entry, dict) else {"value": entry}
        require_words(place, given, ("value", "unit"))
        power = power_of(given.get("unit", key.unit or "1"), key.unit, place)
        value = given.get("value")
        if key.kind == "list" and place_in_list is None:
            entries = value if isinstance(value, list) else [value]
            values[name] = tuple(within(place, key, item, power) for item in entries)
        else:
            values[name] = within(place, key, value, power)
    density = values.pop(DENSITY.name, None)
    return put(case, values), density  # type: ignore[return-value]


def _require_use(fixed: Mapping[str, Any], parameters: Mapping[str, Any]) -> None:
    """Complain about keys that others overrule."""
    if {"mass", DENSITY.name} <= {*fixed, *parameters}:
        message = "mass and density are both given; allowed: one of them"
        raise InputError(message)
    for name in fixed:
        # A fixed value may be the middle of a normal distribution.
        if name in parameters and ("std" not in parameters[name] or "mean" in parameters[name]):
            message = (
                f"[fixed] {name} has no use beside [parameters] {name}; "
                f"allowed: one of them, or std without mean in [parameters]"
            )
            raise InputError(message)


def _parameters(
    given: Mapping[str, Any], base: Case, density: float | None
) -> tuple[Parameter, ...]:
    """Return what varies."""
    if not given:
        message = "[parameters] is empty; allowed: one parameter or more"
        raise InputError(message)
    if "bands" in given:
        message = "[parameters] bands is not allowed; allowed: bands in [fixed], alike for all sets"
        raise InputError(message)
    model = base.model.name  # type: ignore[union-attr]
    return tuple(
        new_parameter(
            name, spread, model, density if name == DENSITY.name else value_in(base, name)
        )
        for name, spread in given.items()
    )


def value_in(base: Case, name: str) -> Value | None:
    """Return the value of a key in a case; None where it has none, or a list of them."""
    groups = (base.ball, base.drop, base.sampling, base.levels, base.limits, base.model)
    key, _, entry = name.partition("(")
    values = (getattr(group, key, None) for group in groups)
    found = next((value for value in values if value is not None), None)
    if isinstance(found, tuple) and entry:
        found = next(iter(found[int(entry.rstrip(")")) - 1 :]), None)
    return found if isinstance(found, Value) else None


def _temperature(given: Mapping[str, Any] | None, parameters: tuple[Parameter, ...]) -> Any:  # noqa: ANN401
    """Return the law of the modulus."""
    varies = any(parameter.key == TEMPERATURE for parameter in parameters)
    if varies != (given is not None):
        message = (
            "temperature needs both a parameter and the table [temperature]; "
            "allowed: reference, degC, and coefficient, 1/K, in [temperature]"
        )
        raise InputError(message)
    if given is None:
        return None
    words = ("reference", "coefficient")
    require_words("[temperature]", given, words)
    numbers = (checked(f"[temperature] {w}", TEMPERATURE, given.get(w), 0) for w in words)
    return Temperature(*map(float, numbers))
