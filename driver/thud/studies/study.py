"""Studies as TOML files: the case, and parameters that vary or are fitted."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from thud.base._schema import MODELS, FiniteElement
from thud.base.bridge import version
from thud.base.checks import (
    MAX_SEED,
    refuse,
    refuse_unknown,
    refuse_value,
    require_array,
    require_choice,
    require_kind,
    require_whole,
    shown,
)
from thud.base.errors import InputError
from thud.base.extras import require_extra
from thud.base.toml_tables import read_toml
from thud.case.case import Case, check_case, impact_only, new_model, read_case
from thud.case.keys import DENSITY, TEMPERATURE, find_key, value_in, with_values
from thud.studies.kinds import KINDS
from thud.studies.parameter import MAX_VALUES, Parameter, read_quantity, read_value, read_varied
from thud.studies.sampling import MIN_BASE_SAMPLES, SAMPLED, unit_samples
from thud.studies.temperature import read_temperature

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from thud.studies.arrays import Columns
    from thud.studies.temperature import Temperature
    from thud.studies.trained_surrogate import Surrogate


# Types that a study is read from.
Source: TypeAlias = "str | os.PathLike[str] | Mapping[str, object] | Study"

# Keys and tables that every study may have, and those of studies of samples.
COMMON_KEYS = ("name", "case", "fixed", "parameters")
_SAMPLE_KEYS = ("design", "temperature", "surrogate")
# Numbers of samples in a block, which takes some tenths of a second, of elements more: predicted by
# a surrogate, by the batch of shells, by other models, and by elements.
_SURROGATE_BLOCK_SIZE, _BATCH_BLOCK_SIZE, _BLOCK_SIZE, _ELEMENT_BLOCK_SIZE = 2**16, 2**14, 32, 1


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
    design : str
        ``"grid"``, ``"list"``, ``"random"``, ``"latin_hypercube"``, ``"sobol"`` or ``"saltelli"``.
    size, seed : int
        Number of random samples (of base samples for ``"saltelli"``), and the seed.
    temperature : Temperature or None
        How the material depends on temperature, if the temperature is a parameter.
    surrogate : Surrogate or None
        Surrogate that predicts the samples instead of the model.
    """

    name: str
    kind: str
    case: Case
    parameters: tuple[Parameter, ...]
    density: float | None = None
    text: str = field(default="", compare=False, repr=False)
    inputs: tuple[str | os.PathLike[str], ...] = field(default=(), compare=False, repr=False)
    design: str = "grid"
    size: int = 0
    seed: int = 0
    temperature: Temperature | None = None
    surrogate: Surrogate | None = None

    @property
    def model(self) -> str:
        """Name of the source model."""
        return self.case.model.name if self.case.model else ""

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values of each parameter in a grid; for other designs the number of samples."""
        if self.design in {"grid", "list"}:
            sizes = tuple(parameter.size for parameter in self.parameters)
            return sizes if self.design == "grid" else sizes[:1]
        per_base = len(self.parameters) + 2 if self.design == "saltelli" else 1
        return (self.size * per_base,)

    @property
    def count(self) -> int:
        """Number of samples."""
        return math.prod(self.shape)

    @property
    def block_size(self) -> int:
        """Number of samples that are computed together, the same for all executors."""
        if self.surrogate:
            return _SURROGATE_BLOCK_SIZE
        if self.model == "finite_element":
            return _ELEMENT_BLOCK_SIZE
        is_exact = self.case.levels.method == "exact"
        # Samples of surrogates have forces.
        is_batch = is_exact and not self.case.floor and self.kind != "surrogate"
        return _BATCH_BLOCK_SIZE if self.model == "hollow_sphere" and is_batch else _BLOCK_SIZE

    @property
    def identity(self) -> dict[str, str]:
        """Versions and settings on which the results depend, as texts by group and key."""
        result = {"thud": version(), "kind": self.kind}
        # Other versions may make other points.
        makers = ("scipy", "SALib") if self.design == "saltelli" else ("scipy",)
        for name in makers if self.design in SAMPLED else ():
            result[f"{name.lower()}_version"] = metadata.version(name)
        result["[design]"] = f"{self.design}, size {self.size}, seed {self.seed}"
        result["[parameters]"] = ", ".join(parameter.name for parameter in self.parameters)
        result |= {f"[parameters] {p.name}": str(p) for p in self.parameters}
        if self.temperature:
            result["[temperature]"] = f"{self.temperature}"
        if self.surrogate:
            result["surrogate"] = self.surrogate.digest
        if self.density is not None:
            result["[fixed] density"] = f"{self.density!r} kg/m3"
        for group, keys in self.case.resolved().to_namelist().items():
            result |= {f"&{group}: {key}": f"{value!r}" for key, value in keys.items()}
        # Blocks of another size would overlap or leave gaps.
        return {**result, "samples in a block": f"{self.block_size}"}

    def parameter_columns(self, start: int, stop: int) -> Columns:
        """Return values of samples `start` to `stop` - 1 by parameter, shape (n_sample,)."""
        if self.design == "grid":
            indices = np.unravel_index(np.arange(start, stop), self.shape)
            return {p.name: p.grid()[i] for p, i in zip(self.parameters, indices, strict=True)}
        if self.design == "list":
            return {p.name: p.grid()[start:stop] for p in self.parameters}
        points = unit_samples(self.design, len(self.parameters), self.size, self.seed)[start:stop]
        return {p.name: p.quantiles(points[:, i]) for i, p in enumerate(self.parameters)}

    def key_columns(self, columns: Columns) -> Columns:
        """Return samples of `parameter_columns` as values of keys, shape (n_sample,).

        The density determines the mass; the temperature determines modulus and loss factor.
        """
        result = dict(columns)
        density = result.pop(DENSITY.name, self.density)
        if density is not None:
            ball = vars(self.case.resolved().ball) | result
            volume = wall_volume(ball["outer_radius"], ball["wall_thickness"])
            result["mass"] = density * volume * np.ones(len(next(iter(columns.values()))))
        return self.temperature.apply(self.case, result) if self.temperature else result


def read_study(source: Source, kind: str = "sweep", case: Case | None = None) -> Study:
    """Read a study of samples.

    Parameters
    ----------
    source
        Path of a TOML file, or its content as a mapping, see docs/studies.md; a mapping of names of
        keys to lists or `Parameter` is the table ``[parameters]``.
    kind
        ``"sweep"``, ``"sensitivity"``, ``"design"`` or ``"uncertainty"``.
    case
        The case, if the study states none.

    Returns
    -------
    Study
        The study, complete and checked.

    Raises
    ------
    InputError
        If the study is invalid; the message names file, table, key and what is allowed.
    """
    require_choice("kind", kind, KINDS)
    if isinstance(source, Study):
        if source.kind != kind:
            refuse(f"{source.name} is a {source.kind} study", f"a {kind} study")
        return source
    with read_tables(source) as (content, folder, text):
        study = read_common(content, folder, kind, _SAMPLE_KEYS, _read_parameter, case)
        own = () if isinstance(source, Mapping) else (source,)
        alone = impact_only(study.case)
        if isinstance(alone.model, FiniteElement):
            alone = replace(alone, model=replace(alone.model, snapshot_interval=0.0))
        study = replace(
            study,
            case=alone,
            text=text,
            inputs=(*own, *named_files(content, folder)),
            **read_design(table_of(content, "design"), KINDS[kind].designs, study.parameters),
        )
        if TEMPERATURE.name in {*content, *(parameter.name for parameter in study.parameters)}:
            law = read_temperature(content.get("temperature"), study.case, study.parameters)
            study = replace(study, temperature=law)
        if (path := content.get("surrogate")) is not None:
            if not isinstance(path, str) or not path.strip():
                refuse_value("surrogate", path, "the path of the results of a surrogate")
            study = with_surrogate(study, folder / path)
        return study


@contextmanager
def read_tables(
    source: str | os.PathLike[str] | Mapping[str, object],
) -> Iterator[tuple[dict[str, Any], Path, str]]:
    """Yield tables, folder and text of a study; InputErrors within the block name its file."""
    if isinstance(source, Mapping):
        if source and not {*source} & {*COMMON_KEYS, *_SAMPLE_KEYS, "target"}:
            entries: dict[str, Any] = dict(source)
            for name, entry in entries.items():
                if not isinstance(entry, Mapping | Parameter):
                    entries[name] = {"values": np.atleast_1d(require_array(name, entry, (0, 1)))}
            source = {"parameters": entries}
        try:
            text = json.dumps(source, default=_plain)
        except (TypeError, ValueError, RecursionError) as error:
            cause = f"the study cannot be written as JSON ({error})"
            refuse(cause, "tables, lists, numbers and text", error)
        yield {"name": "python", **json.loads(text)}, Path(), text
        return
    require_kind("study", source, str | Path)
    path = Path(source)
    content, text = read_toml(path)
    try:
        yield {"name": path.stem, **content}, path.parent, text
    except InputError as error:
        raise error.within(path) from error


def _plain(value: object) -> object:
    """Return tables, paths, and NumPy numbers and arrays in types of JSON."""
    if isinstance(value, Parameter | Mapping):
        return value.table if isinstance(value, Parameter) else dict(value)
    if isinstance(value, np.generic | np.ndarray | os.PathLike):
        return os.fspath(value) if isinstance(value, os.PathLike) else value.tolist()
    message = f"an object of {type(value).__name__}"
    raise TypeError(message)


def named_files(value: object, folder: Path) -> Iterator[Path]:
    """Yield the existing files that a study names by paths relative to a folder."""
    if isinstance(value, str):
        with suppress(OSError, ValueError):
            if (folder / value).is_file():
                yield folder / value
    elif isinstance(value, Mapping | list):
        for entry in value.values() if isinstance(value, Mapping) else value:
            yield from named_files(entry, folder)


def read_common(  # noqa: PLR0913, PLR0917 - tables, their names, and how parameters are read
    content: dict[str, Any],
    folder: Path,
    kind: str,
    own_keys: Iterable[str],
    new_parameter: Callable[[str, object, Case, float | None], Parameter],
    case: Case | None = None,
) -> Study:
    """Read the part that studies and fits share; `own_keys` are those besides `COMMON_KEYS`."""
    refuse_unknown("the study", content, (*COMMON_KEYS, *own_keys))
    fixed, parameters = (table_of(content, name) for name in ("fixed", "parameters"))
    check_case(Case(name=content["name"]))
    case = _read_case(content.get("case"), folder, fixed, case)
    case, density = fix_keys(case, fixed)
    if not parameters:
        refuse("[parameters] is empty", "one parameter or more")
    varied = tuple(new_parameter(name, entry, case, density) for name, entry in parameters.items())
    if {"mass", DENSITY.name} <= {*fixed, *parameters}:
        refuse("mass and density are both given", "one of them")
    for name in fixed:
        # A fixed value may be the mean of a normal distribution.
        if name in parameters and ("std" not in parameters[name] or "mean" in parameters[name]):
            refuse(
                f"[fixed] {name} has no effect because of [parameters] {name}",
                "one of them, or std without mean in [parameters]",
            )
    return Study(content["name"].rstrip(), kind, case, varied, density)


def table_of(content: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Return a table of a study, empty if it is missing."""
    table = content.get(name, {})
    if not isinstance(table, dict):
        refuse_value(name, table, f"a table [{name}]")
    return table


def _read_case(entry: object, folder: Path, fixed: Mapping[str, Any], case: Case | None) -> Case:
    """Return the case of a study: a namelist file, tables of groups, or an object."""
    require_kind("case", case, Case | None)
    if not isinstance(entry, str | Mapping | None) or (entry is not None and case is not None):
        refuse_value("case", entry, "the path of a namelist file, tables of its groups, or case=")
    if isinstance(entry, Mapping):
        case = Case.from_namelist(entry)
    elif entry is not None:
        case = read_case(folder / entry)
    case = Case() if case is None else case
    require_kind("case", case, Case)
    if (model := fixed.get("model")) is not None:
        if not isinstance(model, str):
            refuse_value("[fixed] model", model, ", ".join(MODELS))
        if case.model is None or model != case.model.name:
            case = replace(case, model=new_model(model, {}))
    if case.model is None:
        refuse(f"case = {shown(entry)} has no source model", "a case with a source model")
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


def _read_parameter(name: str, entry: object, case: Case, density: float | None) -> Parameter:
    """Return a parameter that varies."""
    if name == "bands":
        refuse("[parameters] bands is not allowed", "bands in [fixed], the same for all samples")
    mean = density if name == DENSITY.name else value_in(case, name)
    return read_varied(name, entry, case, mean)


def read_design(
    table: Mapping[str, Any], allowed: tuple[str, ...], parameters: tuple[Parameter, ...]
) -> dict[str, Any]:
    """Return design, size and seed of ``[design]``; the first allowed kind is the default."""
    design = table.get("kind", allowed[0])
    if design not in allowed:
        refuse_value("[design] kind", design, ", ".join(allowed))
    is_sampled = design in SAMPLED
    words = ("kind", "size", "seed") if is_sampled else ("kind",)
    refuse_unknown(f"[design] of kind {design}", table, words)
    for parameter in parameters:
        label = f"[parameters] {parameter.name}"
        if is_sampled and parameter.count:
            refuse(f"{label}: count is not used by a {design} design", "low, high and scale")
        if not is_sampled and not parameter.size:
            refuse(
                f"{label} has no values for a {design} design",
                "values = [...], or low, high and count",
            )
    if not is_sampled:
        sizes = [parameter.size for parameter in parameters]
        if design == "list" and len(set(sizes)) > 1:
            refuse("[parameters] differ in their number of values", "the same for all")
        if design == "grid" and math.prod(sizes) > MAX_VALUES:
            refuse("[parameters] make too many samples", f"up to {MAX_VALUES} in a grid")
        return {"design": design}
    size, seed = table.get("size", 0), table.get("seed", 0)
    minimum = MIN_BASE_SAMPLES if design == "saltelli" else 1
    require_whole("[design] size", size, minimum, MAX_VALUES)
    require_whole("[design] seed", seed, 0, MAX_SEED)
    if design in {"sobol", "saltelli"} and size & (size - 1):
        near = 1 << size.bit_length() - 1
        refuse(
            f"[design] size = {size} breaks the balance of Sobol's points",
            f"powers of 2, such as {near} or {2 * near}",
        )
    return {"design": design, "size": size, "seed": seed}


def with_surrogate(study: Study, surrogate: Surrogate | str | os.PathLike[str]) -> Study:
    """Return a study whose samples a surrogate predicts; raise InputError if it cannot."""
    with require_extra("studies"):
        from thud.studies.trained_surrogate import Surrogate, read_surrogate
    if study.case.floor:
        refuse("[surrogate] is not allowed with a floor", "a case without &floor")
    trained = surrogate if isinstance(surrogate, Surrogate) else read_surrogate(surrogate)
    trained.require(study.case, study.key_columns(study.parameter_columns(0, 1)))
    files = (surrogate,) if isinstance(surrogate, str | os.PathLike) else ()
    return replace(study, surrogate=trained, inputs=(*study.inputs, *files))


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
