"""The modulus of a ball from the curve of a press, for the page."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from thud.base.checks import refuse, shown
from thud.base.columns import read_titled
from thud.base.errors import ThudError
from thud.base.units import MULTIPLES, scaled
from thud.case.case import default_model
from thud.explorer.answer import new_case
from thud.explorer.form import fields_by_key
from thud.explorer.models import MODEL_FACTS
from thud.explorer.recording_fields import PRESS_FIELDS
from thud.recordings import force_units
from thud.recordings.header_aliases import plain, split_title
from thud.studies.compression_fit import fit_compression

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    Values = dict[str, dict[str, Any]]
    # Function that returns a unit in SI units, or None for a unit of another kind.
    Scale = Callable[[str], float | None]

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
# Unit of a length at the end of a title, such as "Travel, mm".
_LENGTH = re.compile(rf"(?:(.*?)[\s,;/_]+)?({'|'.join(MULTIPLES['m'])}|µm|μm)")


class Column(NamedTuple):
    """Column of a curve: its number from 1, name, and unit, which is empty if it is not stated."""

    number: int
    name: str
    unit: str

    def __str__(self) -> str:
        """Return number and title for messages."""
        return f"column {self.number}" + (f", {shown(self.name)}" if self.name else "")


def fit_press(
    paths: Sequence[str], names: Sequence[str], units: Mapping[str, str], values: Values
) -> dict[str, Any]:
    """Fit the modulus of a ball to the curve of a press.

    Parameters
    ----------
    paths, names
        Path of a copy of the file, and the name of the original one.
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
    path, name = paths[0], Path(names[0]).name
    case = new_case(values)
    model = case.model or default_model(case.room)
    facts = MODEL_FACTS[model.name]
    if "youngs_modulus" not in facts.fitted:
        titles = [other.title for other in MODEL_FACTS.values() if "youngs_modulus" in other.fitted]
        refuse(f"a press determines no parameter of the model “{facts.title}”", ", ".join(titles))
    try:
        deflection, force, note = _read_curve(path, units)
        with warnings.catch_warnings():
            # They are part of the details.
            warnings.simplefilter("ignore")
            result = fit_compression(deflection, force, case.ball, model)
    except ThudError as error:
        message = f"{name}: {str(error).removeprefix(f'{path}: ')}"
        raise type(error)(message) from error
    field = fields_by_key()["ball", "youngs_modulus"]
    ends = result.values["youngs_modulus"], *result.intervals()["youngs_modulus"]
    best, low, high = (f"{scaled(x, -field['power']):.4g}" for x in ends)
    residual = float(np.sqrt(np.mean(result.residuals**2)))
    trust = "the model explains the curve" if not result.warnings else "see the warnings"
    values.setdefault("ball", {})["youngs_modulus"] = float(f"{ends[0]:.4g}")
    radius, wall = (_shown(case.ball, key) for key in ("outer_radius", "wall_thickness"))
    sentences = [
        *result.warnings,
        note,
        f"a curve determines the modulus only: radius {radius} and wall {wall} are as stated",
        "a press measures slowly: in an impact rubber is stiffer",
        *(text.replace("youngs_modulus", "Young's modulus") for text in result.assumptions),
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
    path: str, units: Mapping[str, str]
) -> tuple[NDArray[np.float64], NDArray[np.float64], str]:
    """Return deflection, m, and force, N, of the loading branch, and a note on what was left out.

    A column is found by its unit, or by its title, or in a file of two columns without titles
    by its order: deflection, force.
    """
    titles, table = read_titled(path, EXPECTED)
    width = table.shape[1]
    if width < 2:  # noqa: PLR2004 - deflection and force
        refuse(f"the file has {width} column of numbers", EXPECTED)
    titles = titles if len(titles) == width else [""] * width
    columns = [Column(i, *_split(title)) for i, title in enumerate(titles, start=1)]
    if width == 2 and not any(titles):  # noqa: PLR2004 - deflection and force
        deflection, force = columns
    else:
        deflection = _find(columns, DEFLECTION_WORDS, _length_scale, "deflection")
        force = _find(columns, FORCE_WORDS, _force_scale, "force")
    scales = (
        _scale(deflection, _length_scale, "press_deflection", units),
        _scale(force, _force_scale, "press_force", units),
    )
    x, y = (
        scale * table[:, column.number - 1]
        for scale, column in zip(scales, (deflection, force), strict=True)
    )
    for column, numbers in ((deflection, x), (force, y)):
        if not np.isfinite(numbers).all():
            refuse(f"{column}: a value is not finite", "finite numbers")
    count = int(np.argmax(x)) + 1
    notes = []
    if count < len(x):
        notes.append(f"the {len(x) - count} points after the largest deflection are left out")
    stride = -(-count // MAX_POINTS)
    if stride > 1:
        notes.append(f"one in {stride} of its {count} points is used")
    used = slice(0, count, stride)
    return x[used], y[used], "; ".join(notes)


def _split(title: str) -> tuple[str, str]:
    """Return name and unit of a title.

    >>> _split("Travel, mm"), _split("Force [kN]"), _split("mm"), _split("Weg")
    (('Travel', 'mm'), ('Force', 'kN'), ('', 'mm'), ('Weg', ''))
    """
    name, unit = split_title(title)
    if not unit and (match := _LENGTH.fullmatch(name)):
        return match[1] or "", match[2]
    if not unit and force_units.find_unit(name):
        return "", name
    return name.rstrip(" ,;"), unit


def _length_scale(unit: str) -> float | None:
    """Return a length in m; None for another unit."""
    power = MULTIPLES["m"].get(unit.replace("µ", "u").replace("μ", "u"))
    return None if power is None else 10.0**power


def _force_scale(unit: str) -> float | None:
    """Return a force in N; None for another unit."""
    base, scale = force_units.UNITS.get(force_units.find_unit(unit), ("", 0.0))
    return scale if base == "N" else None


def _find(columns: Sequence[Column], words: set[str], scale: Scale, kind: str) -> Column:
    """Return the column of a kind, by name and unit; raise InputError for none or several."""
    by_unit = [column for column in columns if scale(column.unit) is not None]
    by_name = [column for column in columns if plain(column.name) in words]
    both = [column for column in by_name if column in by_unit]
    found = both or by_unit or by_name
    if len(found) > 1:
        refuse(f"{' and '.join(map(str, found[:2]))} may both be the {kind}", f"one {kind}")
    if not found:
        refuse(f"no column of {kind} among {', '.join(map(str, columns))}", EXPECTED)
    return found[0]


def _scale(column: Column, scale: Scale, name: str, units: Mapping[str, str]) -> float:
    """Return the unit of a column in SI units; raise InputError if it is not stated or known."""
    field = next(item for item in PRESS_FIELDS if item.name == name)
    allowed = f"{', '.join(field.choices)} in its title, or under {field.quoted}"
    stated = units.get(name, "")
    if not column.unit and not stated:
        refuse(f"{column}: its unit is not stated", allowed)
    factor: float | None = scale(column.unit or stated)
    if factor is None:
        refuse(f"{column}: the unit {shown(column.unit or stated)} is not known here", allowed)
    if column.unit and stated and scale(stated) != factor:
        refuse(f"{column}: {column.unit} by its title, {stated} under {field.quoted}", "one unit")
    return factor
