"""The page of a calibration report: sheets of A4, in one HTML file with its figures."""

from __future__ import annotations

import hashlib
import math
from typing import TYPE_CHECKING, NamedTuple

from thud.base.bridge import version
from thud.level.levels import STANDARDS
from thud.plot.templates import render
from thud.recordings.checks.plate import check_plate
from thud.recordings.recorded_levels import BACKGROUND
from thud.report.contents import json_bytes
from thud.report.rows import (
    COUNT,
    HEAD,
    NOT_KNOWN,
    capital,
    criterion_row,
    drop_table,
    entry_text,
    excluded_text,
    expanded_text,
    freedom_text,
    number,
    reason_text,
    width_text,
)

if TYPE_CHECKING:
    from collections.abc import Iterable

    from thud.level.assessment import Criterion
    from thud.recordings.config import Instrument, Properties
    from thud.recordings.recording import Recording
    from thud.report.contents import ReportCriterion, ReportData

# Maximum number of characters of the name at the foot of each page.
MAX_IDENTITY = 70
# Minimum number of drops for the test for outliers.
MIN_DROPS = 3
# Construction that the standards give as an example, without limits.
EXAMPLES = {"diameter": 0.18, "wall_thickness": 0.03}
BUDGET_HEAD = (
    "Contribution", "Type", "Value", "Divisor", "Sensitivity", "u", "Degrees of freedom", "Share",
)  # fmt: skip
# Minimum share of the variance of a contribution that the page lists.
MIN_SHARE = 0.0005
# Horizontal positions of the limits in the picture of a criterion, and of its ends.
LIMITS_X, ENDS_X = (25.0, 75.0), (2.0, 98.0)


class RangePicture(NamedTuple):
    """Horizontal positions of a value and of both ends of value ± U in the picture of a criterion.

    `side` is -1 or 1 if the value lies beyond the left or right end of the picture, else 0.
    """

    value: float
    low: float
    high: float
    side: int


def report_page(
    data: ReportData, figures: Iterable[bytes] = (), mark: tuple[str, bytes] | None = None
) -> str:
    """Return the page as self-contained HTML.

    `data` is the result of `thud.report.contents.report_data`, `figures` are up to two figures of
    column width as SVG, and `mark` is the media type and the content of the accreditation mark. The
    page states the SHA-256 of ``report.json``.
    """
    checksum = hashlib.sha256(json_bytes(data)).hexdigest()
    config, criteria = data.recording.config, data.criteria
    report = config.report
    name = config.serial or data.recording.name
    identity = f"Report {report.number or f'of {name}'}"
    if len(identity) > MAX_IDENTITY or not report.number:
        identity = f"{identity[:MAX_IDENTITY]}, SHA-256 {checksum[:16]}…"
    return render(
        "report/calibration.html",
        title=f"Calibration report: {report.number or name}",
        identity=identity,
        version=version(),
        data=data,
        report=report,
        checksum=checksum,
        mark=mark,
        reason=reason_text(criteria),
        about=_about(data),
        measured=_measured(data.recording),
        head=HEAD,
        rows=[(e.criterion.conforms, criterion_row(e), range_picture(e)) for e in criteria],
        limits_x=LIMITS_X,
        excluded=excluded_text(criteria),
        standards=STANDARDS.get(data.verdict.source, "the standards"),
        has_own_limits=any(entry.has_own_limits for entry in criteria),
        figures=[*figures],
        drops=drop_table(data.recording),
        budget_head=BUDGET_HEAD,
        budgets=[*map(_budget, (e for e in criteria if _has_budget(e.criterion)))],
        without_budget=", ".join(
            entry.criterion.quantity.title
            for entry in criteria
            if entry.criterion.name != COUNT and not entry.criterion.estimate.uncertainty
        ),
        methods=_methods(data),
        properties=_properties(config.properties),
        issued=", ".join(filter(None, [report.place, report.issued])),
    )


def _about(data: ReportData) -> dict[str, str]:
    """Return what is stated of laboratory, client and item."""
    config, report = data.recording.config, data.recording.config.report
    return _stated({
        "Laboratory": config.laboratory or NOT_KNOWN,
        "Address": "\n".join(report.address),
        "Accreditation": report.accreditation,
        "Client": "\n".join(report.client),
        "Ball": config.ball or NOT_KNOWN,
        "Serial number": config.serial or NOT_KNOWN,
        "Item": report.item,
        "State of the item": report.state,
        "Received on": report.received,
        "Measured on": data.date or NOT_KNOWN,
        "Issued on": report.issued,
    })  # fmt: skip


def _stated(pairs: dict[str, str]) -> dict[str, str]:
    """Return the pairs that have a text."""
    return {name: text for name, text in pairs.items() if text}


def _measured(recording: Recording) -> dict[str, str]:
    """Return what is stated on where, how and with what the drops were measured."""
    config, report, files = recording.config, recording.config.report, recording.origins
    rates = sorted(file.sample_rate for file in files)
    range_text = " to ".join(dict.fromkeys(f"{rate / 1e3:.4g}" for rate in (rates[0], rates[-1])))
    calibrations = dict.fromkeys(file.calibration for file in files if file.calibration)
    relative = recording.calibration_uncertainty
    uncertainty = "uncertainty not stated" if relative is None else f"u = {100 * relative:.2g} %"
    pressure = report.pressure
    amount = f"{_count(len(recording.drops), 'drop')} in {_count(len(files), 'file')}"
    return _stated({
        "Place": report.place,
        "Procedure": report.procedure,
        "Deviations": report.deviations,
        "Temperature": _number_text(config.temperature, 1, "°C") or NOT_KNOWN,
        "Humidity": _number_text(report.humidity, 0, "%"),
        "Air pressure": _number_text(pressure and pressure / 100, 0, "hPa"),
        "Recordings": f"{amount}, {range_text} kHz",
        "Calibration": f"{'; '.join(calibrations) or NOT_KNOWN}; {uncertainty}",
        "Instruments": "\n".join(map(_instrument, config.instruments)) or NOT_KNOWN,
        "Traceability": report.traceability,
    })  # fmt: skip


def _number_text(value: float | None, decimals: int, unit: str) -> str:
    return "" if value is None else f"{number(value, decimals)} {unit}"


def _count(number_of: int, noun: str) -> str:
    return f"{number_of} {noun}{'s' * (number_of != 1)}"


def _instrument(item: Instrument) -> str:
    """Return an instrument with its serial number, certificate and dates as text."""
    certificate = "certificate " * bool(item.certificate) + item.certificate
    if item.calibrated:
        certificate = f"{certificate or 'calibrated'} of {item.calibrated}"
    parts = [item.name, f"no. {item.serial}" if item.serial else "", certificate]
    return ", ".join(filter(None, [*parts, f"due {item.due}" if item.due else ""]))


def _properties(properties: Properties) -> list[str]:
    """Return the stated properties of the ball, with the example of the standards."""
    lines = [
        f"{name.replace('_', ' ')} {1e3 * value:.4g} mm (standards: {1e3 * example:g} "
        "mm as an example, no tolerance)"
        for name, example in EXAMPLES.items()
        if (value := getattr(properties, name)) is not None
    ]
    stated = {"hardness": properties.hardness, "surface": properties.surface}
    stated["temperature"] = _number_text(properties.temperature, 1, "°C")
    return [*lines, *(f"{name} {text}" for name, text in stated.items() if text)]


def _has_budget(criterion: Criterion) -> bool:
    """Whether value and uncertainty of a criterion are known."""
    return bool(criterion.estimate.uncertainty) and not math.isnan(criterion.value)


def _budget(entry: ReportCriterion) -> tuple[str, list[tuple[str, ...]]]:
    """Return summary and contributions of the uncertainty budget of a criterion."""
    estimate, quantity = entry.criterion.estimate, entry.criterion.quantity
    unit, scale = quantity.display_unit, quantity.display_scale

    def with_unit(value: float, unit: str) -> str:
        return f"{width_text(value)} {unit}".rstrip()

    result = f"{entry_text(entry)} ± {expanded_text(entry)} {unit}".rstrip()
    summary = "; ".join(
        [
            f"{capital(quantity.title)}: {result}",
            f"u = {with_unit(estimate.uncertainty * scale, unit)}",
            f"degrees of freedom {freedom_text(estimate.freedom)}",
            f"k = {number(estimate.coverage_factor, 2)}",
        ]
    )
    rows: list[tuple[str, ...]] = []
    for part in estimate.contributions:
        share = (part.uncertainty / estimate.uncertainty) ** 2
        if not share >= MIN_SHARE:
            continue
        size, sensitivity = with_unit(part.uncertainty * part.divisor * scale, unit), "1"
        if not math.isnan(part.size):
            size = with_unit(part.size, part.unit)
            per = f"/{part.unit}" if part.unit else ""
            sensitivity = with_unit(part.sensitivity * scale, f"{unit}{per}")
        rows.append((
            part.name, part.kind, size, f"{part.divisor:.4g}", sensitivity,
            with_unit(part.uncertainty * scale, unit), freedom_text(part.freedom),
            f"{100 * share:.1f} %" if part.counted else "included",
        ))  # fmt: skip
    return summary, rows


def range_picture(entry: ReportCriterion) -> RangePicture | None:
    """Return the picture of a criterion; None for a count or an unknown value."""
    lower, upper, value = entry.criterion.lower, entry.criterion.upper, entry.criterion.value
    if math.isnan(value) or lower == upper:
        return None
    scale = (LIMITS_X[1] - LIMITS_X[0]) / (upper - lower)
    position = LIMITS_X[0] + scale * (value - lower)
    half_width = scale * (entry.expanded if math.isfinite(entry.expanded) else 0.0)
    left, right = ENDS_X
    low, high = (
        min(max(end, left - 1), right + 1) for end in (position - half_width, position + half_width)
    )
    side = int(position > right) - int(position < left)
    return RangePicture(min(max(position, left), right), low, high, side)


def _methods(data: ReportData) -> Iterable[str]:
    """Yield how levels, plate and outliers were treated."""
    recording = data.recording
    drops, low, high = recording.drops, *BACKGROUND
    averaged = "energy average of the drops" if len(drops) > 1 else "of one drop"
    yield (
        f"levels: {averaged}, method exact (band energy of the force from first touch to release, "
        "with a margin for their uncertainty; zero outside)"
    )
    flags = {entry.flag for entry in data.criteria}
    if "corrected" in flags:
        yield f"levels {low:g} to {high:g} dB above the background were corrected for it"
    if "background" in flags:
        yield f"levels less than {low:g} dB above the background are upper bounds"
    checks = check_plate(recording.config.plate).values()
    if met := [str(note) for is_met, note in checks if is_met]:
        yield f"force plate: {'; '.join(met)}"
    outliers = {note.subject for note in recording.outliers}
    if outliers:
        yield (
            f"{_count(len(outliers), 'outlier')} (Grubbs, 5 %), marked but not excluded: all "
            "values and averages include them"
        )
    elif len(drops) >= MIN_DROPS:
        yield "no drop differs from the others by more than chance (Grubbs, 5 %)"
