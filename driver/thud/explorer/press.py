"""The modulus of a ball from the curve of a press, for the page."""

from __future__ import annotations

import os
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base.checks import refuse, shown_text
from thud.base.errors import ThudError
from thud.base.units import scaled, size_of
from thud.case.case import new_model
from thud.explorer.answer import new_case
from thud.explorer.form import fields_by_key
from thud.explorer.models import MODEL_FACTS
from thud.explorer.recording_fields import PRESS_FIELDS
from thud.recordings.table import read_table
from thud.recordings.words import plain
from thud.studies.compression_fit import fit_compression

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from thud.recordings.table import Column

    Values = dict[str, dict[str, Any]]

# Maximum number of points of a fit; of more, every second, third and so on is used.
MAX_POINTS = 2000
DEFLECTION_WORDS = {
    "deflection", "displacement", "compression", "approach", "travel", "stroke", "extension",
    "crosshead", "weg", "standardweg", "verformung", "traversenweg",
}  # fmt: skip
FORCE_WORDS = {"force", "load", "kraft", "standardkraft", "last"}
EXPECTED = (
    'a column of deflection and one of force, with their units in the titles, such as "Deflection, '
    'mm" and "Force, N"'
)


def fit_press(paths: Sequence[str], units: Mapping[str, str], values: Values) -> dict[str, Any]:
    """Fit the modulus of a ball to the curve of a press.

    Parameters
    ----------
    paths
        Path of a copy of the file, with its name.
    units
        Units of columns whose titles state none, by name of `PRESS_FIELDS`.
    values
        Values of the case of the ball.

    Returns
    -------
    dict
        Values of the case with the modulus, a name for it, a text with modulus, interval and
        residual, and details of the fit.

    Raises
    ------
    InputError
        If the file is not a curve, or the model has no modulus.
    """
    if len(paths) > 1:
        refuse(f"{len(paths)} files are chosen", "the curve of one press")
    name = Path(paths[0]).name
    case = new_case(values)
    model = new_model(case.model, {})
    facts = MODEL_FACTS[model.name]
    if "youngs_modulus" not in facts.fitted:
        titles = [other.title for other in MODEL_FACTS.values() if "youngs_modulus" in other.fitted]
        refuse(f"a press determines no parameter of the model “{facts.title}”", ", ".join(titles))
    # So messages name the file without the folder of its copy.
    os.chdir(Path(paths[0]).parent)
    deflection, force, note = _read_curve(name, units)
    try:
        with warnings.catch_warnings():
            # They are part of the details.
            warnings.simplefilter("ignore")
            result = fit_compression(deflection, force, case.ball, model)
    except ThudError as error:
        raise error.within(name) from error
    field = fields_by_key()["ball", "youngs_modulus"]
    ends = result.values["youngs_modulus"], *result.intervals()["youngs_modulus"]
    best, low, high = (f"{scaled(x, -field['power']):.4g}" for x in ends)
    residual = float(np.sqrt(np.mean(result.residuals**2)))
    trust = "the model explains the curve" if not result.warnings else "see the warnings"
    values.setdefault("ball", {})["youngs_modulus"] = float(f"{ends[0]:.4g}")
    radius, wall = (_shown(case.ball, key) for key in ("outer_radius", "wall_thickness"))
    sentences = [
        *map(str, result.warnings),
        note,
        f"a curve determines the modulus only: radius {radius} and wall {wall} are as stated",
        "a press measures slowly: in an impact rubber is stiffer",
        *map(str, result.assumptions),
    ]
    return {
        "values": values,
        "name": Path(name).stem,
        "text": f"Fitted to {name}: Young's modulus {best} ({low} to {high}) {field['unit']} "
        f"(95 %). The curve differs from the model by {residual:.2g} N (RMS), "
        f"{100 * residual / float(force.max()):.2g} % of the largest force: {trust}.",
        "details": " ".join(f"{text[:1].upper()}{text[1:]}." for text in sentences if text),
    }


def _shown(ball: object, name: str) -> str:
    """Return a length of a ball in the unit of its field."""
    field = fields_by_key()["ball", name]
    return f"{scaled(getattr(ball, name), -field['power']):.4g} {field['unit']}"


def _read_curve(
    name: str, units: Mapping[str, str]
) -> tuple[NDArray[np.float64], NDArray[np.float64], str]:
    """Return deflection, m, and force, N, of the loading branch, and a note on what was left out.

    A column is found by its unit, or by its title, or in a file of two columns without titles
    by its order: deflection, force.
    """
    table = read_table(name, EXPECTED)
    columns = table.columns
    if len(columns) < 2:  # noqa: PLR2004 - deflection and force
        refuse(f"{name}: has {len(columns)} column of numbers", EXPECTED)
    if len(columns) == 2 and not table.has_titles:  # noqa: PLR2004 - deflection and force
        deflection, force = columns
    else:
        deflection = _find(columns, DEFLECTION_WORDS, "m", "deflection")
        force = _find(columns, FORCE_WORDS, "N", "force")
    x = deflection.values * _factor(deflection, "m", "press_deflection", units)
    y = force.values * _factor(force, "N", "press_force", units)
    for column, numbers in ((deflection, x), (force, y)):
        if not np.isfinite(numbers).all():
            refuse(f"{name}: {column}: a value is not finite", "finite numbers")
    count = int(np.argmax(x)) + 1
    notes = []
    if count < len(x):
        notes.append(f"the {len(x) - count} points after the largest deflection are left out")
    stride = -(-count // MAX_POINTS)
    if stride > 1:
        notes.append(f"one in {stride} of its {count} points is used")
    used = slice(0, count, stride)
    return x[used], y[used], "; ".join(notes)


def _find(columns: Sequence[Column], words: set[str], unit: str, kind: str) -> Column:
    """Return the column of a kind, by name and unit; raise InputError for none or several."""
    by_unit = [c for c in columns if size_of(c.unit)[0] == unit]
    by_name = [column for column in columns if plain(column.name) in words]
    both = [column for column in by_name if column in by_unit]
    found = both or by_unit or by_name
    if len(found) > 1:
        both_names = " and ".join(map(str, found[:2]))
        refuse(f"{columns[0].table}: {both_names} may both be the {kind}", f"one {kind}")
    if not found:
        listed = ", ".join(map(str, columns))
        refuse(f"{columns[0].table}: no column of {kind} among {listed}", EXPECTED)
    return found[0]


def _factor(column: Column, unit: str, name: str, units: Mapping[str, str]) -> float:
    """Return the unit of a column in SI units; raise InputError if it is not stated or known."""
    field = next(item for item in PRESS_FIELDS if item.name == name)
    allowed = f"{', '.join(field.choices)} in its title, or under {field.quoted}"
    stated = units.get(name, "")
    base, factor = size_of(column.unit or stated)
    problem = ""
    if not column.unit and not stated:
        problem = "its unit is not stated"
    elif base != unit:
        fault = "does not fit" if base else "is not known"
        problem = f"the unit {shown_text(column.unit)!r} {fault}"
    elif column.unit and stated and size_of(stated)[1] != factor:
        problem = f"{column.unit} by its title, {stated} under {field.quoted}"
        allowed = "one unit"
    if problem:
        refuse(f"{column.table}: {column}: {problem}", allowed, subject=field.key)
    return factor
