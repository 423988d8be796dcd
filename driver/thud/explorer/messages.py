"""Messages of the library in the words of the page: labels and units of fields instead of keys."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from thud.base.errors import InputError
from thud.base.units import scaled
from thud.case.keys import humanize
from thud.explorer.form import fields_by_key
from thud.explorer.recording_fields import recording_field_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    Field = Mapping[str, Any]

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_KEY = re.compile(r"&(\w+):? (\w+)\b")
# Range of a key, such as "0 < wall_thickness < outer_radius = 0.089 m".
_RANGE = re.compile(r"allowed: (.+?) (<=?) (\w+) (<=?) (.+)$")


def describe_error(error: BaseException) -> dict[str, Any]:
    """Return the message of an error as ``"error"`` and its field.

    The field is ``group.name``, or the name of a field of a recording; None: no field.
    """
    message = str(error) or InputError.__name__
    return {"error": in_words(message), "field": field_of(message) or recording_field_of(message)}


def field_of(message: str) -> str | None:
    """Return the field that a message of the library begins with, as ``group.name``."""
    match = _KEY.match(message)
    field = fields_by_key().get((match[1], match[2])) if match else None
    return f"{field['group']}.{field['name']}" if field else None


def in_words(message: str) -> str:
    """Return a message with labels and units of fields instead of keys and SI units.

    >>> in_words("&ball: wall_thickness = 0.2 is not allowed; "
    ...          "allowed: 0 < wall_thickness < outer_radius = 0.089 m")
    'Wall thickness = 200 mm is not allowed; allowed: more than 0 mm and less than outer radius, \
89 mm'
    """
    match = _KEY.match(message)
    first = fields_by_key().get((match[1], match[2])) if match else None
    if match and first:
        message = _with_range(message, first)
        message = _in_unit(message[match.end() :], first)
        message = f"{first['label']}{_with_labels(message, match[1])}"
    elif group := re.match(r"&(\w+): ", message):
        message = f"{humanize(group[1])}: {_with_labels(message[group.end() :], group[1])}"
    return _KEY.sub(_label, message)


def _label(match: re.Match[str]) -> str:
    """Return the label of a key in a sentence."""
    field = fields_by_key().get((match[1], match[2]))
    return lower(field["label"]) if field else match[0]


def lower(label: str) -> str:
    """Return a label for the middle of a sentence."""
    is_name = label.startswith(("Young", "Poisson"))
    return label if is_name else label[:1].lower() + label[1:]


def _with_labels(text: str, group: str) -> str:
    """Return a text with labels in place of the keys of a group that are more than a word."""
    for (other, name), field in fields_by_key().items():
        if other == group and "_" in name:
            text = re.sub(rf"(?<!\w){name}(?!\w)", lower(field["label"]), text)
    return text


def _in_unit(text: str, field: Field) -> str:
    """Return the text after a key with its value, in the unit of its field."""
    unit, power = field["unit"], field["power"]
    suffix = f" {unit}" if unit else ""

    def convert(match: re.Match[str]) -> str:
        return f" = {_scaled(match[1], power)}{suffix}"

    name = re.escape(field["si_unit"])
    # A value with a prefix, such as 2.08 MPa, is as readable as it is.
    si = rf"(?: {name}(?!\w))?(?! [kMG]{name}(?!\w))" if name else ""
    return re.sub(rf"^ = ({_NUMBER}){si}(?![\w.])", convert, text)


def _with_range(message: str, field: Field) -> str:
    """Return a message with its allowed range in words."""
    match = _RANGE.search(message)
    if not match or match[3] != field["name"]:
        return message
    lower = _bound(match[1], field, ("more than", "at least")[match[2] == "<="])
    upper = _bound(match[5], field, ("less than", "at most")[match[4] == "<="])
    ends = f"{lower} and {upper}"
    if match[2] == match[4] == "<=":
        ends = f"{lower.removeprefix('at least ')} to {upper.removeprefix('at most ')}"
        if field["unit"] and "," not in ends:
            ends = ends.replace(f" {field['unit']} to", " to")
    whole = ", whole" if message.endswith(", whole") and not ends.endswith(", whole") else ""
    return f"{message[: match.start()]}allowed: {ends}{whole}"


def _bound(text: str, field: Field, words: str) -> str:
    """Return an end of a range in the unit of the field, after words such as "less than"."""
    text = text.removesuffix(", whole").removesuffix(f" {field['si_unit']}")
    name, _, number = text.rpartition(" = ")
    if not re.fullmatch(_NUMBER, number):
        return f"{words} {text}"
    other = fields_by_key().get((field["group"], name))
    label = f"{lower(other['label']) if other else name}, " if name else ""
    unit = f" {field['unit']}" if field["unit"] else ""
    return f"{words} {label}{_scaled(number, field['power'])}{unit}"


def _scaled(number: str, power: int) -> str:
    """Return a number in the unit of a field."""
    return f"{scaled(float(number), -power):.10g}"
