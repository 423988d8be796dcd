"""Fits: parameters of a model from a force history or from levels."""

from __future__ import annotations

import hashlib
import json
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Unpack

from thud.base._schema import FiniteElement
from thud.base.checks import MAX_SEED, refuse, refuse_value, require_kind, require_whole
from thud.base.errors import FitWarning, InputError, ThudError
from thud.base.files import read_input
from thud.case.case import Case, check_case
from thud.case.keys import with_values
from thud.studies.directory import FORMATS
from thud.studies.fitting.alternatives import UNKNOWNS, require_unknowns
from thud.studies.fitting.fit_result import Fit, file_ends
from thud.studies.fitting.force_target import ForceTarget
from thud.studies.fitting.inference import require_confidence
from thud.studies.fitting.ranges import bound_parameters, fitted_parameter, get_ranges
from thud.studies.fitting.read_target import Target, read_target
from thud.studies.fitting.search import search
from thud.studies.kind import Kind
from thud.studies.study import Study, fix_keys, table_of, with_density

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence, Set as AbstractSet
    from pathlib import Path

    from numpy.typing import ArrayLike

    from thud.impact.impact import Impact
    from thud.recordings.recording import Recording
    from thud.studies.directory import StudyDirectory
    from thud.studies.fitting.misfit import Misfit
    from thud.studies.fitting.ranges import Range
    from thud.studies.kind import RunOptions
    from thud.studies.parameter import Parameter

# Options of a search, and their defaults.
OPTIONS: dict[str, Any] = {
    "confidence": 0.95,
    "starts": 1,
    "seed": 0,
    "max_steps": 100,
    "unknowns": tuple(UNKNOWNS),
}
# Maximum number of starts, and of steps of a search.
_MAXIMUM = 100_000


def fit(  # noqa: PLR0913 - options of a search
    target: Target | Recording | Impact | tuple[ArrayLike, ArrayLike] | list[Target],
    parameters: Iterable[str] | Mapping[str, Parameter | float | None],
    case: Case | None = None,
    *,
    confidence: float = 0.95,
    starts: int = 1,
    seed: int = 0,
    max_steps: int = 100,
    unknowns: Sequence[str] = tuple(UNKNOWNS),
    progress: bool = False,
) -> Fit:
    """Estimate parameters of a model from a force history or from levels, by least squares.

    The search takes trust-region reflective steps (`scipy.optimize.least_squares`) within the
    limits; parameters are scaled by their starts. Points where the model fails are rejected.

    Parameters
    ----------
    target
        The data; a recording, an impact or arrays of time, s, and force, N, are the record of a
        `ForceTarget`. A list of targets is fitted jointly, each with its own `fixed` keys.
    parameters
        Names of keys of ball, drop or model with real values; a mapping states the start or a
        `Parameter` of each.
    case
        All other keys; by default the standard ball, dropped from 1 m.
    confidence
        Confidence of the intervals.
    starts
        Number of starting points: the start of the parameters, and others spread over the limits,
        or within a factor of 2 of the start if there are no limits. The best fit is returned.
    seed
        Seed of the other starting points.
    max_steps
        Maximum number of steps from each starting point.
    unknowns
        What is not known of the ball or the floor of a force: intervals include what the force does
        not exclude; none: the case is trusted.
    progress
        Show the number of computed impacts.

    Returns
    -------
    Fit
        Values, covariance, intervals, residuals and warnings, also issued as `FitWarning`.

    Raises
    ------
    InputError
        If target or parameters cannot be used.
    NumericalError
        If the model cannot be computed around the best point.

    Examples
    --------
    >>> import thud
    >>> truth = thud.solve(thud.Ball(youngs_modulus=1.8e6))
    >>> round(fit(truth, ["youngs_modulus"]).values["youngs_modulus"])
    1800000
    """
    case = Case() if case is None else case
    require_kind("case", case, Case)
    options = {
        "confidence": confidence,
        "starts": starts,
        "seed": seed,
        "max_steps": max_steps,
        "unknowns": unknowns,
    }
    _require_options(options)
    bound = bound_parameters(case, parameters)
    pairs = _pairs(case, _targets(target), {parameter.name for parameter in bound})
    result = _search(pairs, get_ranges(case, bound), options, progress=progress)
    for note in result.warnings:
        warnings.warn(FitWarning(note), stacklevel=3)
    return result


def _targets(target: Any) -> tuple[Target, ...]:  # noqa: ANN401 - checked here
    if not isinstance(target, list):
        target = [target if isinstance(target, Target) else ForceTarget(target)]
    elif not target or not all(isinstance(entry, Target) for entry in target):
        refuse("target is a list with other entries than targets", "ForceTarget and LevelTarget")
    return tuple(target)


def _pairs(
    case: Case, targets: Sequence[Target], names: AbstractSet[str]
) -> list[tuple[Case, Misfit]]:
    result: list[tuple[Case, Misfit]] = []
    for number, target in enumerate(targets, start=1):
        label = "target" if len(targets) == 1 else f"target {number}"
        require_kind(f"{label}: fixed", target.fixed, Mapping)
        for name in target.fixed:
            if name in names or name == "model":
                refuse(
                    f"{label}: fixed {name} is not allowed",
                    "keys of ball, drop and model that are not among [parameters]",
                )
        target_case, density = fix_keys(case, target.fixed, f"{label}: fixed")
        target_case = target_case if density is None else with_density(target_case, density)
        try:
            if target.fixed:
                check_case(replace(target_case, modes=None))
            result.append((target_case, target.misfit()))
        except InputError as error:
            if len(targets) == 1:
                raise
            message = f"{label}: {str(error).removeprefix('target: ')}"
            raise InputError(message, error.note) from error
    return result


def _search(
    pairs: list[tuple[Case, Misfit]],
    ranges: list[Range],
    options: Mapping[str, Any],
    *,
    progress: bool,
) -> Fit:
    pairs = [(_with_mesh(case, misfit, ranges), misfit) for case, misfit in pairs]
    return search(pairs, ranges, options, progress=progress)


def _with_mesh(case: Case, misfit: Misfit, ranges: list[Range]) -> Case:
    """Return a case whose automatic finite elements are those of the start of a search.

    The elements would change between points of the search, and with them a level by up to 0.2 dB.
    """
    model = case.model
    if not isinstance(model, FiniteElement) or model.radial_elements or model.polar_elements:
        return case
    start = {entry.name: entry.start for entry in ranges}
    try:
        quantities = misfit.solve(with_values(case, start)).model_quantities
    except ThudError:
        return case  # The search reports it.
    mesh = replace(
        model,
        radial_elements=round(quantities["radial_elements"]),
        polar_elements=round(quantities["polar_elements"]),
    )
    return replace(case, model=mesh)


def _require_options(options: Mapping[str, Any]) -> None:
    require_confidence(options["confidence"])
    require_whole("starts", options["starts"], 1, _MAXIMUM)
    require_whole("max_steps", options["max_steps"], 1, _MAXIMUM)
    require_whole("seed", options["seed"], 0, MAX_SEED)
    require_unknowns(options["unknowns"], UNKNOWNS)


@dataclass(frozen=True)
class FitStudy(Study):
    """A fit as a file describes it: targets, the tables of the file, options of the search."""

    targets: tuple[Target, ...] = ()
    tables: dict[str, Any] = field(default_factory=dict)
    options: dict[str, Any] = field(default_factory=lambda: dict(OPTIONS))

    def kind_settings(self) -> dict[str, str]:
        """Return the settings of targets and search."""
        tables = self.tables["target"]
        tables = tables if isinstance(tables, list) else [tables]
        result: dict[str, str] = {}
        for end, table, (_, misfit) in zip(
            file_ends(len(tables)), tables, self.pairs(), strict=True
        ):
            result |= {f"[target{end}] {key}": f"{value!r}" for key, value in table.items()}
            digest = hashlib.sha256(misfit.data().tobytes()).hexdigest()[:16]
            result[f"numbers of [target{end}]"] = digest
        return result | {name: f"{value!r}" for name, value in self.options.items()}

    def pairs(self) -> list[tuple[Case, Misfit]]:
        """Return the case and the misfit of each target."""
        return _pairs(self.case, self.targets, {parameter.name for parameter in self.parameters})


class FitKind(Kind[FitStudy, Fit]):
    """Fits as a kind of study."""

    name = "fit"
    own_keys = ("target", *OPTIONS)

    def new_parameter(self, name: str, entry: object, case: Case, density: object) -> Parameter:  # noqa: ARG002
        """Return a parameter that is fitted."""
        return fitted_parameter(name, entry, case)

    def complete(self, study: Study, content: Mapping[str, Any], folder: Path) -> FitStudy:
        """Return a study with its targets."""
        names = {parameter.name for parameter in study.parameters}
        if study.density is not None and names & {"outer_radius", "wall_thickness"}:
            refuse("[fixed] density is not allowed if the geometry is fitted", "mass")
        case = study.case
        if study.density is not None:
            case = with_density(case, study.density)
        tables = content.get("target")
        if not isinstance(tables, list):
            tables = [table_of(content, "target")]
        elif not tables or not all(isinstance(table, dict) for table in tables):
            refuse_value("target", tables, "a table [target], or several [[target]]")
        targets = tuple(read_target(table, folder) for table in tables)
        options = {name: content.get(name, default) for name, default in OPTIONS.items()}
        _require_options(options)
        get_ranges(case, study.parameters)
        # JSON knows neither dates nor infinity.
        shown = json.loads(json.dumps(content, default=str), parse_constant=str)
        common = {**vars(study), "case": case}
        result = FitStudy(**common, targets=targets, tables=shown, options=options)
        result.pairs()
        return result

    def compute(
        self,
        study: FitStudy,
        results: StudyDirectory | None,  # noqa: ARG002
        **options: Unpack[RunOptions],
    ) -> Fit:
        """Return the fit."""
        return _search(
            study.pairs(),
            get_ranges(study.case, study.parameters),
            study.options,
            progress=options.get("progress", False),
        )

    def identity_files(self, study: FitStudy) -> list[str]:  # noqa: ARG002
        """Return the name of the file that holds the identity."""
        return ["fit.json"]

    def identity_in(self, path: Path) -> dict[str, str]:
        """Return the identity of a fit."""
        return dict(json.loads(read_input(path))["identity"])

    def listed_files(self, study: FitStudy) -> list[str]:
        """Return the names of all files."""
        ends = file_ends(len(study.targets))
        names = [*(f"fit{end}" for end in ends), "confidence"]
        figures = [f"{name}{ending}" for name in names for ending in FORMATS]
        files = [
            "fit.json",
            *(name for end in ends for name in (f"fit{end}.csv", f"fitted{end}.nml")),
        ]
        return [*files, *figures]

    def files(self, result: Fit, study: FitStudy) -> dict[str, bytes]:
        """Return the numbers of the fit and its case."""
        return result.files(study=study.tables, identity=study.identity)


KIND = FitKind()
