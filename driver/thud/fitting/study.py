"""Fits that a file describes, and the command that runs them."""

from __future__ import annotations

import hashlib
import json
import os
import sys
import tomllib
import warnings
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Any

from tqdm import tqdm

from thud.case import Case, read_case
from thud.checks import lock, require_number, require_own, require_words
from thud.columns import read_table
from thud.errors import FitWarning, InputError, NumericalError, ThudError
from thud.fitting.force_target import ForceTarget
from thud.fitting.level_target import LevelTarget
from thud.fitting.parameters import Parameter, require_known
from thud.fitting.search import fit
from thud.recording import Recording
from thud.units import power_of, scaled

if TYPE_CHECKING:
    import argparse
    from collections.abc import Mapping

    from thud.fitting.answer import Fit

OPTIONS = ("level", "starts", "seed", "max_steps")
FORCE_KEYS = ("file", *(f.name for f in fields(ForceTarget) if f.name != "record"))
LEVEL_KEYS = tuple(f.name for f in fields(LevelTarget))
PARAMETER_KEYS = ("start", "lower", "upper", "unit")


@dataclass(frozen=True, eq=False)
class Study:
    """A fit as a file describes it.

    Attributes
    ----------
    name : str
        Name of the file without its ending.
    base : Case
        Everything that is not fitted.
    target : ForceTarget or LevelTarget
        What is fitted.
    parameters : dict of str to Parameter
        The parameters, SI units.
    units : dict of str to tuple
        Units of the file by parameter: name, and how many SI units it is.
    options : dict
        Other arguments of `fit`.
    content : dict
        The file as JSON holds it.
    """

    name: str
    base: Case
    target: ForceTarget | LevelTarget
    parameters: dict[str, Parameter]
    units: dict[str, tuple[str, float]]
    options: dict[str, Any]
    content: dict[str, Any]

    @cached_property
    def identity(self) -> dict[str, Any]:
        """What tells it from other fits, as JSON holds it: its file, base case and target."""
        target = hashlib.sha256(self.target.misfit().target_vector().tobytes()).hexdigest()
        return {"study": self.content, "base_case": f"{self.base.to_namelist()}", "target": target}

    def run(self, *, progress: bool = False) -> Fit:
        """Return the fit; its warnings are not issued."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FitWarning)
            return fit(self.target, self.parameters, self.base, progress=progress, **self.options)


def read_study(path: str | os.PathLike[str]) -> Study:
    """Read a fit from a TOML file; other files are named from where it stands.

    Raises
    ------
    InputError
        Names file, table, key, value and what is allowed.
    """
    place = Path(path)
    try:
        content = tomllib.loads(place.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        message = f"{path}: cannot be read ({error}); allowed: a TOML file with a study"
        raise InputError(message) from error
    try:
        return _study(place, content)
    except InputError as error:
        message = f"{path}: {error}"
        raise InputError(message) from error


def _study(place: Path, content: dict[str, Any]) -> Study:
    """Return the study of a file's content."""
    require_words("the study", content, ("base", "target", "parameters", *OPTIONS))
    base = Case()
    if "base" in content:
        base = read_case(place.parent / _text("base", content["base"]))
    parameters: dict[str, Parameter] = {}
    units = {}
    for name in _table("parameters", content):
        where = f"[parameters.{name}]"
        key = require_known(base, name, "[parameters] ")
        given = _table(name, content["parameters"], where)
        require_words(where, given, PARAMETER_KEYS)
        power = power_of(given.get("unit", key.unit or "1"), key.unit, where)
        if "unit" in given:
            units[name] = (given["unit"], scaled(1.0, power))
        numbers = {word: value for word, value in given.items() if word != "unit"}
        for word, value in numbers.items():
            require_number(f"{where} {word}", value)
        values = {word: scaled(value, power) for word, value in numbers.items()}
        parameters[name] = Parameter(**values)
    target = _target(place, _table("target", content))
    options = {name: content[name] for name in OPTIONS if name in content}
    # JSON knows neither dates nor infinity.
    plain = json.loads(json.dumps(content, default=str), parse_constant=str)
    return Study(place.stem, base, target, parameters, units, options, plain)


def _target(place: Path, table: dict[str, Any]) -> ForceTarget | LevelTarget:
    """Return the target of a study."""
    if ("file" in table) == ("levels" in table):
        message = (
            "[target] takes one of file and levels; allowed: file = 'record.csv' or levels = [...]"
        )
        raise InputError(message)
    if "file" in table:
        require_words("[target]", table, FORCE_KEYS)
        options = {name: value for name, value in table.items() if name != "file"}
        path = place.parent / _text("[target] file", table["file"])
        samples = read_table(path)
        Recording.from_arrays(samples, str(path))  # complains about what is no recording
        for name in ("noise", "below"):
            if name in options:
                require_number(f"[target] {name}", options[name])
        if not isinstance(options.get("time_shift", True), bool):
            given = options["time_shift"]
            message = f"[target] time_shift = {given!r} is not allowed; allowed: true, false"
            raise InputError(message)
        return ForceTarget((samples[:, 0], samples[:, 1]), **options)
    require_words("[target]", table, LEVEL_KEYS)
    options = dict(table)
    for name, unit in (("contact_time", "s"), ("restitution", "")):
        if name in options:
            where = f"[target] {name}"
            pair = _table(name, table, where)
            require_words(where, pair, ("value", "uncertainty", "unit"))
            power = power_of(pair.get("unit", unit or "1"), unit, where)
            if not {"value", "uncertainty"} <= set(pair):
                message = f"{where} = {pair} is not allowed; allowed: value and uncertainty"
                raise InputError(message)
            for part in ("value", "uncertainty"):
                require_number(f"{where}: {part}", pair[part])
            options[name] = tuple(scaled(pair[part], power) for part in ("value", "uncertainty"))
    return LevelTarget(**options)


def run(options: argparse.Namespace) -> int:
    """Run the command ``thud-driver fit``: print the fit, save it, return the exit code."""
    study = read_study(options.study)
    folder = Path(options.output or Path("outputs", study.name))
    descriptor = _claim(folder, study)
    try:
        return _run_there(folder, study, options)
    finally:
        os.close(descriptor)


def _run_there(folder: Path, study: Study, options: argparse.Namespace) -> int:
    """Find a fit, print it and save it in a directory that waits for it; return the exit code."""
    try:
        found = study.run(progress=not options.quiet)
    except ThudError as error:
        message = f"{options.study}: {error}"
        raise type(error)(message) from error
    if not options.quiet:
        tqdm.write(f"{study.name}\n\n{found.table(study.units)}")
    for sentence in found.warnings:
        tqdm.write(f"thud-driver: {options.study}: {sentence}", file=sys.stderr)
    found.save(folder, study.units, figures=not options.no_figures, **study.identity)
    if not options.quiet:
        tqdm.write(f"Results: {folder}")
    return 0 if found.converged else NumericalError.exit_code


def _claim(folder: Path, study: Study) -> int:
    """Make a directory for a fit, or complain about one that cannot take it, before it is found.

    Returns the descriptor that keeps other fits away until it is closed.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with TemporaryFile(dir=folder):
        pass
    path = folder / "fit.json"
    descriptor = lock(folder, path)
    if path.exists():
        try:
            before = json.loads(path.read_bytes())
            mine = all(before[name] == content for name, content in study.identity.items())
        except (ValueError, LookupError, TypeError):
            mine = False
        if not mine:
            os.close(descriptor)
        require_own(path, mine=mine)
    return descriptor


def _table(name: str, content: Mapping[str, Any], where: str = "") -> dict[str, Any]:
    """Return a table of a file."""
    table = content.get(name)
    if not isinstance(table, dict):
        place = where or f"[{name}]"
        message = f"{place} is missing or not a table; allowed: keys and values"
        raise InputError(message)
    return table


def _text(name: str, value: object) -> str:
    """Return a text of a file."""
    if not isinstance(value, str) or not value.strip():
        message = f"{name} = {value!r} is not allowed; allowed: text in quotes"
        raise InputError(message)
    return value
