"""Fits: parameters of a model from forces of impacts, levels, and curves of presses."""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tqdm import tqdm

from thud.base._schema import FiniteElement
from thud.base.checks import refuse, refuse_value, require_kind
from thud.base.errors import FitWarning, InputError, ThudError
from thud.base.files import Results
from thud.case.case import Case, check_case
from thud.case.keys import with_values
from thud.impact.compute import compute
from thud.studies.fitting.estimate import new_fit
from thud.studies.fitting.fit_report import file_ends
from thud.studies.fitting.force_target import ForceTarget
from thud.studies.fitting.read_target import Target, read_target
from thud.studies.fitting.search import (
    UNKNOWNS,
    Objective,
    SearchOptions,
    Term,
    find_best,
    require_data,
)
from thud.studies.parameter import fitted_parameter, get_ranges, known_parameters
from thud.studies.study import (
    fix_keys,
    named_files,
    read_common,
    read_tables,
    table_of,
    with_density,
)

if TYPE_CHECKING:
    import os
    from collections.abc import Sequence, Set as AbstractSet

    from numpy.typing import ArrayLike

    from thud.impact.impact import Impact
    from thud.recordings.recording import Recording
    from thud.studies.fitting.fit_result import Fit
    from thud.studies.parameter import Parameter, Range


def fit(  # noqa: PLR0913 - options of a search
    target: Target | Recording | Impact | tuple[ArrayLike, ArrayLike] | list[Target],
    parameters: Iterable[str] | Mapping[str, Parameter | float | None],
    case: Case | None = None,
    *,
    confidence: float = 0.95,
    starts: int = 1,
    seed: int = 0,
    max_steps: int = 100,
    unknowns: Sequence[str] = UNKNOWNS,
    progress: bool = False,
) -> Fit:
    """Estimate parameters of a model from forces, levels and curves of presses, by least squares.

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
    options = SearchOptions(confidence, starts, seed, max_steps, unknowns)
    options.require()
    require_kind("parameters", parameters, Iterable)
    if isinstance(parameters, str):
        parameters = [parameters]
    if not isinstance(parameters, Mapping):
        parameters = dict.fromkeys(map(str, parameters))
    if not parameters:
        refuse("parameters is empty", ", ".join(known_parameters(case)))
    bound = tuple(fitted_parameter(name, entry, case) for name, entry in parameters.items())
    if not isinstance(target, list):
        target = [target if isinstance(target, Target) else ForceTarget(target)]
    elif not target or not all(isinstance(entry, Target) for entry in target):
        kinds = "ForceTarget, LevelTarget and CompressionTarget"
        refuse("target is a list with other entries than targets", kinds)
    terms = _terms(case, target, bound)
    result = _search(terms, get_ranges(case, bound), options, progress=progress)
    for note in result.warnings:
        warnings.warn(FitWarning(note), stacklevel=3)
    return result


def _terms(case: Case, targets: Sequence[Target], parameters: Sequence[Parameter]) -> list[Term]:
    """Return case and comparison of each target; raise InputError that names the target."""
    names = {parameter.name for parameter in parameters}
    result: list[Term] = []
    own, row = len(names), 0
    for number, target in enumerate(targets, start=1):
        label = "target" if len(targets) == 1 else f"target {number}"
        target_case = case
        try:
            if target.fixed:
                target_case = _with_fixed(case, target.fixed, names)
                check_case(replace(target_case, modes=None))
            comparison = target.compare()
        except InputError as error:
            raise error.within(label) from error
        ends = own + len(comparison.own), row + comparison.size
        result.append(Term(target_case, comparison, slice(own, ends[0]), slice(row, ends[1])))
        own, row = ends
    return result


def _with_fixed(case: Case, fixed: Mapping[str, object], fitted: AbstractSet[str]) -> Case:
    """Return the case of a target with its fixed keys."""
    require_kind("fixed", fixed, Mapping)
    if wrong := [name for name in fixed if name in fitted or name == "model"]:
        refuse(
            f"fixed {wrong[0]} is not allowed",
            "keys of ball, drop and model that are not among [parameters]",
        )
    result, density = fix_keys(case, fixed, "fixed")
    return result if density is None else with_density(result, density)


def _search(
    terms: list[Term], ranges: list[Range], options: SearchOptions, *, progress: bool
) -> Fit:
    """Return the best fit of the parameters of cases to their targets."""
    require_data(terms, len(ranges))
    for i, term in enumerate(terms):
        model = term.case.model
        if isinstance(model, FiniteElement) and not (model.radial_elements or model.polar_elements):
            terms[i] = term._replace(case=_with_mesh(term.case, ranges))
    with tqdm(unit="impact", disable=not progress, leave=False) as bar:
        objective = Objective(terms, ranges, bar)
        best = find_best(objective, options)
        return new_fit(objective, best.x, options, converged=best.status > 0)


def _with_mesh(case: Case, ranges: list[Range]) -> Case:
    """Return a case whose automatic finite elements are those of the start of a search.

    The elements would change between points of the search, and with them a level by up to 0.2 dB.
    """
    try:
        start = with_values(case, {entry.name: entry.start for entry in ranges})
        quantities = compute(start).model_quantities
    except ThudError:
        return case  # The search reports it.
    numbers = {name: round(quantities[name]) for name in ("radial_elements", "polar_elements")}
    return with_values(case, numbers)


@dataclass(frozen=True)
class FitStudy:
    """A fit as a file describes it, complete and checked.

    Attributes
    ----------
    name : str
        Name of the fit and of its directory.
    case : Case
        The case, with the fixed keys.
    parameters : tuple of Parameter
        The parameters that are fitted.
    terms : list of Term
        Case and comparison of each target.
    options : SearchOptions
        Options of the search.
    tables : dict
        The tables of the file.
    inputs : tuple of path-like
        Files that it is read from.
    """

    name: str
    case: Case
    parameters: tuple[Parameter, ...]
    terms: list[Term]
    options: SearchOptions
    tables: dict[str, Any]
    inputs: tuple[str | os.PathLike[str], ...]

    @property
    def files(self) -> list[str]:
        """Names of all files of the results."""
        ends = file_ends(len(self.terms))
        names = (name for end in ends for name in (f"fit{end}.csv", f"fitted{end}.nml"))
        return ["fit.json", *names, *(f"fit{end}.svg" for end in ends), "confidence.svg"]


def read_fit_study(source: str | os.PathLike[str] | Mapping[str, object]) -> FitStudy:
    """Read a fit from a TOML file, or from a mapping of the same content; see docs/fit.md.

    Raises InputError if it is invalid; the message names file, table, key and what is allowed.
    """
    with read_tables(source) as (content, folder, _):
        study = read_common(
            content, folder, "fit", ("target", *SearchOptions._fields),
            lambda name, entry, case, _: fitted_parameter(name, entry, case),
        )  # fmt: skip
        case = study.case
        if study.density is not None:
            names = {parameter.name for parameter in study.parameters}
            if names & {"outer_radius", "wall_thickness"}:
                refuse("[fixed] density is not allowed if the geometry is fitted", "mass")
            case = with_density(case, study.density)
        tables = content.get("target")
        if not isinstance(tables, list):
            tables = [table_of(content, "target")]
        elif not tables or not all(isinstance(table, dict) for table in tables):
            refuse_value("target", tables, "a table [target], or several [[target]]")
        targets = [read_target(table, folder) for table in tables]
        stated = {name: content[name] for name in SearchOptions._fields if name in content}
        options = SearchOptions(**stated)
        options.require()
        get_ranges(case, study.parameters)
        # JSON knows neither dates nor infinity.
        shown = json.loads(json.dumps(content, default=str), parse_constant=str)
        terms = _terms(case, targets, study.parameters)
        own = () if isinstance(source, Mapping) else (source,)
        inputs = (*own, *named_files(content, folder))
        return FitStudy(study.name, case, study.parameters, terms, options, shown, inputs)


def run_fit(
    source: str | os.PathLike[str] | Mapping[str, object] | FitStudy,
    output: str | os.PathLike[str] | None = None,
    *,
    figures: bool = False,
    progress: bool = False,
    replace: bool = False,
) -> Fit:
    """Return the fit that a file describes, also written to a directory.

    Raises InputError, before the search, if the directory may not be replaced; see `Fit.save`.
    """
    study = source if isinstance(source, FitStudy) else read_fit_study(source)
    results = None
    if output is not None:
        results = Results(Path(output), "fit", study.name, study.inputs, replace=replace)
        results.require(study.files)
    ranges = get_ranges(study.case, study.parameters)
    result = _search(study.terms, ranges, study.options, progress=progress)
    if results:
        contents = result.files(study=study.tables)
        results.write(contents | (result.figure_files() if figures else {}))
    return result
