"""Configuration of a laboratory: a small TOML file next to its recordings."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from datetime import date
from numbers import Integral
from typing import TYPE_CHECKING, Any

from thud.base._schema import LIMITS
from thud.base.checks import (
    refuse_unknown,
    refuse_value,
    require_number,
    require_pair,
    require_whole,
    shown_text,
)
from thud.base.errors import InputError
from thud.base.files import regular_file
from thud.base.note import Note
from thud.base.toml_tables import (
    TomlTable,
    between,
    key,
    one_of,
    read_toml,
    require_table,
    to_line,
    to_text,
)
from thud.level.levels import SOURCES
from thud.recordings.force_units import Calibration, require_unit
from thud.recordings.instruments import Plate, RecorderFilter
from thud.recordings.words import read_date

if TYPE_CHECKING:
    import os
    from collections.abc import Iterable, Mapping

    from thud.base._schema import LimitsSource

# A number of a drop, or the first and the last of several.
NUMBERS = re.compile(r"\s*(\d{1,6})\s*(?:-\s*(\d{1,6})\s*)?")
SUM = "sum"
# How channels of forces are chosen, for messages.
HINT = 'channels = "sum" for load cells under one plate, or channel = the force'
POLARITIES = {"positive": 1.0, "negative": -1.0}
# Maximum number of channels that are added, and of a channel; maximum N per unit.
MAX_CELLS = 64
MAX_CHANNEL = 1_000_000
MAX_FACTOR = 1e30
EXAMPLES = '"sum", "F1+F2+F3+F4" or a list of names or numbers'


def to_date(name: str, value: object) -> str:
    """Return a date as text in ISO 8601; empty if not stated."""
    text = value.isoformat() if isinstance(value, date) else to_line(name, value)
    day = read_date(text) if text else None
    if text and day is None:
        refuse_value(name, value, 'a date, such as "2024-05-03"')
    return day.date().isoformat() if day else ""


def to_channel(name: str, value: object) -> int | str:
    """Return the number or the name of a channel."""
    is_number = isinstance(value, Integral)
    return require_whole(name, value, 1, MAX_CHANNEL) if is_number else to_line(name, value)


def to_channels(name: str, value: object) -> str | tuple[int | str, ...]:
    """Return ``"sum"`` or names and numbers of channels; raise InputError if they are neither.

    >>> to_channels("channels", "F1 + F2 + 3")
    ('F1', 'F2', 3)
    """
    cells: Any = value if isinstance(value, list | tuple) else ()
    if isinstance(value, str):
        if value.strip().casefold() == SUM:
            return SUM
        parts = map(str.strip, value.split("+"))
        cells = [int(part) if part.isdecimal() else part for part in parts]
    are_cells = all(type(cell) in {int, str} and cell for cell in cells)
    if not 1 < len(cells) <= MAX_CELLS or not are_cells or len(set(cells)) < len(cells):
        refuse_value(name, value, f"{EXAMPLES}, 2 to {MAX_CELLS} different")
    return tuple(cells)


def to_calibrations(name: str, value: object) -> Any:  # noqa: ANN401 - one, or a tuple
    """Return a calibration, also that of a list of one, or one for each channel."""
    if not isinstance(value, list | tuple):
        return to_calibration(name, value)
    if len(value) == 1:
        return to_calibration(name, value[0])
    return tuple(to_calibration(f"{name}, entry {i}", v) for i, v in enumerate(value, 1))


def to_calibration(name: str, value: Any) -> Calibration | float:  # noqa: ANN401 - of a user
    """Return a number, or a chain of factors or a `Calibration` as the latter."""
    try:
        value = float(value) if isinstance(value, str) else value
    except ValueError:
        try:
            return Calibration(value)
        except InputError as error:
            raise error.within(name) from error
    if isinstance(value, Calibration):
        return value
    return require_number(name, value, -MAX_FACTOR, MAX_FACTOR)


def parse_numbers(text: str, name: str) -> list[range]:
    """Return the ranges of numbers in a text such as ``"1-5, 8"``; raise InputError if none."""
    matches = [NUMBERS.fullmatch(part) for part in text.split(",")]
    ranges = [range(int(m[1]), int(m[2] or m[1]) + 1) if m else range(0) for m in matches]
    if not all(ranges) or any(part.start < 1 for part in ranges):
        refuse_value(name, text, 'numbers of drops from 1, such as "1-5, 8"')
    return ranges


def to_numbers(name: str, value: object) -> str:
    """Return the text of numbers of drops."""
    text = to_line(name, value)
    parse_numbers(text, name)
    return text


def to_reasons(name: str, value: object) -> dict[str, str]:
    """Return reasons by numbers of drops."""
    table = require_table(name, value)
    return {
        to_numbers(name, str(drops)): to_text(f"{name}: reason of {drops}", reason)
        for drops, reason in table.items()
    }


def to_limits(name: str, value: object) -> dict[str, tuple[float, float]]:
    """Return minimum and maximum by criterion."""
    table = require_table(name, value)
    refuse_unknown(name, table, [criterion for criterion, *_ in LIMITS[SOURCES[0]]])
    limits = {}
    for criterion, span in table.items():
        label = f"{name}: {criterion}"
        low, high = require_pair(label, span, "[minimum, maximum]", -1e6, 1e6)
        if not low < high:
            refuse_value(label, span, "minimum < maximum")
        limits[criterion] = (low, high)
    return limits


@dataclass(frozen=True)
class Instrument(TomlTable):
    """An instrument of the measurement and its calibration certificate."""

    title = "instruments: "
    name: str = key(to_line, "name", "")
    serial: str = key(to_line, "serial number", "")
    certificate: str = key(to_line, "number of the certificate", "")
    calibrated: str = key(to_date, "date of the certificate", "")
    due: str = key(to_date, "date of the next calibration", "")


def to_instruments(name: str, value: object) -> tuple[Instrument, ...]:
    """Return instruments from a list of names or tables, or from one of them."""
    return tuple(
        Instrument(entry) if isinstance(entry, str) else Instrument.read(name, entry)
        for entry in (value if isinstance(value, list | tuple) else [value])
    )


def to_lines(name: str, value: object) -> tuple[str, ...]:
    """Return the lines of a list, or a single line."""
    lines = value if isinstance(value, list | tuple) else [value]
    return tuple(to_line(name, line) for line in lines)


@dataclass(frozen=True)
class ReportConfig(TomlTable):
    """What a report of a laboratory states besides its results (ISO/IEC 17025, 7.8)."""

    title = "report: "
    number: str = key(to_line, "number of the report, on each page", "")
    address: tuple[str, ...] = key(to_lines, "address of the laboratory, a line each", ())
    client: tuple[str, ...] = key(to_lines, "name and address of the client", ())
    item: str = key(to_line, "description of the item", "")
    state: str = key(to_line, "state of the item at receipt", "")
    received: str = key(to_date, "date of receipt of the item", "")
    issued: str = key(to_date, "date of issue of the report", "")
    place: str = key(to_line, "place of the measurement", "")
    procedure: str = key(to_line, "procedure of the measurement", "")
    deviations: str = key(to_line, "deviations from the procedure", "")
    traceability: str = key(to_line, "metrological traceability of the results", "")
    # Below 1 % it is likely to be a fraction.
    humidity: float | None = key(between(1.0, 100.0, "%"), "relative humidity of the air")
    pressure: float | None = key(between(5e4, 1.2e5, "Pa"), "static pressure of the air")
    accreditation: str = key(to_line, "text on the accreditation", "")
    accreditation_mark: str = key(to_line, "file of the accreditation mark: SVG, PNG or JPEG", "")
    authorized_by: str = key(to_line, "person who authorizes the report", "")


@dataclass(frozen=True)
class Properties(TomlTable):
    """Properties of the ball that are stated, not assessed (ISO 10140-5, annex F)."""

    title = "properties: "
    diameter: float | None = key(between(0.01, 10.0, "m"), "outer diameter")
    wall_thickness: float | None = key(between(1e-4, 1.0, "m"), "wall thickness")
    hardness: str = key(to_line, "hardness with its scale", "")
    surface: str = key(to_line, "condition of the surface", "")
    temperature: float | None = key(
        between(-273.15, 200.0, "degC"), "temperature of the ball, if not that of the air"
    )


@dataclass(frozen=True)
class Config(TomlTable):
    """What a laboratory states about its ball, instruments and files; None if unknown."""

    laboratory: str = key(to_line, "name of the laboratory", "")
    ball: str = key(to_line, "name of the ball", "")
    serial: str = key(to_line, "serial number of the ball", "")
    date: str = key(to_date, "date of the measurement", "", "by default that of the files")
    source: LimitsSource = key(one_of(SOURCES), "source whose limits apply", SOURCES[0])
    temperature: float | None = key(between(-273.15, 200.0, "degC"), "temperature of ball and air")
    instruments: tuple[Instrument, ...] = key(
        to_instruments, "names of instruments, or tables with their certificates", ()
    )
    channel: int | str | None = key(to_channel, "channel of the force", hint="by number or name")
    channels: str | tuple[int | str, ...] | None = key(
        to_channels, "load cells whose forces are added", hint="sum for all channels of force"
    )
    unit: str | None = key(
        require_unit, "unit of the recorded values", hint="if the file does not state it"
    )
    calibration: Calibration | float | tuple[Calibration | float, ...] | None = key(
        to_calibrations,
        "calibration",
        hint='factors such as 250, "250 N/V" or "4.1 pC/N, 10 mV/pC"',
    )
    calibration_uncertainty: float | None = key(
        between(0.0, 0.5), "relative standard uncertainty of the calibration", hint="such as 0.005"
    )
    polarity: str | None = key(one_of(POLARITIES), "sign of a compression in the file")
    sample_rate: float | None = key(
        between(1.0, 1e9, "Hz"), "sample rate", hint="if the file does not state it"
    )
    mass: float | None = key(between(0.01, 1000.0, "kg"), "mass", hint="of the source")
    # Above 10 m it is likely to be stated in cm.
    height: float | None = key(between(0.001, 10.0, "m"), "drop height")
    mass_uncertainty: float | None = key(
        between(0.0, 100.0, "kg"), "standard uncertainty of the mass"
    )
    height_uncertainty: float | None = key(
        between(0.0, 1.0, "m"), "standard uncertainty of the height"
    )
    plate: Plate | None = key(Plate.read, "the force plate")
    filter: RecorderFilter | None = key(RecorderFilter.read, "the low-pass filter of the recorder")
    drops: str | None = key(
        to_numbers, "drops to be measured", hint='such as "1-5, 8"; they count over all files'
    )
    leave_out: Mapping[str, str] = key(
        to_reasons, 'drops to be left out, with the reason: {"3": "touched"}', {}
    )
    begin: float | None = key(between(0.0, 1e9, "s"), "begin of the searched section of each file")
    end: float | None = key(between(0.0, 1e9, "s"), "end of the searched section of each file")
    limits: Mapping[str, tuple[float, float]] = key(
        to_limits, "minimum and maximum by criterion, which replace those of the standards", {}
    )
    report: ReportConfig = key(
        ReportConfig.read, "what the report states besides the results", ReportConfig()
    )
    properties: Properties = key(
        Properties.read, "properties of the ball that are stated, not assessed", Properties()
    )

    def updated(self, **stated: Any) -> Config:  # noqa: ANN401 - a value of any key
        """Return the configuration with other values, of which those that are None are ignored.

        Either choice of channels replaces both. Drops to be left out are added.
        """
        changes = {name: value for name, value in stated.items() if value is not None}
        if changes.keys() & {"channel", "channels"}:
            changes = {"channel": None, "channels": None, **changes}
        if "leave_out" in changes:
            changes["leave_out"] = {**self.leave_out, **changes["leave_out"]}
        return replace(self, **changes)

    @property
    def corrected(self) -> tuple[Plate | None, RecorderFilter | None]:
        """Plate and filter that are corrected: resonance or cutoff are stated; else None."""
        plate, recorder = self.plate, self.filter
        return (
            plate if plate and not math.isnan(plate.f0) else None,
            recorder if recorder and recorder.kind != "none" else None,
        )

    def check_dates(self, file_dates: Iterable[str]) -> list[Note]:
        """Return a warning for each calibration that was due before the measurement.

        `file_dates` are those of the files, which count if no date is stated.
        """
        due = [entry for entry in self.instruments if entry.due]
        read = [read_date(text) for text in ([self.date] if self.date else file_dates)]
        last = max((day.date().isoformat() for day in read if day), default="")
        if due and not last:
            return [Note("date_unknown")]
        return [
            Note("calibration_overdue", entry.name or "an instrument", others={"due": entry.due})
            for entry in due
            if entry.due < last
        ]


def config_from(table: Mapping[str, object], file: str = "") -> Config:
    """Return the configuration of a table as in a file, whose name is in messages.

    Raise InputError if a key is unknown, or its value of the wrong type or out of range.
    """
    refuse_unknown(file or "configuration", table, Config.__dataclass_fields__)
    try:
        return Config(**table)  # type: ignore[arg-type]
    except InputError as error:
        raise (error.within(file) if file else error) from error


def read_config(path: str | os.PathLike[str]) -> Config:
    """Read a configuration.

    Raise InputError if a key is unknown, or its value of the wrong type or out of range.
    """
    file = regular_file(path)
    config = config_from(read_toml(file)[0], shown_text(file))
    mark = config.report.accreditation_mark
    if not mark:
        return config
    report = replace(config.report, accreditation_mark=str(file.parent / mark))
    return replace(config, report=report)
