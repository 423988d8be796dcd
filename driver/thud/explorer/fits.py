"""Fits of a model for the page: to a recording, and to the curve of a press."""

from __future__ import annotations

import math
import os
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base.checks import refuse, shown_text
from thud.base.errors import ThudError
from thud.base.units import size_of
from thud.case.keys import find_key, with_values
from thud.explorer.answer import new_case
from thud.explorer.models import MODEL_FACTS, facts_of
from thud.explorer.recording import read_copies
from thud.explorer.series import to_json
from thud.recordings.formats.text import read_table
from thud.studies.fit import fit
from thud.studies.fitting.compression_target import CompressionTarget
from thud.studies.fitting.force_target import ForceTarget

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from thud.case.case import Case
    from thud.recordings.formats.text import Table
    from thud.studies.fitting.fit_result import Fit

    Values = dict[str, dict[str, Any]]
    Answer = dict[str, Any]

# Warnings that the model does not explain the data.
NOT_NOISE = {"unexplained", "residuals_colored"}
# Maximum number of points of a curve; of more, every second, third and so on is used.
MAX_POINTS = 2000
EXPECTED = (
    'a column of deflection and one of force, with their units in the titles, such as "Deflection, '
    'mm" and "Force, N"'
)


def fit_recording(paths: Sequence[str], table: Mapping[str, object], values: Values) -> Answer:
    """Fit parameters of a model to the first drop of a recording; see `_answer`."""
    recording = read_copies(paths, table)
    stated = {"height": recording.config.height, "mass": recording.config.mass}
    known = {key: value for key, value in stated.items() if value is not None}
    case = with_values(new_case(values), known)
    parameters = facts_of(case).fitted
    if not parameters:
        able = ", ".join(facts.title for facts in MODEL_FACTS.values() if facts.fitted)
        refuse("the model has no parameters that a recording determines", able)
    restitution = recording.restitution
    if not math.isnan(restitution) and not 0 < restitution <= 1:
        number = f"{restitution:.2f}".replace("-", "−")
        refuse(
            f"the restitution of the recording is {number}: no ball can be fitted to it",
            "0 to 1; check mass, drop height, calibration, drops and polarity",
        )
    # Warnings are part of the answer.
    with warnings.catch_warnings(action="ignore"):
        result = fit(ForceTarget(recording), parameters, case)
    best = known | {name: result.values[name] for name in parameters}
    name = Path(paths[0]).name
    return {"file": name} | _answer(values, case, best, result, result.targets[0].columns())


def _answer(
    values: Values, case: Case, best: Mapping[str, Any], result: Fit, columns: Mapping[str, Any]
) -> Answer:
    """Return the values of a case with those of a fit, and what is known of its quality.

    These are the intervals (95 %) of the fitted parameters, None where they are not
    determined, the largest residual, N and as a fraction of the largest force, whether the
    residuals are noise, and warnings and assumptions.
    """
    keys = {name: find_key(name, case)[0] for name in best}
    for name, key in keys.items():
        values.setdefault(key.group, {})[key.name] = best[name]
    residual = float(np.abs(columns["residual_N"]).max())
    measured = columns["target_N" if "target_N" in columns else "force_N"]
    return {
        "values": values,
        "intervals": [
            [f"{keys[name].group}.{name}", *to_json(ends)]
            for name, ends in result.intervals().items()
            if name in keys
        ],
        "residual": [residual, residual / float(np.max(measured))],
        "is_explained": NOT_NOISE.isdisjoint(note.code for note in result.warnings),
        "notes": [str(note) for note in (*result.warnings, *result.assumptions)],
    }


def fit_press(paths: Sequence[str], values: Values) -> Answer:
    """Fit the modulus of a ball to the loading branch of the curve of a press; see `_answer`.

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
    count = int(np.argmax(deflection)) + 1
    used = slice(0, count, -(-count // MAX_POINTS))
    try:
        # Warnings are part of the answer.
        with warnings.catch_warnings(action="ignore"):
            target = CompressionTarget(deflection[used], force[used])
            target.compare()  # Refuses what is no curve, where it has no other name.
            result = fit(target, ["youngs_modulus"], case)
    except ThudError as error:
        raise error.within(name) from error
    best = {"youngs_modulus": result.values["youngs_modulus"]}
    return {"file": name} | _answer(values, case, best, result, result.columns())


def _column(table: Table, unit: str) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return the numbers of the only column in a unit of the kind of `unit`, converted to it."""
    columns = [column for column in table.columns if size_of(column.unit)[0] == unit]
    if len(columns) != 1:
        names = ", ".join(
            f"{shown_text(column.name) or f'column {column.number}'} ({column.unit or 'no unit'})"
            for column in table.columns
        )
        refuse(f"{table.name}: {len(columns)} columns in a unit of {unit} among {names}", EXPECTED)
    values = columns[0].to(unit)
    if not np.isfinite(values).all():
        refuse(f"{columns[0].label}: a value is not finite", "finite numbers")
    return values
