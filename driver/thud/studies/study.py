"""Studies: which case, what varies or is fitted, read from TOML."""

from __future__ import annotations

import json
import os
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from thud._api import version
from thud._schema import MODELS
from thud.case import Case, check_case, new_model, read_case
from thud.checks import require_kind, require_words, shown
from thud.errors import InputError
from thud.keys import DENSITY, TEMPERATURE, Value, find_key, put
from thud.studies.parameter import Parameter, checked, quantity

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

# What studies are read from.
Source: TypeAlias = "str | os.PathLike[str] | Mapping[str, Any] | Study"

# What every study may hold.
WORDS = ("name", "case", "fixed", "parameters")
# Longer texts are compared by their beginning and a checksum.
_LONG = 300
# Where spreads are tried for whether a case with fixed values can be valid.
_SHARES = np.array([0.01, 0.5, 0.99])
_NAMED_KEY = re.compile(r"&\w+: (\w+)")


@dataclass(frozen=True)
class Study:
    """A study, complete and checked; `read_study` makes one.

    Attributes
    ----------
    name : str
        Name of the study, also of its files.
    kind : str
        Kind of study, see `thud.studies.kinds.KINDS`.
    case : Case
        Everything that neither varies nor is fitted.
    parameters : tuple of Parameter
        What varies or is fitted, in the units of the keys.
    density : float or None
        Density of the wall where it is fixed instead of the mass, kg/m3.
    text : str
        The text of the study.
    """

    name: str
    kind: str
    case: Case
    parameters: tuple[Parameter, ...]
    density: float | None = None
    text: str = field(default="", compare=False, repr=False)

    @property
    def model(self) -> str:
        """Name of the source model."""
        return self.case.model.name  # type: ignore[union-attr]

    @property
    def identity(self) -> dict[str, str]:
        """What its results depend on, as texts by place and key."""
        found = {"thud": version(), "kind": self.kind, **self.own_identity()}
        found["[parameters]"] = ", ".join(p.name for p in self.parameters)
        found |= {f"[parameters] {p.name}": str(p) for p in self.parameters}
        if self.density is not None:
            found["[fixed] density"] = f"{self.density!r} kg/m3"
        for group, keys in self.case.to_namelist().items():
            found |= {f"&{group}: {key}": f"{value!r}" for key, value in keys.items()}
        return {key: _shortened(value) for key, value in found.items()}

    def own_identity(self) -> dict[str, str]:
        """Return what the results of this kind depend on besides."""
        return {}


def _shortened(text: str) -> str:
    if len(text) <= _LONG:
        return text
    import hashlib  # noqa: PLC0415 - seldom needed

    return f"{text[:_LONG]}... ({hashlib.sha256(text.encode()).hexdigest()[:16]})"


def read_content(
    source: str | os.PathLike[str] | Mapping[str, Any],
    read: Callable[[dict[str, Any], Path, str, str], Any],
) -> Any:  # noqa: ANN401 - what the reader makes of it
    """Read the tables of a study.

    Parameters
    ----------
    source
        Path of a TOML file, or what would stand in it.
    read
        Takes the tables, the folder from which files are named, a name and the text.

    Returns
    -------
    object
        What `read` returns.

    Raises
    ------
    InputError
        With the name of the file.
    """
    if isinstance(source, Mapping):
        text = _text(source)
        return read(json.loads(text), Path(), "python", text)
    require_kind("study", source, str | Path)
    path = Path(source)
    try:
        text = path.read_text(encoding="utf-8")
        return read(tomllib.loads(text), path.parent, path.stem, text)
    except InputError as error:
        message = f"{path}: {error}"
        raise InputError(message) from error
    except ValueError as error:  # no TOML, no UTF-8, or a number of thousands of digits
        message = f"{path}: {error}; allowed: TOML"
        raise InputError(message) from error


def _text(source: Mapping[str, Any]) -> str:
    """Return tables as JSON."""
    try:
        return json.dumps(source, default=_plain)
    except (TypeError, ValueError, RecursionError) as error:
        message = f"the study is no text ({error}); allowed: tables, lists, numbers and text"
        raise InputError(message) from error


def _plain(value: object) -> object:
    """Return tables, paths, numbers and arrays of NumPy in types of JSON."""
    if isinstance(value, Parameter):
        return value.given
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    message = f"an object of {type(value).__name__}"
    raise TypeError(message)


def read_common(
    given: dict[str, Any],
    folder: Path,
    kind: str,
    words: Iterable[str],
    new_parameter: Callable[[str, object, Case, Value | None], Parameter],
) -> Study:
    """Read what all kinds share; `words` are those that this kind has in addition to `WORDS`."""
    require_words("the study", given, (*WORDS, *words))
    fixed, parameters = (table_of(given, name) for name in ("fixed", "parameters"))
    name = given["name"]
    if (
        not isinstance(name, str)
        or not name.strip()
        or not name.isprintable()
        or Path(name).name != name
        or name == ".."
    ):
        message = f"name = {name!r} is not allowed; allowed: the name of a file, without folders"
        raise InputError(message)
    case, density = _fix(_case(given.get("case"), folder, fixed), fixed)
    if not parameters:
        message = "[parameters] is empty; allowed: one parameter or more"
        raise InputError(message)
    found = tuple(
        new_parameter(name, entry, case, density if name == DENSITY.name else value_in(case, name))
        for name, entry in parameters.items()
    )
    _require_use(fixed, parameters)
    _require_valid(case, fixed, found, density)
    return Study(name, kind, case, found, density)


def table_of(given: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Return a table of a study, empty where it is missing."""
    table = given.get(name, {})
    if not isinstance(table, dict):
        message = f"{name} = {shown(table)} is not allowed; allowed: a table [{name}]"
        raise InputError(message)
    return table


def _case(path: object, folder: Path, fixed: Mapping[str, Any]) -> Case:
    if path is not None and not isinstance(path, str):
        message = f"case = {path!r} is not allowed; allowed: the path of a namelist file"
        raise InputError(message)
    case = Case() if path is None else read_case(folder / path)
    model = fixed.get("model")
    if model is not None and not isinstance(model, str):
        message = f"[fixed] model = {shown(model)} is not allowed; allowed: {', '.join(MODELS)}"
        raise InputError(message)
    if model is not None and (case.model is None or model != case.model.name):
        case = replace(case, model=new_model(model, {}))
    if case.model is None:
        message = f"case = {path!r} has no source model; allowed: a case with one"
        raise InputError(message)
    return case


def _fix(case: Case, fixed: Mapping[str, Any]) -> tuple[Case, float | None]:
    """Return the case with fixed keys, and a density if it is fixed."""
    values: dict[str, object] = {}
    for name, entry in fixed.items():
        if name == "model":
            continue
        place = f"[fixed] {name}"
        key, place_in_list = find_key(name, case.model.name)  # type: ignore[union-attr]
        if key == TEMPERATURE:
            message = f"{place} is not allowed; allowed: temperature in [parameters]"
            raise InputError(message)
        value = quantity(place, entry, key.unit)
        if key.kind == "list" and place_in_list is None:
            entries = value if isinstance(value, list) else [value]
            values[name] = tuple(checked(place, key, item, 0) for item in entries)
        else:
            values[name] = checked(place, key, value, 0)
    density = values.pop(DENSITY.name, None)
    return put(case, values), density  # type: ignore[return-value]


def _require_use(fixed: Mapping[str, Any], parameters: Mapping[str, Any]) -> None:
    """Raise InputError where one key overrules another."""
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


def _require_valid(
    case: Case,
    fixed: Mapping[str, Any],
    parameters: tuple[Parameter, ...],
    density: float | None,
) -> None:
    """Raise InputError where the library refuses a fixed value for all values of the parameters."""
    keys = {name.partition("(")[0] for name in fixed} | ({"mass"} if density else set())
    trials = [p.trials(_SHARES) for p in parameters if p.key not in {DENSITY, TEMPERATURE}]
    names = [p.name for p in parameters if p.key not in {DENSITY, TEMPERATURE}]
    refusals = []
    for i in range(len(_SHARES)):
        values = {name: trial[i] for name, trial in zip(names, trials, strict=True) if trial}
        try:
            tried = put(case, values)
            if density is not None:
                tried = with_density(tried, density)
            check_case(replace(tried, modes=None))
        except InputError as error:
            refusals.append(str(error))
    named = [_NAMED_KEY.match(refusal) for refusal in refusals]
    if len(named) == len(_SHARES) and all(found and found[1] in keys for found in named):
        message = f"[fixed]: {refusals[0]}"
        raise InputError(message)


def with_density(case: Case, density: float) -> Case:
    """Return a case whose mass is that of a wall of a density, kg/m3."""
    volume = wall_volume(case.ball.outer_radius, case.ball.wall_thickness)
    return replace(case, ball=replace(case.ball, mass=density * volume))


def wall_volume(outer_radius: Any, wall_thickness: Any) -> Any:  # noqa: ANN401 - or arrays
    """Return the volume of the wall of a ball, m3, from its measures, m."""
    inner = outer_radius - wall_thickness
    # Products of absurd radii are infinite, where their powers are errors of Python.
    outer_cube, inner_cube = (radius * radius * radius for radius in (outer_radius, inner))
    return 4 / 3 * np.pi * (outer_cube - inner_cube)


def value_in(case: Case, name: str) -> Value | None:
    """Return the value of a key in a case; None where it has none, or a list of them."""
    groups = (case.ball, case.drop, case.sampling, case.levels, case.limits, case.model)
    key, _, entry = name.partition("(")
    values = (getattr(group, key, None) for group in groups)
    found = next((value for value in values if value is not None), None)
    if isinstance(found, tuple) and entry:
        found = next(iter(found[int(entry.rstrip(")")) - 1 :]), None)
    return found if isinstance(found, Value) else None
