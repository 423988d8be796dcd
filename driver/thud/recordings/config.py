"""Configuration of a laboratory: a small TOML file next to its recordings."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from thud.base.checks import refuse_unknown
from thud.base.errors import InputError
from thud.base.files import read_toml
from thud.base.note import Note
from thud.level.levels import SOURCES
from thud.recordings.channel import regular_file, shown_path
from thud.recordings.config_values import (
    Choice,
    Listed,
    Number,
    Table,
    key,
    require_channels,
    to_calibrations,
    to_channel,
    to_date,
    to_day,
    to_limits,
    to_line,
    to_numbers,
    to_reasons,
)
from thud.recordings.force_units import Calibration, require_unit
from thud.recordings.instruments import Plate, RecorderFilter, check_plate
from thud.recordings.response import Chain
from thud.recordings.signs import POLARITIES
from thud.recordings.words import read_date

if TYPE_CHECKING:
    import os
    from collections.abc import Iterable

    from thud.base._schema import LimitsSource
    from thud.recordings.instruments import PlateCheck


@dataclass(frozen=True)
class Instrument(Table):
    """An instrument of the measurement and its calibration certificate."""

    title = "instruments: "
    name: str = key(to_line, "name", "")
    serial: str = key(to_line, "serial number", "")
    certificate: str = key(to_line, "number of the certificate", "")
    calibrated: str = key(to_date, "date of the certificate", "")
    due: str = key(to_date, "date of the next calibration", "")


def _instrument(value: object, key: str) -> str | Instrument:
    is_table = isinstance(value, Mapping | Instrument)
    return Instrument.read(value, key) if is_table else to_line(value, key)


@dataclass(frozen=True)
class ReportConfig(Table):
    """What a report of a laboratory states besides its results (ISO/IEC 17025, 7.8)."""

    title = "report: "
    number: str = key(to_line, "number of the report, on each page", "")
    address: tuple[str, ...] = key(Listed(to_line), "address of the laboratory, a line each", ())
    client: tuple[str, ...] = key(Listed(to_line), "name and address of the client", ())
    item: str = key(to_line, "description of the item", "")
    state: str = key(to_line, "state of the item at receipt", "")
    received: str = key(to_date, "date of receipt of the item", "")
    issued: str = key(to_date, "date of issue of the report", "")
    place: str = key(to_line, "place of the measurement", "")
    procedure: str = key(to_line, "procedure of the measurement", "")
    deviations: str = key(to_line, "deviations from the procedure", "")
    traceability: str = key(to_line, "metrological traceability of the results", "")
    # Below 1 % it is likely to be a fraction.
    humidity: float | None = key(Number(1.0, 100.0, "%"), "relative humidity of the air")
    pressure: float | None = key(Number(5e4, 1.2e5, "Pa"), "static pressure of the air")
    accreditation: str = key(to_line, "text on the accreditation", "")
    accreditation_mark: str = key(to_line, "file of the accreditation mark: SVG, PNG or JPEG", "")
    authorized_by: str = key(to_line, "person who authorizes the report", "")


@dataclass(frozen=True)
class Properties(Table):
    """Properties of the ball that are stated, not assessed (ISO 10140-5, annex F)."""

    title = "properties: "
    diameter: float | None = key(Number(0.01, 10.0, "m"), "outer diameter")
    wall_thickness: float | None = key(Number(1e-4, 1.0, "m"), "wall thickness")
    hardness: str = key(to_line, "hardness with its scale", "")
    surface: str = key(to_line, "condition of the surface", "")
    temperature: float | None = key(
        Number(-273.15, 200.0, "degC"), "temperature of the ball, if not that of the air"
    )


@dataclass(frozen=True)
class Config(Table):
    """What a laboratory states about its ball, instruments and files; None if unknown."""

    laboratory: str = key(to_line, "name of the laboratory", "")
    ball: str = key(to_line, "name of the ball", "")
    serial: str = key(to_line, "serial number of the ball", "")
    date: str = key(to_day, "date of the measurement; by default that of the files", "")
    source: LimitsSource = key(Choice(SOURCES), "source whose limits apply", SOURCES[0])
    temperature: float | None = key(Number(-273.15, 200.0, "degC"), "temperature of ball and air")
    instruments: tuple[str | Instrument, ...] = key(
        Listed(_instrument), "names of instruments, or tables with their certificates", ()
    )
    channel: int | str | None = key(to_channel, "channel of the force, by number or name")
    channels: str | tuple[int | str, ...] | None = key(
        require_channels, "load cells whose forces are added: sum for all channels of force"
    )
    unit: str | None = key(
        require_unit, "unit of the recorded values, if the file does not state it"
    )
    calibration: Calibration | str | float | tuple[Calibration | str | float, ...] | None = key(
        to_calibrations, 'factors such as 250, "250 N/V" or "4.1 pC/N, 10 mV/pC"'
    )
    calibration_uncertainty: float | None = key(
        Number(0.0, 0.5), "relative standard uncertainty of the calibration, such as 0.005"
    )
    polarity: str | None = key(Choice(POLARITIES), "sign of a compression in the file")
    sample_rate: float | None = key(
        Number(1.0, 1e9, "Hz"), "sample rate, if the file does not state it"
    )
    mass: float | None = key(Number(0.01, 1000.0, "kg"), "mass of the source")
    # Above 10 m it is likely to be stated in cm.
    height: float | None = key(Number(0.001, 10.0, "m"), "drop height")
    mass_uncertainty: float | None = key(
        Number(0.0, 100.0, "kg"), "standard uncertainty of the mass"
    )
    height_uncertainty: float | None = key(
        Number(0.0, 1.0, "m"), "standard uncertainty of the height"
    )
    plate: Plate | None = key(Plate.read, "the force plate")
    filter: RecorderFilter | None = key(RecorderFilter.read, "the low-pass filter of the recorder")
    drops: str | None = key(
        to_numbers, 'drops to be measured, such as "1-5, 8"; they count over all files'
    )
    leave_out: Mapping[str, str] = key(
        to_reasons, 'drops to be left out, with the reason: {"3": "touched"}', {}
    )
    begin: float | None = key(Number(0.0, 1e9, "s"), "begin of the searched section of each file")
    end: float | None = key(Number(0.0, 1e9, "s"), "end of the searched section of each file")
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
    def resonance(self) -> Plate | None:
        """The plate if its resonance is stated, which is corrected."""
        return self.plate if self.plate and not math.isnan(self.plate.f0) else None

    @property
    def recorder_filter(self) -> RecorderFilter | None:
        """The filter if it is stated and not flat, which is corrected."""
        return self.filter if self.filter and self.filter.kind != "none" else None

    @property
    def chain(self) -> Chain | None:
        """The instruments whose responses are corrected."""
        stated = (self.resonance, self.recorder_filter)
        instruments = tuple(instrument for instrument in stated if instrument is not None)
        return Chain(instruments) if instruments else None

    def check_dates(self, file_dates: Iterable[str]) -> list[Note]:
        """Return a warning for each calibration that was due before the measurement.

        `file_dates` are those of the files, which count if no date is stated.
        """
        due = [entry for entry in self.instruments if isinstance(entry, Instrument) and entry.due]
        read = [read_date(text) for text in ([self.date] if self.date else file_dates)]
        last = max((day.date().isoformat() for day in read if day), default="")
        if due and not last:
            return [Note("date_unknown")]
        return [
            Note("calibration_overdue", entry.name or "an instrument", others={"due": entry.due})
            for entry in due
            if entry.due < last
        ]

    @property
    def plate_checks(self) -> tuple[PlateCheck, ...]:
        """Checks of the plate by the standard; none without ``[plate]``."""
        return check_plate(self.plate) if self.plate else ()


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
    config = config_from(read_toml(file)[0], shown_path(file))
    mark = config.report.accreditation_mark
    if not mark:
        return config
    report = replace(config.report, accreditation_mark=str(file.parent / mark))
    return replace(config, report=report)
