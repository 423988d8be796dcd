"""Form fields of a recording: what its file does not state."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from thud.base.checks import refuse, shown

if TYPE_CHECKING:
    from collections.abc import Mapping

    Table = dict[str, Any]

# Tables of a configuration; the names of their fields begin with that of the table.
TABLES = ("plate", "filter")
PERCENT = "%"


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
        Rest of the label, such as an example.
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


FILTERS = {"none": "flat", "bessel": "Bessel", "butterworth": "Butterworth"}
SOURCES = {"rubber_ball": "rubber ball", "tyre": "tyre"}
POLARITIES = {"positive": "positive", "negative": "negative"}
FIELDS = (
    Field("height", "Drop height, m"),
    Field("mass", "Mass, kg"),
    Field("calibration", "Calibration", "text", hint=", such as 250 N/V"),
    Field("unit", "Unit of the values", "text", hint=", such as kN"),
    Field("channel", "Channel", "text", hint=", by number or name"),
    Field("channels", "Load cells to be added", "text", hint=", such as F1+F2+F3+F4, or sum"),
    Field("drops", "Drops", "text", hint=", such as 1-5 (all)"),
    Field("height_uncertainty", "Uncertainty of the drop height, m", folded=True),
    Field("mass_uncertainty", "Uncertainty of the mass, kg", folded=True),
    Field(
        "calibration_uncertainty", "Uncertainty of the calibration, %",
        unit=PERCENT, folded=True,
    ),
    Field("source", "Source", "choice", choices=SOURCES),
    Field("plate_f0", "First resonance of the force plate, Hz"),
    Field("plate_Q", "Quality factor of the force plate"),
    Field("plate_f0_uncertainty", "Uncertainty of this resonance, %", unit=PERCENT, folded=True),
    Field("plate_share", "Share of this resonance in the static response", folded=True),
    Field("plate_flat_limit", "Force plate flat within 2 % up to, Hz", folded=True),
    Field("filter_kind", "Filter of the recorder", "choice", choices=FILTERS, folded=True),
    Field("filter_order", "Order of the filter", folded=True),
    Field("filter_cutoff", "Cutoff of the filter (−3 dB), Hz", folded=True),
    Field("filter_cutoff_uncertainty", "Uncertainty of the cutoff, %", unit=PERCENT, folded=True),
    Field("polarity", "Sign of a compression", "choice", choices=POLARITIES, folded=True),
    Field("sample_rate", "Sample rate, Hz", folded=True),
    Field("laboratory", "Laboratory", "text", folded=True),
    Field("ball", "Name of the ball", "text", folded=True),
    Field("serial", "Serial number", "text", folded=True),
)  # fmt: skip

# Units of the columns of the curve of a press, if their titles state none.
PRESS_FIELDS = (
    Field(
        "press_deflection", "Unit of the deflection", "choice",
        choices={unit: unit for unit in ("mm", "cm", "m", "um")},
    ),
    Field(
        "press_force", "Unit of the force", "choice",
        choices={unit: unit for unit in ("N", "kN", "daN", "kgf", "lbf")},
    ),
)  # fmt: skip


def recording_table(stated: Mapping[str, str]) -> Table:
    """Return the table of a configuration from the texts of fields, by name.

    Raise InputError for a text that is not a number, or if a table lacks a choice.
    """
    result: Table = {}
    for item in FIELDS:
        if item.name in stated:
            table, key = item.path
            (result.setdefault(table, {}) if table else result)[key] = item.value(stated[item.name])
    for item in FIELDS:
        table, key = item.path
        if item.choices and table in result and key not in result[table]:
            allowed = ", ".join(item.choices.values())
            refuse("is not chosen", allowed, name=item.key)
    return result
