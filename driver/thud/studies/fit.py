"""Fits: parameters of a model from a force history or from levels."""

from __future__ import annotations

import hashlib
import json
import warnings
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any, Unpack

from thud.case import Case
from thud.checks import (
    LARGEST_SEED,
    refuse,
    refuse_value,
    require_kind,
    require_number,
    require_whole,
    require_words,
)
from thud.columns import read_table
from thud.errors import FitWarning
from thud.key import check_keywords
from thud.record import read_record
from thud.recordings.formats import FORMATS as RECORDING_FORMATS
from thud.recordings.recording import Recording, read_recording
from thud.studies.directory import FORMATS
from thud.studies.emulation.answered_levels import answered, confirmed, within_region
from thud.studies.emulation.plan import read_plan
from thud.studies.emulation.surrogate import Surrogate, read_surrogate
from thud.studies.fitting.force_target import ForceTarget
from thud.studies.fitting.inference import require_confidence
from thud.studies.fitting.level_target import LevelTarget
from thud.studies.fitting.ranges import bound_parameters, fitted_parameter, get_ranges
from thud.studies.fitting.result import Fit
from thud.studies.fitting.search import search
from thud.studies.kind import Kind
from thud.studies.parameter import quantity
from thud.studies.study import Study, table_of, with_density
from thud.units import power_of, scaled

if TYPE_CHECKING:
    import os
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

    from thud.impact import Impact
    from thud.studies.fitting.misfit import Misfit
    from thud.studies.fitting.ranges import Range
    from thud.studies.kind import How
    from thud.studies.parameter import Parameter

# Options of a search, and their defaults.
OPTIONS = {"confidence": 0.95, "starts": 1, "seed": 0, "max_steps": 100}
# Maximum number of starts, and of steps of a search.
_MAXIMUM = 100_000
# What [target] may hold, and the units of its numbers.
FORCE_KEYS = ("file", "config", *(f.name for f in fields(ForceTarget) if f.name != "record"))
LEVEL_KEYS = tuple(f.name for f in fields(LevelTarget))
TARGET_UNITS = {"noise": "N", "below": "Hz", "window": "s", "frequencies": "Hz"}


@check_keywords
def fit(  # noqa: PLR0913 - options of a search
    target: ForceTarget | LevelTarget | Recording | Impact | tuple[ArrayLike, ArrayLike],
    parameters: Iterable[str] | Mapping[str, Parameter | float | None],
    case: Case | None = None,
    *,
    confidence: float = 0.95,
    starts: int = 1,
    seed: int = 0,
    max_steps: int = 100,
    surrogate: Surrogate | str | os.PathLike[str] | None = None,
    progress: bool = False,
) -> Fit:
    """Estimate parameters of a model from a force history or from levels, by least squares.

    Trust-region reflective steps (`scipy.optimize.least_squares`) within the limits, parameters
    scaled by their starts. Points at which the model cannot be computed are rejected.

    Parameters
    ----------
    target
        What is fitted; a recording, an impact or arrays of time, s, and force, N, are the record
        of a `ForceTarget`.
    parameters
        Names of keys of ball, drop or model that take real numbers; as a mapping, with their
        starts or `Parameter`.
    case
        Everything else; by default the ball of the paper in the model of the paper.
    confidence
        Confidence of the intervals.
    starts
        Number of starts: the given one, and others spread over the limits (over a factor of 2 to
        both sides where a limit is not given). The best end counts.
    seed
        Seed of the other starts.
    max_steps
        Maximum number of steps from each start.
    surrogate
        What answers the drops of the search instead of the model, or the path of its file; for
        levels. Its errors add to the given uncertainties; the impact at the result is the model's.
    progress
        Show how many impacts were computed.

    Returns
    -------
    Fit
        Values, covariance, intervals, residuals and warnings, also issued as `FitWarning`.

    Raises
    ------
    InputError
        Where target or parameters cannot be used.
    NumericalError
        Where the model cannot be computed around the best point.

    Examples
    --------
    >>> from thud.case import Ball
    >>> from thud.impact import solve
    >>> truth = solve(Ball(youngs_modulus=1.8e6))
    >>> round(fit(truth, ["youngs_modulus"]).values["youngs_modulus"])
    1800000
    """
    case = Case() if case is None else case
    require_kind("case", case, Case)
    options = {"confidence": confidence, "starts": starts, "seed": seed, "max_steps": max_steps}
    _require_options(options)
    ranges = get_ranges(case, bound_parameters(case, parameters))
    if not isinstance(target, ForceTarget | LevelTarget):
        target = ForceTarget(target)
    if surrogate is not None and not isinstance(surrogate, Surrogate):
        surrogate = read_surrogate(surrogate)
    found = _search(case, ranges, target.misfit(), options, surrogate, progress=progress)
    for sentence in found.warnings:
        warnings.warn(sentence, FitWarning, stacklevel=3)
    return found


def _search(  # noqa: PLR0913 - those of `search`, and a surrogate
    case: Case,
    ranges: list[Range],
    misfit: Misfit,
    options: Mapping[str, Any],
    surrogate: Surrogate | None,
    *,
    progress: bool,
) -> Fit:
    """Return the best fit by the model or, where there is one, by a surrogate."""
    if surrogate is None:
        return search(case, ranges, misfit, options, progress=progress)
    by_answers = answered(misfit, surrogate, case, [entry.name for entry in ranges])
    inside = [within_region(entry, surrogate) for entry in ranges]
    return confirmed(search(case, inside, by_answers, options, progress=progress), by_answers)


def _require_options(options: Mapping[str, Any]) -> None:
    require_confidence(options["confidence"])
    require_whole("starts", options["starts"], 1, _MAXIMUM)
    require_whole("max_steps", options["max_steps"], 1, _MAXIMUM)
    require_whole("seed", options["seed"], 0, LARGEST_SEED)


@dataclass(frozen=True)
class FitStudy(Study):
    """A fit as a file describes it.

    Attributes
    ----------
    target : ForceTarget or LevelTarget
        What is fitted.
    tables : dict
        The file as JSON holds it.
    options : dict
        Confidence of the intervals, starts, seed and maximum number of steps.
    surrogate : Surrogate or None
        What answers the drops instead of the model.
    """

    target: ForceTarget | LevelTarget = field(default_factory=lambda: LevelTarget(()))
    tables: dict[str, Any] = field(default_factory=dict)
    options: dict[str, Any] = field(default_factory=lambda: dict(OPTIONS))
    surrogate: Surrogate | None = None

    @property
    def units(self) -> dict[str, tuple[str, float]]:
        """Units of the file by parameter: name, and how many SI units it is."""
        shown = {p.name: p.shown_unit for p in self.parameters if p.unit}
        return {name: (unit, scaled(1.0, power)) for name, (unit, power) in shown.items()}

    def own_identity(self) -> dict[str, str]:
        """Return target and search."""
        vector = self.target.misfit().target_vector()
        return {
            **{f"[target] {key}": f"{value!r}" for key, value in self.tables["target"].items()},
            "numbers of [target]": hashlib.sha256(vector.tobytes()).hexdigest()[:16],
            **{name: f"{value!r}" for name, value in self.options.items()},
            **({"surrogate": self.surrogate.digest} if self.surrogate else {}),
        }


class FitKind(Kind[FitStudy, Fit]):
    """Fits as a kind of study."""

    name = "fit"
    words = ("target", "surrogate", *OPTIONS)

    def new_parameter(self, name: str, given: object, case: Case, centre: object) -> Parameter:  # noqa: ARG002
        """Return a parameter that is fitted."""
        return fitted_parameter(name, given, case)

    def complete(self, study: Study, given: Mapping[str, Any], folder: Path) -> FitStudy:
        """Return a study with its target."""
        names = {parameter.name for parameter in study.parameters}
        if study.density is not None and names & {"outer_radius", "wall_thickness"}:
            refuse("[fixed] density is not allowed beside a geometry that is fitted", "mass")
        case = study.case
        if study.density is not None:
            case = with_density(case, study.density)
        target = _read_target(table_of(given, "target"), folder)
        options = {name: given.get(name, default) for name, default in OPTIONS.items()}
        _require_options(options)
        get_ranges(case, study.parameters)
        target.misfit()
        # JSON knows neither dates nor infinity.
        tables = json.loads(json.dumps(given, default=str), parse_constant=str)
        head = {**vars(study), "case": case}
        found = FitStudy(**head, target=target, tables=tables, options=options)
        if "surrogate" not in given:
            return found
        trained = read_plan(table_of(given, "surrogate"), folder)
        if not isinstance(trained, Surrogate):
            refuse("[surrogate] of a fit has no file", "file, of a surrogate that is trained")
        return self.with_surrogate(found, trained)

    def with_surrogate(
        self, study: FitStudy, given: Surrogate | str | os.PathLike[str]
    ) -> FitStudy:
        """Return a study whose drops a surrogate answers. Raises InputError where it cannot."""
        trained = given if isinstance(given, Surrogate) else read_surrogate(given)
        names = [parameter.name for parameter in study.parameters]
        answered(study.target.misfit(), trained, study.case, names)
        return replace(study, surrogate=trained)

    def compute(self, study: FitStudy, folder: Path | None, **how: Unpack[How]) -> Fit:  # noqa: ARG002
        """Return the fit."""
        return _search(
            study.case,
            get_ranges(study.case, study.parameters),
            study.target.misfit(),
            study.options,
            study.surrogate,
            progress=how.get("progress", False),
        )

    def results(self, study: FitStudy) -> list[str]:  # noqa: ARG002
        """Return the name of the file that holds the identity."""
        return ["fit.json"]

    def identity_in(self, path: Path) -> dict[str, str]:
        """Return the identity of a fit."""
        return dict(json.loads(path.read_bytes())["identity"])

    def other_files(self, study: FitStudy) -> list[str]:  # noqa: ARG002
        """Return the names of the other files."""
        figures = [f"{name}{ending}" for name in ("fit", "confidence") for ending in FORMATS]
        return ["fit.csv", "fitted.nml", *figures]

    def table(self, result: Fit, study: FitStudy) -> str:
        """Return the fit as text."""
        return f"{study.name}\n\n{result.table(study.units)}"

    def remarks(self, result: Fit) -> list[str]:
        """Return the warnings, and what is not plausible in the impact that was found."""
        return [*result.warnings, *result.impact.remarks]

    def succeeded(self, result: Fit) -> bool:
        """Return whether the search has converged."""
        return result.converged

    def files(self, result: Fit, study: FitStudy) -> dict[str, bytes]:
        """Return the numbers of the fit and its case."""
        return result.files(study=study.tables, identity=study.identity)

    def figures(self, result: Fit, study: FitStudy) -> dict[str, Figure]:
        """Return target and fit, and confidence regions."""
        return result.figures(study.units)


KIND = FitKind()


def _read_target(table: dict[str, Any], folder: Path) -> ForceTarget | LevelTarget:
    if ("file" in table) == ("levels" in table):
        refuse("[target] takes one of file and levels", "file = 'record.csv' or levels = [...]")
    require_words("[target]", table, FORCE_KEYS if "file" in table else LEVEL_KEYS)
    options = {
        name: quantity(f"[target] {name}", value, TARGET_UNITS[name])
        if name in TARGET_UNITS
        else value
        for name, value in table.items()
    }
    if "levels" in table:
        for name, unit in (("contact_time", "s"), ("restitution", "")):
            if name in options:
                options[name] = _measured(f"[target] {name}", options[name], unit)
        return LevelTarget(**options)
    if not isinstance(options.get("time_shift", True), bool):
        given = options["time_shift"]
        refuse_value("[target] time_shift", given, "true, false")
    paths = {word: options.pop(word) for word in ("file", "config") if word in options}
    for word, name in paths.items():
        if not isinstance(name, str) or not name.strip():
            refuse_value(f"[target] {word}", name, "text in quotes")
    return ForceTarget(
        _read_record(
            folder / paths["file"],
            folder / paths["config"] if "config" in paths else None,
            measured=bool({"config", "drop"} & set(table)),
        ),
        **options,
    )


def _read_record(
    path: Path, config: Path | None, *, measured: bool
) -> Recording | tuple[ArrayLike, ArrayLike]:
    """Return the record of a file.

    Tables of time and force are taken as they are unless they shall be measured; a model, or
    another program, may have written them.
    """
    others = {end for one in RECORDING_FORMATS if one.module != "text" for end in one.suffixes}
    if measured or path.suffix.lower() in others:
        return read_recording(path, config=config)
    samples = read_table(path)
    read_record(samples, str(path))  # refuses what is not a record
    return samples[:, 0], samples[:, 1]


def _measured(place: str, given: object, unit: str) -> tuple[float, float]:
    """Return value and standard deviation of a table in the unit of a key."""
    words = ("value", "uncertainty")
    if not isinstance(given, dict) or not set(words) <= set(given):
        refuse_value(place, given, "a table of value, uncertainty, unit")
    require_words(place, given, (*words, "unit"))
    power = power_of(given.get("unit", unit or "1"), unit, place)
    for word in words:
        require_number(f"{place}: {word}", given[word])
    return scaled(given["value"], power), scaled(given["uncertainty"], power)
