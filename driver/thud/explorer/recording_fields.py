"""Form fields of a recording: what its file does not state."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import partial
from typing import TYPE_CHECKING, Any

from thud.base.checks import refuse, require_choice, shown
from thud.case.keys import humanize
from thud.recordings.config import Config
from thud.recordings.response import Plate, RecorderFilter

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from thud.base.toml_tables import TomlTable

    Table = dict[str, Any]

# Tables of a configuration; the names of their fields begin with that of the table.
TABLES: dict[str, type[TomlTable]] = {"plate": Plate, "filter": RecorderFilter}
OWNERS = {"plate": "Force plate: ", "filter": "Filter of the recorder: "}
PERCENT = "%"
# Keys with a field, and those whose fields are folded away.
SHOWN = (
    "height", "mass", "calibration", "unit", "channel", "channels", "drops", "source", "plate_f0",
    "plate_Q",
)  # fmt: skip
FOLDED = (
    "height_uncertainty", "mass_uncertainty", "calibration_uncertainty", "plate_f0_uncertainty",
    "plate_share", "plate_flat_limit", "filter_kind", "filter_order", "filter_cutoff",
    "filter_cutoff_uncertainty", "polarity", "sample_rate", "laboratory", "ball", "serial",
)  # fmt: skip


@dataclass(frozen=True)
class Field:
    """Form field of a key of the configuration of a recording.

    Attributes
    ----------
    name : str
        Name of the key, after that of its table and an underscore if it has one.
    label : str
        Name of the field on the page and in messages, with its unit.
    kind : str
        ``"text"``, ``"number"`` or ``"choice"``.
    unit : str
        Unit of a number: that of the key, or ``"%"`` for a fraction.
    hint : str
        What is shown in the empty field, such as an example.
    choices : mapping
        Texts of the allowed values, if they are a choice.
    folded : bool
        Whether the field is among those that are folded away.
    """

    name: str
    label: str
    kind: str = "number"
    unit: str = ""
    hint: str = ""
    choices: Mapping[str, str] = field(default_factory=dict)
    folded: bool = False

    @property
    def quoted(self) -> str:
        """Name of the field in a message."""
        return f"“{self.label}”"

    @property
    def path(self) -> tuple[str, str]:
        """Name of the table, empty if the key is in none, and name of the key."""
        table, _, key = self.name.partition("_")
        return (table, key) if table in TABLES else ("", self.name)

    @property
    def key(self) -> str:
        """Name of the key in messages on a configuration."""
        return ": ".join(filter(None, self.path))

    def value(self, text: str) -> object:
        """Return the value of the key; raise InputError for a text that is not a number."""
        if self.kind != "number":
            return text
        try:
            number = float(text)
        except ValueError as error:
            refuse(f"= {shown(text)} is not a number", "a number", error, name=self.key)
        if self.unit == PERCENT:
            return number / 100
        return int(number) if number.is_integer() else number


def _fields() -> Iterator[Field]:
    """Yield the fields, from the declarations of their keys."""
    for name in (*SHOWN, *FOLDED):
        table, key = Field(name, "").path
        owner = TABLES[table] if table else Config
        declared = next(entry.metadata for entry in fields(owner) if entry.name == key)
        check, hint = declared["check"], declared["hint"]
        label = OWNERS.get(table, "") + declared["title"]
        label = label[:1].upper() + label[1:].replace(" -", " −")
        if not isinstance(check, partial):
            yield Field(name, label, "text", hint=hint, folded=name in FOLDED)
        elif check.func is require_choice:
            choices = {word: humanize(word) for word in check.keywords["allowed"]}
            yield Field(name, label, "choice", choices=choices, folded=name in FOLDED)
        else:
            # Uncertainties without a unit are relative.
            unit = check.keywords.get("unit") or (
                PERCENT if "uncertainty" in key.split("_") else ""
            )
            label = ", ".join(filter(None, (label, unit)))
            yield Field(name, label, unit=unit, folded=name in FOLDED)


FIELDS = tuple(_fields())


def recording_table(stated: Mapping[str, str]) -> Table:
    """Return the table of a configuration from the texts of fields, by name.

    Raise InputError for a text that is not a number.
    """
    result: Table = {}
    for item in FIELDS:
        if item.name in stated:
            table, key = item.path
            (result.setdefault(table, {}) if table else result)[key] = item.value(stated[item.name])
    return result
