"""Fits of a model for the page: to a recording, and to the curve of a press."""

from __future__ import annotations

import math
import os
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base.checks import refuse
from thud.base.errors import ThudError
from thud.base.units import size_of
from thud.case.case import Case, new_model
from thud.case.keys import with_values
from thud.explorer.answer import new_case
from thud.explorer.form import field_of, lower, shown
from thud.explorer.models import MODEL_FACTS, facts_of
from thud.explorer.recording import read_copies
from thud.recordings.table import read_table
from thud.studies.compression_fit import fit_compression
from thud.studies.fit import fit
from thud.studies.fitting.force_target import ForceTarget

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from thud.recordings.table import Table
    from thud.studies.compression_fit import CompressionFit
    from thud.studies.fitting.fit_result import Fit

    Values = dict[str, dict[str, Any]]

# Maximum number of points of a curve; of more, every second, third and so on is used.
MAX_POINTS = 2000
EXPECTED = (
    'a column of deflection and one of force, with their units in the titles, such as "Deflection, '
    'mm" and "Force, N"'
)


def fit_recording(
    paths: Sequence[str], table: Mapping[str, object], values: Values
) -> dict[str, Any]:
    """Fit parameters of a model to the first drop of a recording.

    The answer has the values of the case with the fitted ones and what the recording states, a text
    with their intervals, and details of the fit.
    """
    recording = read_copies(paths, table)
    stated = {"height": recording.config.height, "mass": recording.config.mass}
    known = {key: value for key, value in stated.items() if value is not None}
    case = with_values(new_case(values), known)
    parameters = facts_of(case).fitted
    if not parameters:
        able = ", ".join(name for name, facts in MODEL_FACTS.items() if facts.fitted)
        refuse("the model has no parameters that a recording determines", able)
    restitution = recording.restitution
    if not math.isnan(restitution) and not 0 < restitution <= 1:
        number = f"{restitution:.2f}".replace("-", "−")
        refuse(
            f"the restitution of the recording is {number}: no ball can be fitted to it",
            "0 to 1; check mass, drop height, calibration, drops and polarity",
        )
    # Warnings are part of the text.
    with warnings.catch_warnings(action="ignore"):
        result = fit(ForceTarget(recording), parameters, case)
    for name, value in known.items():
        field = field_of(case, name)
        values.setdefault(field["group"], {})[field["name"]] = value
    fitted = f"Fitted to {Path(paths[0]).name}: {_fitted(case, values, result, parameters)}"
    trust = "The verdict is that of the best values, not of their intervals."
    return {
        "values": values,
        "text": f"{fitted}{_misfit_text(result)} {trust}",
        "details": _sentences(result.warnings),
    }


def _misfit_text(result: Fit) -> str:
    """Return the end of a sentence on a fit: the largest residual, if it is more than the noise."""
    unexplained = next((note for note in result.warnings if note.code == "unexplained"), None)
    if unexplained is None:
        return "."
    columns = {name: np.asarray(values) for name, values in result.targets[0].columns().items()}
    residual = np.abs(columns["residual_N"]).max()
    return (
        f", but {unexplained}; the largest residual is {residual:.0f} N, "
        f"{100 * residual / columns['target_N'].max():.2g} % of the peak."
    )


def fit_press(paths: Sequence[str], values: Values) -> dict[str, Any]:
    """Fit the modulus of a ball to the curve of a press; see `fit_recording`.

    Raise InputError if the file is no curve, or the model has no modulus.
    """
    if len(paths) > 1:
        refuse(f"{len(paths)} files are chosen", "the curve of one press")
    case = new_case(values)
    facts = facts_of(case)
    if "youngs_modulus" not in facts.fitted:
        titles = [other.title for other in MODEL_FACTS.values() if "youngs_modulus" in other.fitted]
        refuse(f"a press determines no parameter of the model “{facts.title}”", ", ".join(titles))
    # So messages name the file without the folder of its copy.
    os.chdir(Path(paths[0]).parent)
    name = Path(paths[0]).name
    table = read_table(name, EXPECTED)
    deflection, force = (_column(table, unit) for unit in ("m", "N"))
    # The loading branch, thinned out.
    count = int(np.argmax(deflection)) + 1
    used = slice(0, count, -(-count // MAX_POINTS))
    rest = len(deflection) - count
    left_out = [f"the {rest} points after the largest deflection are left out"] if rest else []
    try:
        # Warnings are part of the details.
        with warnings.catch_warnings(action="ignore"):
            model = new_model(case.model, {})
            result = fit_compression(deflection[used], force[used], case.ball, model)
    except ThudError as error:
        raise error.within(name) from error
    residual = float(np.sqrt(np.mean(result.residuals**2)))
    radius, wall = (
        shown(field_of(case, key), getattr(case.ball, key))
        for key in ("outer_radius", "wall_thickness")
    )
    details = [
        *result.warnings, *left_out,
        f"a curve determines the modulus only: radius {radius} and wall {wall} are as stated",
        "a press measures slowly: in an impact rubber is stiffer", *map(str, result.assumptions),
    ]  # fmt: skip
    return {
        "values": values,
        "name": Path(name).stem,
        "text": f"Fitted to {name}: {_fitted(case, values, result, ['youngs_modulus'])}. The curve "
        f"differs from the model by {residual:.2g} N (RMS), "
        f"{100 * residual / float(force.max()):.2g} % of the largest force: "
        f"{'see the warnings' if result.warnings else 'the model explains the curve'}.",
        "details": _sentences(details),
    }


def _column(table: Table, unit: str) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return the numbers of the only column in a unit of the kind of `unit`, converted to it."""
    columns = [column for column in table.columns if size_of(column.unit)[0] == unit]
    if len(columns) != 1:
        names = ", ".join(f"{column} ({column.unit or 'no unit'})" for column in table.columns)
        refuse(f"{table.name}: {len(columns)} columns in a unit of {unit} among {names}", EXPECTED)
    values = columns[0].to(unit)
    if not np.isfinite(values).all():
        refuse(f"{table.name}: {columns[0]}: a value is not finite", "finite numbers")
    return values


def _fitted(case: Case, values: Values, result: Fit | CompressionFit, names: Sequence[str]) -> str:
    """Take fitted values over into those of a case; return them in words, with intervals (95 %)."""
    intervals, texts = result.intervals(), []
    for name in names:
        field, value = field_of(case, name), result.values[name]
        values.setdefault(field["group"], {})[field["name"]] = value
        best, low, high = (shown(field, x, unit=False) for x in (value, *intervals[name]))
        ends = f"{low} to {high}" if np.isfinite(intervals[name]).all() else "not determined"
        texts.append(f"{lower(field['label'])} {best} ({ends}) {field['unit']}".rstrip())
    return f"{', '.join(texts)} (95 %)"


def _sentences(texts: Iterable[object]) -> str:
    return " ".join(f"{text[:1].upper()}{text[1:]}." for text in map(str, texts))
