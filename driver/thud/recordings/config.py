"""Configuration of a laboratory: a small TOML file next to its recordings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any

from thud.base.checks import refuse
from thud.base.files import read_toml
from thud.level.levels import SOURCES
from thud.recordings import dates
from thud.recordings.channel import shown_path
from thud.recordings.config_values import (
    Checked,
    checked_values,
    require_keys,
    to_calibrations,
    to_channel,
    to_choice,
    to_date,
    to_day,
    to_instance,
    to_limits,
    to_line,
    to_linearity,
    to_lines,
    to_number,
    to_numbers,
    to_reasons,
    to_table,
    to_whole,
)
from thud.recordings.force_units import (
    Calibration,
    require_unit,
)
from thud.recordings.load_cells import require_channels
from thud.recordings.picture import read_picture
from thud.recordings.plate import Plate, check_plate
from thud.recordings.polarity import POLARITIES
from thud.recordings.recorder_filter import KINDS, MAX_ORDER, RecorderFilter
from thud.recordings.response import Chain
from thud.recordings.restitution import DropConditions
from thud.recordings.signal_files import regular_file

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Iterable

    from thud.base._schema import LimitsSource
    from thud.recordings.plate import PlateCheck


def _key(check: Callable[[object, str], object], default: object = None) -> Any:  # noqa: ANN401
    """Declare a key with its check, which returns the value or raises InputError."""
    return field(default=default, metadata={"check": check})


@dataclass(frozen=True)
class PlateConfig(Checked):
    """A force plate.

    Attributes
    ----------
    f0, Q : float or None
        Frequency, Hz, and quality factor of the first resonance, which will be corrected.
    f0_uncertainty : float or None
        Relative standard uncertainty of the frequency.
    share : float or None
        Share of this mode in the static response, 1 for a mass on a spring; assumed to be 1 if it
        is not stated.
    flat_limit : float or None
        Frequency, Hz, up to which the response is flat within 2 %, if no resonance is stated.
    time_constant : float or None
        Time constant of the amplifier, s.
    full_scale : float or None
        Largest force that plate and recorder can measure, N.
    linearity : tuple of tuple
        Pairs of a force applied and the force indicated, N.
    """

    f0: float | None = _key(partial(to_number, 1.0, 1e6))
    Q: float | None = _key(partial(to_number, 0.5, 1e6))
    f0_uncertainty: float | None = _key(partial(to_number, 0.0, 0.5))
    share: float | None = _key(partial(to_number, 0.001, 1.0))
    flat_limit: float | None = _key(partial(to_number, 100.0, 1e6))
    time_constant: float | None = _key(partial(to_number, 1e-3, 1e9))
    full_scale: float | None = _key(partial(to_number, 1.0, 1e9))
    linearity: tuple[tuple[float, float], ...] = _key(to_linearity, ())

    def __post_init__(self) -> None:
        """Raise InputError if a value is not allowed, or one is missing."""
        super().__post_init__()
        _require_resonance(self.stated(), "plate")


def _plate(value: object, key: str) -> PlateConfig:
    if isinstance(value, PlateConfig):
        return value
    table = checked_values(to_table(value, key), PlateConfig, f"{key}: ")
    _require_resonance(table, key)
    return PlateConfig(**table)


def _require_resonance(stated: Mapping[str, object], key: str) -> None:
    """Raise InputError if a resonance is incomplete, or stated besides a flat response."""
    if {"f0", "Q", "f0_uncertainty", "share"} & set(stated):
        require_keys(stated, key, "f0", "Q")
        if "flat_limit" in stated:
            refuse(f"{key}: f0 and flat_limit are both stated", "one of them")


@dataclass(frozen=True)
class FilterConfig(Checked):
    """The low-pass filter of the recorder or amplifier, which will be corrected.

    Attributes
    ----------
    kind : str
        ``"bessel"``, ``"butterworth"``, or ``"none"`` for a recorder whose response is flat in the
        bands.
    order : int or None
        Order.
    cutoff : float or None
        Cutoff at -3 dB, Hz.
    cutoff_uncertainty : float or None
        Relative standard uncertainty of the cutoff.
    """

    kind: str = _key(partial(to_choice, (*KINDS, "none")), "none")
    order: int | None = _key(partial(to_whole, 1, MAX_ORDER))
    cutoff: float | None = _key(partial(to_number, 1.0, 1e9))
    cutoff_uncertainty: float | None = _key(partial(to_number, 0.0, 0.5))

    def __post_init__(self) -> None:
        """Raise InputError if a value is not allowed, or one is missing."""
        super().__post_init__()
        _require_filter(self.stated(), "filter")


def _filter(value: object, key: str) -> FilterConfig:
    if isinstance(value, FilterConfig):
        return value
    table = checked_values(to_table(value, key), FilterConfig, f"{key}: ")
    require_keys(table, key, "kind")
    _require_filter(table, key)
    return FilterConfig(**table)


def _require_filter(stated: Mapping[str, object], key: str) -> None:
    """Raise InputError if a filter is incomplete, or none has an order or a cutoff."""
    if stated.get("kind", "none") != "none":
        require_keys(stated, key, "order", "cutoff")
    elif set(stated) - {"kind"}:
        refuse(f"{key}: kind = 'none' has an order or a cutoff", "kind alone, or another kind")


@dataclass(frozen=True)
class Instrument(Checked):
    """An instrument of the measurement and its calibration certificate.

    Attributes
    ----------
    name, serial, certificate : str
        Name, serial number, and number of the certificate.
    calibrated, due : str
        Dates of the certificate and of the next calibration.
    """

    name: str = _key(to_line, "")
    serial: str = _key(to_line, "")
    certificate: str = _key(to_line, "")
    calibrated: str = _key(to_date, "")
    due: str = _key(to_date, "")


def _instruments(value: object, key: str) -> tuple[str | Instrument, ...]:
    return tuple(
        Instrument(**checked_values(entry, Instrument, f"{key}: "))
        if isinstance(entry, Mapping)
        else entry
        if isinstance(entry, Instrument)
        else to_line(entry, key)
        for entry in (value if isinstance(value, list | tuple) else [value])
    )


@dataclass(frozen=True)
class ReportConfig(Checked):
    """What a report of a laboratory states besides its results (ISO/IEC 17025, 7.8).

    Attributes
    ----------
    number : str
        Number of the report, on each page.
    address, client : tuple of str
        Address of the laboratory; name and address of the client: a line each.
    item, state : str
        Description of the item, and its state at receipt.
    received, issued : str
        Dates of receipt of the item and of issue of the report.
    place, procedure, deviations : str
        Place and procedure of the measurement, and deviations from the procedure.
    traceability : str
        Statement on the metrological traceability of the results.
    humidity, pressure : float or None
        Relative humidity, %, and static pressure of the air, Pa.
    accreditation : str
        Text on the accreditation.
    accreditation_mark : str
        File of the accreditation mark: SVG, PNG or JPEG.
    authorized_by : str
        Person who authorizes the report.
    """

    number: str = _key(to_line, "")
    address: tuple[str, ...] = _key(to_lines, ())
    client: tuple[str, ...] = _key(to_lines, ())
    item: str = _key(to_line, "")
    state: str = _key(to_line, "")
    received: str = _key(to_date, "")
    issued: str = _key(to_date, "")
    place: str = _key(to_line, "")
    procedure: str = _key(to_line, "")
    deviations: str = _key(to_line, "")
    traceability: str = _key(to_line, "")
    # Below 1 % it is likely to be a fraction.
    humidity: float | None = _key(partial(to_number, 1.0, 100.0))
    pressure: float | None = _key(partial(to_number, 5e4, 1.2e5))
    accreditation: str = _key(to_line, "")
    accreditation_mark: str = _key(to_line, "")
    authorized_by: str = _key(to_line, "")


@dataclass(frozen=True)
class Properties(Checked):
    """Properties of the ball that are stated, not assessed (ISO 10140-5, annex F).

    Attributes
    ----------
    diameter, wall_thickness : float or None
        Outer diameter and wall thickness, m.
    hardness, surface : str
        Hardness with its scale, and condition of the surface.
    temperature : float or None
        Temperature of the ball, degC, if not that of the air.
    """

    diameter: float | None = _key(partial(to_number, 0.01, 10.0))
    wall_thickness: float | None = _key(partial(to_number, 1e-4, 1.0))
    hardness: str = _key(to_line, "")
    surface: str = _key(to_line, "")
    temperature: float | None = _key(partial(to_number, -273.15, 200.0))


@dataclass(frozen=True)
class Config(Checked):
    """What a laboratory states about its ball, instruments and files; None if unknown.

    Attributes
    ----------
    laboratory, ball, serial : str
        Names for the report.
    date : str
        Date of the measurement, such as ``"2024-05-03"``; by default that of the files.
    source : str
        Source whose limits apply.
    temperature : float or None
        Temperature of ball and air, degC.
    instruments : tuple of str or Instrument
        Instruments.
    channel, channels, unit, polarity, sample_rate, calibration
        As for `open_signals`.
    calibration_uncertainty : float or None
        Relative standard uncertainty of the force; by default that of the `Calibration`.
    mass, height : float or None
        Mass of the ball, kg, and drop height, m.
    mass_uncertainty, height_uncertainty : float or None
        Their standard uncertainties, kg and m.
    plate : PlateConfig or None
        The force plate.
    filter : FilterConfig or None
        The low-pass filter of the recorder.
    drops : str or None
        Numbers of the drops to be measured, such as ``"1-5, 8"``; all by default. They count over
        all files.
    leave_out : mapping
        Numbers of drops to be left out, with the reason: ``{"3": "touched"}``.
    begin, end : float or None
        Section of each file that is searched for drops, s.
    limits : mapping
        Minimum and maximum by criterion, which replace those of the standards.
    report : ReportConfig
        What the report states besides the results.
    properties : Properties
        Properties of the ball that are stated, not assessed.
    """

    laboratory: str = _key(to_line, "")
    ball: str = _key(to_line, "")
    serial: str = _key(to_line, "")
    date: str = _key(to_day, "")
    source: LimitsSource = _key(partial(to_choice, SOURCES), SOURCES[0])
    temperature: float | None = _key(partial(to_number, -273.15, 200.0))
    instruments: tuple[str | Instrument, ...] = _key(_instruments, ())
    channel: int | str | None = _key(to_channel)
    channels: str | tuple[int | str, ...] | None = _key(require_channels)
    unit: str | None = _key(require_unit)
    calibration: Calibration | str | float | tuple[Calibration | str | float, ...] | None = _key(
        to_calibrations
    )
    calibration_uncertainty: float | None = _key(partial(to_number, 0.0, 0.5))
    polarity: str | None = _key(partial(to_choice, POLARITIES))
    sample_rate: float | None = _key(partial(to_number, 1.0, 1e9))
    mass: float | None = _key(partial(to_number, 0.01, 1000.0, unit="kg"))
    # Above 10 m it is likely to be stated in cm.
    height: float | None = _key(partial(to_number, 0.001, 10.0, unit="m"))
    mass_uncertainty: float | None = _key(partial(to_number, 0.0, 100.0, unit="kg"))
    height_uncertainty: float | None = _key(partial(to_number, 0.0, 1.0, unit="m"))
    plate: PlateConfig | None = _key(_plate)
    filter: FilterConfig | None = _key(_filter)
    drops: str | None = _key(to_numbers)
    leave_out: Mapping[str, str] = field(default_factory=dict, metadata={"check": to_reasons})
    begin: float | None = _key(partial(to_number, 0.0, 1e9))
    end: float | None = _key(partial(to_number, 0.0, 1e9))
    limits: Mapping[str, tuple[float, float]] = field(
        default_factory=dict, metadata={"check": to_limits}
    )
    report: ReportConfig = _key(partial(to_instance, ReportConfig), ReportConfig())
    properties: Properties = _key(partial(to_instance, Properties), Properties())

    @property
    def resonance(self) -> Plate | None:
        """The resonance to be corrected; an unknown uncertainty counts as zero."""
        plate = self.plate
        if plate is None or plate.f0 is None or plate.Q is None:
            return None
        share = 1.0 if plate.share is None else plate.share
        return Plate(plate.f0, plate.Q, plate.f0_uncertainty or 0.0, share)

    @property
    def recorder_filter(self) -> RecorderFilter | None:
        """The filter to be corrected; an unknown uncertainty counts as zero."""
        stated = self.filter
        if stated is None or stated.order is None or stated.cutoff is None:
            return None
        kind: Any = stated.kind
        return RecorderFilter(kind, stated.order, stated.cutoff, stated.cutoff_uncertainty or 0.0)

    @property
    def chain(self) -> Chain | None:
        """The instruments whose responses are corrected."""
        stated = (self.resonance, self.recorder_filter)
        instruments = tuple(instrument for instrument in stated if instrument is not None)
        return Chain(instruments) if instruments else None

    def conditions(self, calibration: float | None) -> DropConditions:
        """Return the conditions of the drops; an unknown uncertainty counts as zero."""
        return DropConditions(
            self.height,
            self.mass,
            calibration or 0.0,
            self.mass_uncertainty or 0.0,
            self.height_uncertainty or 0.0,
        )

    def check_dates(self, file_dates: Iterable[str]) -> list[str]:
        """Return a warning for each date that contradicts another one.

        These are calibrations that were due before the measurement, and dates of receipt and issue
        in the wrong order. `file_dates` are those of the files, which count if no date is stated.
        """
        read = [dates.read_date(text) for text in ([self.date] if self.date else file_dates)]
        days = sorted(day.date().isoformat() for day in read if day)
        first, last = (days[0], days[-1]) if days else ("", "")
        received, issued = self.report.received, self.report.issued
        # Each pair should be in this order; dates that are not stated are empty.
        pairs = (
            ("the item was received", received, "the measurement", first),
            ("the measurement was made", last, "the issue of the report", issued),
            ("the item was received", received, "the issue of the report", issued),
        )
        result = [
            *(
                f"{item.name}: its calibration was due on {item.due}, before the measurement"
                for item in self.instruments
                if isinstance(item, Instrument) and item.due and item.due < last
            ),
            *(
                f"{event} on {day}, after {other} on {limit}"
                for event, day, other, limit in pairs
                if day and limit and day > limit
            ),
        ]
        if not last and any(isinstance(item, Instrument) and item.due for item in self.instruments):
            result.append(
                "the date of the measurement cannot be read: whether a calibration was due before "
                "is not known"
            )
        return result

    @property
    def plate_checks(self) -> tuple[PlateCheck, ...]:
        """Checks of the plate by the standard; none without ``[plate]``."""
        plate = self.plate
        if plate is None:
            return ()
        return check_plate(
            self.resonance,
            time_constant=plate.time_constant,
            full_scale=plate.full_scale,
            linearity=plate.linearity or None,
        )


def config_from(table: Mapping[str, object], prefix: str = "") -> Config:
    """Return the configuration of a table as in a file; messages begin with `prefix`.

    Raise InputError if a key is unknown, or its value of the wrong type or out of range.
    """
    return Config(**checked_values(table, Config, prefix))


def read_config(path: str | os.PathLike[str]) -> Config:
    """Read a configuration.

    Raise InputError if a key is unknown, or its value of the wrong type or out of range.
    """
    file = regular_file(path)
    config = config_from(read_toml(file)[0], f"{shown_path(file)}: ")
    mark = config.report.accreditation_mark
    if not mark:
        return config
    path = file.parent / mark
    read_picture(path)
    return replace(config, report=replace(config.report, accreditation_mark=str(path)))
