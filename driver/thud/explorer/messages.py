"""Errors and notes in the words of the page: labels and units of fields instead of keys."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from thud.base._schema import KEYS
from thud.base.errors import InputError
from thud.base.units import scaled
from thud.case.keys import humanize
from thud.explorer.form import fields_by_key
from thud.explorer.recording_fields import FIELDS, PERCENT

if TYPE_CHECKING:
    from collections.abc import Mapping

    from thud.base.note import Note

    Field = Mapping[str, Any]

# Fields of recordings by the names of their keys in a configuration.
_RECORDING_FIELDS = {item.key: item for item in FIELDS}
# Magnitude of ends of ranges that are open.
_HUGE = 1e300


def describe_error(error: BaseException) -> dict[str, Any]:
    """Return the message of an error as ``"error"`` and its field.

    The field is ``group.name``, or the name of a field of a recording; None: no field.
    """
    note = getattr(error, "note", None)
    if note is None:
        return {"error": str(error) or InputError.__name__, "field": None}
    item = _RECORDING_FIELDS.get(note.subject)
    field = note.subject if field_of(note) else item.name if item else None
    return {"error": in_words(note) if note.others["name"] else str(error), "field": field}


def field_of(note: Note) -> Field | None:
    """Return the field of the key of the library that a note is about."""
    group, _, name = note.subject.partition(".")
    return fields_by_key().get((group, name))


def in_words(note: Note) -> str:
    """Return the sentence of a note with the label of its field, and a range in its unit."""
    others = note.others
    if "text" not in others:
        return str(note)
    field, item = field_of(note), _RECORDING_FIELDS.get(note.subject)
    name, text = str(others["name"]), others["text"]
    if field:
        name = field["label"]
        if "low_open" in others and not math.isnan(note.low + note.value):
            text = _out_of_range(note, field)
    elif item:
        name = f"“{item.label}”"
        if item.unit == PERCENT and not math.isnan(note.low + note.value):
            value, low, high = (f"{100 * number:g}" for number in (note.value, note.low, note.high))
            text = f"= {value} is not allowed; allowed: {low} to {high}"
    elif name == f"&{note.subject}:":
        name = f"{humanize(note.subject)}:"
    return f"{others.get('place', '')}{name} {text}"


def _shown(field: Field, value: float) -> str:
    """Return a value of a key in the unit of its field."""
    return f"{scaled(float(value), -field['power']):.10g} {field['unit']}".rstrip()


def _out_of_range(note: Note, field: Field) -> str:
    """Return what is said of a value outside its range, in the unit of its field."""
    key = next(key for key in KEYS if (key.group, key.name) == (field["group"], field["name"]))
    ends = []
    for number, limit, is_open, words in (
        (note.low, key.lower, note.others["low_open"], ("at least", "more than")),
        (note.high, key.upper, note.others["high_open"], ("at most", "less than")),
    ):
        # A limit may be the value of another field.
        other = fields_by_key().get((field["group"], str(limit)))
        label = f"{other['label'].lower()}, " if other else ""
        if abs(number) < _HUGE:
            ends.append(f"{words[bool(is_open)]} {label}{_shown(field, number)}")
    whole = ", whole" if key.kind == "whole" or key.whole else ""
    allowed = f"{' and '.join(ends)}{whole}"
    return f"= {_shown(field, note.value)} is not allowed; allowed: {allowed}"
