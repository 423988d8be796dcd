"""Form fields of a recording: what its file does not state."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import partial
from typing import TYPE_CHECKING

from thud.base.checks import require_choice
from thud.case.keys import humanize
from thud.recordings.config import Config
from thud.recordings.instruments import Plate, RecorderFilter

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from thud.base.toml_tables import TomlTable

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
    path : tuple of str
        Name of the table, if any, and of the key.
    label : str
        Name of the field on the page and in messages, with its unit.
    kind : str
        ``"text"``, ``"number"`` or ``"choice"``.
    unit : str
        Unit of a number: that of the key, or ``"%"`` for a fraction.
    hint : str
        What is shown in the empty field of a text, such as an example.
    choices : mapping or None
        Texts of the allowed values, if they are a choice.
    folded : bool
        Whether the field is among those that are folded away.
    """

    name: str
    path: tuple[str, ...]
    label: str
    kind: str
    unit: str
    hint: str
    choices: Mapping[str, str] | None
    folded: bool

    @property
    def key(self) -> str:
        """Name of the key in messages on a configuration."""
        return ": ".join(self.path)


def _fields() -> Iterator[Field]:
    """Yield the fields, from the declarations of their keys."""
    for name in (*SHOWN, *FOLDED):
        table, _, key = name.partition("_")
        path = (table, key) if table in TABLES else (name,)
        owner = TABLES.get(path[0], Config)
        declared = next(entry.metadata for entry in fields(owner) if entry.name == path[-1])
        check = declared["check"]
        kind, unit, choices = "text", "", None
        if isinstance(check, partial) and check.func is require_choice:
            kind, choices = "choice", {word: humanize(word) for word in check.keywords["allowed"]}
        elif isinstance(check, partial):
            # Uncertainties without a unit are relative.
            relative = PERCENT if "uncertainty" in key.split("_") else ""
            kind, unit = "number", check.keywords.get("unit") or relative
        title = OWNERS.get(path[0], "") + declared["title"]
        title = title[:1].upper() + title[1:].replace(" -", " −")
        label = ", ".join(filter(None, (title, unit)))
        hint = declared["hint"] if kind == "text" else ""
        yield Field(name, path, label, kind, unit, hint, choices, name in FOLDED)


FIELDS = tuple(_fields())
