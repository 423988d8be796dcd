"""Measured mobilities in tables and universal files."""

from __future__ import annotations

import re
import unicodedata
from pathlib import Path
from typing import TYPE_CHECKING, Literal, cast, get_args

import numpy as np

from thud.base.checks import refuse, require_choice, shown
from thud.base.errors import InputError
from thud.base.units import factor_to, size_of
from thud.floors.mobility import Mobility
from thud.recordings.formats import guarded
from thud.recordings.formats.text import read_table
from thud.recordings.formats.universal import FORCES, SAME_UNIT, DataSet, read_data_sets

if TYPE_CHECKING:
    import os

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

Quantity = Literal["mobility", "accelerance", "receptance"]
# Power of i omega by which a quantity is multiplied to convert it to a mobility.
_POWERS = {"mobility": 0, "accelerance": -1, "receptance": 1}
# Quantity by the data type of a response in universal files: displacement, velocity, acceleration.
_RESPONSES = {8: "receptance", 11: "mobility", 12: "accelerance"}
_FREQUENCY_RESPONSE = 4
_ALLOWED = (
    "a table with the columns frequency, Hz, real and imaginary, or magnitude and phase, degrees; "
    "or a universal file with one frequency response, data set 58"
)
# First words of titles in English, German, Korean and Japanese, in lower case.
_WORDS = {
    "frequency": "frequency f freq frequenz 주파수 周波数",
    "real": "real re realteil 실수부 실수 実部 実数部",
    "imaginary": "imaginary imag im imaginärteil 허수부 허수 虚部 虚数部",
    "magnitude": "magnitude mag abs betrag 크기 진폭 振幅 絶対値",
    "phase": "phase 위상 位相",
}
_TITLES = {word: kind for kind, words in _WORDS.items() for word in words.split()}
# SI units of the values and of the response by quantity, and of further columns by kind.
_UNITS = {"mobility": "m/(Ns)", "accelerance": "m/(Ns2)", "receptance": "m/N"}
_RESPONSE_UNITS = {"mobility": "m/s", "accelerance": "m/s2", "receptance": "m"}
_FURTHER_UNITS = {"frequency": "Hz", "phase": "deg"}


def read_mobility(path: str | os.PathLike[str], quantity: Quantity | None = None) -> Mobility:
    """Read a measured mobility, accelerance or receptance; the line at 0 Hz is left out.

    Parameters
    ----------
    path
        A table with the columns ``frequency``, Hz, ``real`` and ``imaginary`` (or ``magnitude`` and
        ``phase``, degrees), in SI units or those of its titles, or a universal file with a
        frequency response (data set 58).
    quantity
        ``"mobility"``, m/(N s), ``"accelerance"``, 1/kg, or ``"receptance"``, m/N; by default what
        the file states, or ``"mobility"``.

    Raises
    ------
    InputError
        If the file is invalid; the message names it, and the line, column or argument.
    """
    if quantity is not None:
        require_choice("quantity", quantity, get_args(Quantity))
    file = Path(path)
    frequency, values, stated = _read_file(file)
    if quantity and stated and quantity != stated:
        refuse(f"{path}: quantity = {quantity!r}, but the file holds {stated!r}", repr(stated))
    # The value at 0 Hz has no phase.
    frequency, values = frequency[frequency != 0], values[frequency != 0]
    values = values * (2j * np.pi * frequency) ** _POWERS[quantity or stated or "mobility"]
    try:
        return Mobility(frequency, values, file.name)
    except InputError as error:
        raise error.within(path) from error


def _read_file(path: Path) -> tuple[Array, NDArray[np.complex128], Quantity | None]:
    """Return frequencies, values and quantity, which is None if the file does not state it."""
    if path.suffix.lower() in {".uff", ".unv", ".uf"}:
        return _read_universal(path)
    table = read_table(path, _ALLOWED)
    words = [_words(column.name) for column in table.columns]
    kinds = [_TITLES.get(first, "") for first, *_ in words]
    if double := {kind for kind in kinds if kind and kinds.count(kind) > 1}:
        refuse(f"{path}: more than one column of {min(double)}", _ALLOWED)
    used = {kind: c for kind, c in zip(kinds, table.columns, strict=True) if kind}
    units = {size_of(c.unit)[0] for kind, c in used.items() if kind not in _FURTHER_UNITS}
    quantities = {
        name
        for name, unit in _UNITS.items()
        if any(name in title for title in words) or unit in units
    }
    if len(quantities) > 1:
        refuse(f"{path}: titles and units state {' and '.join(sorted(quantities))}", "one quantity")
    quantity = cast("Quantity", min(quantities)) if quantities else None
    unit = _UNITS[quantity or "mobility"]
    columns = {kind: c.to(_FURTHER_UNITS.get(kind, unit), _ALLOWED) for kind, c in used.items()}
    if {"frequency", "real", "imaginary"} <= columns.keys():
        values = columns["real"] + 1j * columns["imaginary"]
    elif {"frequency", "magnitude", "phase"} <= columns.keys():
        values = columns["magnitude"] * np.exp(1j * np.radians(columns["phase"]))
    else:
        titles = ", ".join(column.name for column in table.columns)
        refuse(
            f"{path}: the columns are {shown(titles) if table.has_titles else 'without titles'}",
            _ALLOWED,
        )
    return columns["frequency"], values, quantity


def _words(title: str) -> list[str]:
    """Return the words of a title in lower case."""
    # NFKC replaces full-width brackets by those of ASCII.
    return re.findall(r"[^\W\d_]+", unicodedata.normalize("NFKC", title).lower()) or [""]


def _read_universal(path: Path) -> tuple[Array, NDArray[np.complex128], Quantity | None]:
    """Return the frequency response of a universal file, in SI units."""
    with guarded(path, "universal"):
        responses = read_data_sets(path, _FREQUENCY_RESPONSE)
    if len(responses) != 1:
        refuse(f"{path}: holds {len(responses)} frequency responses", "one")
    (data_set,) = responses
    record = data_set.record
    response = record["ordinate_spec_data_type"]
    force = record["orddenom_spec_data_type"]
    if response not in _RESPONSES or force not in FORCES:
        refuse(
            f"{path}: a response of data type {response} to an excitation of type {force}",
            "displacement, velocity or acceleration (8, 11, 12) in response to a force (13)",
        )
    if data_set.label("abscissa_axis_units_lab").casefold() not in {"", "hz"}:
        unit = data_set.label("abscissa_axis_units_lab")
        refuse(f"{path}: the unit of the frequencies is {shown(unit)}", "Hz")
    # Opposite directions of response and excitation change the sign.
    sign = 1 if record["rsp_dir"] * record["ref_dir"] >= 0 else -1
    quantity: Quantity = _RESPONSES[response]  # type: ignore[assignment]
    values = np.asarray(record["data"], dtype=complex)
    values *= sign * _si_units(data_set, quantity, path)
    return np.asarray(record["x"], dtype=float), values, quantity


def _si_units(data_set: DataSet, quantity: Quantity, path: Path) -> float:
    """Return the unit of a response per force in SI units.

    The labels state it, or data set 164. Raise InputError if they do not agree, or a label is no
    such unit.
    """
    above, below = (
        data_set.label(f"{field}_axis_units_lab").strip("() ") for field in ("ordinate", "orddenom")
    )
    if size_of(above)[0] == _UNITS[quantity]:
        return size_of(above)[1]
    length = factor_to(_RESPONSE_UNITS[quantity], above, f"{path}: response") if above else None
    force = factor_to("N", below, f"{path}: force") if below else None
    # The standard acceleration of gravity is no unit of length.
    pairs = ((length if above != "g" else None, data_set.length), (force, data_set.force))
    for stated, system in pairs:
        if stated and system and abs(stated / system - 1) > SAME_UNIT:
            refuse(
                f"{path}: a unit is {stated:.5g} in SI units by its label, {system:.5g} by data "
                "set 164",
                "one unit: remove the label, or data set 164",
            )
    return (length or data_set.length or 1.0) / (force or data_set.force or 1.0)
