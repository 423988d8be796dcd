"""Studies as TOML files: the case, and parameters that vary or are fitted."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from thud.base._schema import MODELS
from thud.base.bridge import version
from thud.base.checks import refuse, refuse_unknown, refuse_value, require_kind, shown
from thud.base.errors import InputError
from thud.base.toml_tables import read_toml
from thud.case.case import (
    Case,
    check_case,
    impact_only,
    new_model,
    read_case,
)
from thud.case.keys import DENSITY, TEMPERATURE, find_key, with_values
from thud.studies.parameter import Parameter, read_quantity, read_value

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

# Types that a study is read from.
Source: TypeAlias = "str | os.PathLike[str] | Mapping[str, object] | Study"

# Keys and tables that every study may have.
COMMON_KEYS = ("name", "case", "fixed", "parameters")
# Texts that are longer than this are shortened to their beginning and a checksum.
_MAX_LENGTH = 300
# Quantiles of the parameters for trial cases.
TRIAL_QUANTILES = (0.01, 0.5, 0.99)


@dataclass(frozen=True)
class Study:
    """A study, complete and checked, as returned by `read_study`.

    Attributes
    ----------
    name : str
        Name of the study and of its files.
    kind : str
        Kind of study, see `thud.studies.kinds.KINDS`.
    case : Case
        The case, with the fixed keys.
    parameters : tuple of Parameter
        The parameters that vary or are fitted, in the units of the keys.
    density : float or None
        Density of the wall if it is fixed instead of the mass, kg/m3.
    text : str
        Text of the study file.
    inputs : tuple of path-like
        Files that the study is read from.
    """

    name: str
    kind: str
    case: Case
    parameters: tuple[Parameter, ...]
    density: float | None = None
    text: str = field(default="", compare=False, repr=False)
    inputs: tuple[str | os.PathLike[str], ...] = field(default=(), compare=False, repr=False)

    @property
    def model(self) -> str:
        """Name of the source model."""
        return self.case.model.name  # type: ignore[union-attr]

    @property
    def identity(self) -> dict[str, str]:
        """Version and settings on which the results depend, as texts by group and key."""
        result = {"thud": version(), "kind": self.kind, **self.kind_settings()}
        result["[parameters]"] = ", ".join(p.name for p in self.parameters)
        result |= {f"[parameters] {p.name}": str(p) for p in self.parameters}
        if self.density is not None:
            result["[fixed] density"] = f"{self.density!r} kg/m3"
        for group, keys in self.case.resolved().to_namelist().items():
            result |= {f"&{group}: {key}": f"{value!r}" for key, value in keys.items()}
        return {key: _shortened(value) for key, value in result.items()}

    def trial_case(self, quantile: float) -> Case:
        """Return the case with its parameters at a quantile; raise InputError if it is invalid."""
        varied = (p for p in self.parameters if p.key not in {DENSITY, TEMPERATURE})
        result = {p.name: p.trial(quantile) for p in varied}
        case = with_values(self.case, {name: v for name, v in result.items() if v is not None})
        return case if self.density is None else with_density(case, self.density)

    def kind_settings(self) -> dict[str, str]:
        """Return the settings of this kind of study on which its results depend."""
        return {}


def _shortened(text: str) -> str:
    if len(text) <= _MAX_LENGTH:
        return text
    return f"{text[:_MAX_LENGTH]}... ({sha256(text.encode()).hexdigest()[:16]})"


@contextmanager
def read_tables(
    source: str | os.PathLike[str] | Mapping[str, object],
) -> Iterator[tuple[dict[str, Any], Path, str]]:
    """Yield tables, folder and text of a study; InputErrors within the block name its file."""
    if isinstance(source, Mapping):
        text = _text(source)
        yield {"name": "python", **json.loads(text)}, Path(), text
        return
    require_kind("study", source, str | Path)
    path = Path(source)
    content, text = read_toml(path)
    try:
        yield {"name": path.stem, **content}, path.parent, text
    except InputError as error:
        raise error.within(path) from error


def named_files(value: object, folder: Path) -> Iterator[Path]:
    """Yield the existing files that a study names by paths relative to a folder."""
    if isinstance(value, str):
        with suppress(OSError, ValueError):
            if (folder / value).is_file():
                yield folder / value
    elif isinstance(value, Mapping | list):
        for entry in value.values() if isinstance(value, Mapping) else value:
            yield from named_files(entry, folder)


def _text(source: Mapping[str, object]) -> str:
    """Return tables as JSON."""
    try:
        return json.dumps(source, default=_plain)
    except (TypeError, ValueError, RecursionError) as error:
        refuse(
            f"the study cannot be written as JSON ({error})",
            "tables, lists, numbers and text",
            error,
        )


def _plain(value: object) -> object:
    """Return tables, paths, and NumPy numbers and arrays in types of JSON."""
    if isinstance(value, Parameter):
        return value.table
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    message = f"an object of {type(value).__name__}"
    raise TypeError(message)


def read_common(
    content: dict[str, Any],
    folder: Path,
    kind: str,
    own_keys: Iterable[str],
    new_parameter: Callable[[str, object, Case, float | None], Parameter],
) -> Study:
    """Read the part that all kinds share; `own_keys` are those besides `COMMON_KEYS`."""
    refuse_unknown("the study", content, (*COMMON_KEYS, *own_keys))
    fixed, parameters = (table_of(content, name) for name in ("fixed", "parameters"))
    check_case(Case(name=content["name"]))
    name = content["name"].rstrip()
    case, density = fix_keys(_case(content.get("case"), folder, fixed), fixed)
    if not parameters:
        refuse("[parameters] is empty", "one parameter or more")
    result = tuple(new_parameter(name, entry, case, density) for name, entry in parameters.items())
    _require_use(fixed, parameters)
    study = Study(name, kind, case, result, density)
    _require_valid(study, fixed)
    return study


def table_of(content: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Return a table of a study, empty if it is missing."""
    table = content.get(name, {})
    if not isinstance(table, dict):
        refuse_value(name, table, f"a table [{name}]")
    return table


def _case(path: object, folder: Path, fixed: Mapping[str, Any]) -> Case:
    if not isinstance(path, str | Mapping | None):
        refuse_value("case", path, "the path of a namelist file, or tables of its groups")
    if isinstance(path, Mapping):
        case = Case.from_namelist(path)
    else:
        case = Case() if path is None else read_case(folder / path)
    if (model := fixed.get("model")) is not None:
        if not isinstance(model, str):
            refuse_value("[fixed] model", model, ", ".join(MODELS))
        if case.model is None or model != case.model.name:
            case = replace(case, model=new_model(model, {}))
    if case.model is None:
        refuse(f"case = {shown(path)} has no source model", "a case with a source model")
    return case


def fix_keys(
    case: Case, fixed: Mapping[str, Any], table: str = "[fixed]"
) -> tuple[Case, float | None]:
    """Return the case with the fixed keys of a table, and a density if it is fixed."""
    values: dict[str, object] = {}
    for name, entry in fixed.items():
        if name == "model":
            continue
        label = f"{table} {name}"
        key, index = find_key(name, case)
        if key == TEMPERATURE:
            refuse(f"{label} is not allowed", "temperature in [parameters]")
        value = read_quantity(label, entry, key.unit)
        if key.kind == "list" and index is None:
            entries = value if isinstance(value, list) else [value]
            values[name] = tuple(read_value(label, key, item, 0) for item in entries)
        else:
            values[name] = read_value(label, key, value, 0)
    density = values.pop(DENSITY.name, None)
    return with_values(case, values), density  # type: ignore[return-value]


def _require_use(fixed: Mapping[str, Any], parameters: Mapping[str, Any]) -> None:
    """Raise InputError if one key overrides another."""
    if {"mass", DENSITY.name} <= {*fixed, *parameters}:
        refuse("mass and density are both given", "one of them")
    for name in fixed:
        # A fixed value may be the mean of a normal distribution.
        if name in parameters and ("std" not in parameters[name] or "mean" in parameters[name]):
            refuse(
                f"[fixed] {name} has no effect because of [parameters] {name}",
                "one of them, or std without mean in [parameters]",
            )


def _require_valid(study: Study, fixed: Mapping[str, Any]) -> None:
    """Raise InputError if a fixed value is invalid for all values of the parameters."""
    keys = {name.partition("(")[0] for name in fixed} | ({"mass"} if study.density else set())
    errors = []
    for quantile in TRIAL_QUANTILES:
        try:
            check_case(impact_only(study.trial_case(quantile)))
        except InputError as error:
            errors.append(error)
    named = [error.note.subject.rpartition(".")[2] for error in errors if error.note]
    if len(named) == len(TRIAL_QUANTILES) and keys.issuperset(named):
        place = "[fixed]"
        raise errors[0].within(place) from errors[0]


def with_density(case: Case, density: float) -> Case:
    """Return a case whose mass follows from the density of the wall, kg/m3."""
    volume = wall_volume(case.ball.outer_radius, case.ball.wall_thickness)
    return replace(case, ball=replace(case.ball, mass=density * volume))


def wall_volume(outer_radius: Any, wall_thickness: Any) -> Any:  # noqa: ANN401 - or arrays
    """Return the volume of the wall of a ball, m3; lengths in m."""
    inner = outer_radius - wall_thickness
    # Powers of extreme radii would raise OverflowError; their products are infinite.
    outer_cube, inner_cube = (radius * radius * radius for radius in (outer_radius, inner))
    return 4 / 3 * np.pi * (outer_cube - inner_cube)
