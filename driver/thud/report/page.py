"""The page of a calibration report: sheets of A4, in one HTML file with its figures."""

from __future__ import annotations

import base64
import hashlib
import math
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from thud.base._schema import QUANTITIES, VERDICTS
from thud.recordings.measured_drop import ESTIMATES
from thud.recordings.recorded_levels import BACKGROUND
from thud.report.contents import json_bytes
from thud.report.markup import inline_svg, plain, render
from thud.report.notes import shorten
from thud.report.rows import (
    COUNT,
    HEAD,
    INCOMPLETE,
    NOT_KNOWN,
    capital,
    criterion_row,
    excluded_text,
    expanded_text,
    freedom_text,
    number,
    quantity_of,
    value_text,
    width_text,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

# Maximum length of the list of files.
MAX_FILES = 60
# Maximum number of characters of the name at the foot of each page.
MAX_IDENTITY = 70
# Minimum number of drops for the test for outliers.
MIN_DROPS = 3
STANDARDS = {
    "rubber_ball": (
        "JIS A 1418-2:2019 (tables A.1 and A.2), ISO 10140-5:2021 (table F.1) and "
        "ISO 16283-2:2020 (table A.1)"
    ),
    "tyre": "JIS A 1418-2:2019 (tables A.1 and A.2)",
}
# Construction that the standards give as an example, without limits.
EXAMPLES = {"diameter": 0.18, "wall_thickness": 0.03}
BUDGET_HEAD = (
    "Contribution",
    "Type",
    "Value",
    "Divisor",
    "Sensitivity",
    "u",
    "Degrees of freedom",
    "Share",
)
# Horizontal positions of the limits in the picture of a criterion, whose width is 100.
LOWER_LIMIT_X, UPPER_LIMIT_X = 25.0, 75.0


def report_page(
    data: dict[str, Any],
    figures: Iterable[bytes] = (),
    mark: tuple[str, bytes] | None = None,
) -> str:
    """Return the page as self-contained HTML.

    `data` is the result of `thud.report.contents.report_data`, `figures` are up to two figures of
    column width as SVG, and `mark` is the media type and the content of the accreditation mark. The
    page states the SHA-256 of ``report.json``.
    """
    checksum = hashlib.sha256(json_bytes(data)).hexdigest()
    report, criteria = data["report"], data["criteria"]
    name = data["serial"] or data["name"]
    identity = f"Report {report['number'] or f'of {name}'}"
    if len(identity) > MAX_IDENTITY or not report["number"]:
        identity = f"{identity[:MAX_IDENTITY]}, SHA-256 {checksum[:16]}…"
    head = _with_picture(HEAD, "")
    return render(
        "calibration.html",
        title=f"Calibration report: {report['number'] or name}",
        identity=identity,
        data=data,
        checksum=checksum,
        mark=mark and f"data:{mark[0]};base64,{base64.b64encode(mark[1]).decode()}",
        source=data["source"].replace("_", " "),
        reason=_reason(criteria),
        about=_about(data),
        measured=_measured(data),
        head=head,
        rows=[(c, _with_picture(criterion_row(c), _range_picture(c))) for c in criteria],
        excluded=excluded_text(criteria),
        standards=STANDARDS.get(data["source"], "the standards"),
        has_own_limits=any(not criterion["limits_of_standard"] for criterion in criteria),
        figures=[inline_svg(svg.decode(), f"f{i}") for i, svg in enumerate(figures)],
        budget_head=BUDGET_HEAD,
        budgets=[_budget(criterion) for criterion in criteria if _has_budget(criterion)],
        without_budget=", ".join(
            quantity_of(criterion).title
            for criterion in criteria
            if criterion["name"] != COUNT and not criterion["uncertainty"]
        ),
        drops=_drops_and_methods(data),
        properties=_properties(data["properties"]),
        files=_files(data["files"]),
        issued=", ".join(filter(None, [report["place"], report["issued"]])),
    )


def laboratory_text(data: dict[str, Any]) -> str:
    """Return the texts that the laboratory stated, in any script."""
    keys = ("laboratory", "ball", "serial", "date", "name")
    texts = [data[key] for key in keys]
    texts += [file[key] for file in data["files"] for key in ("name", "calibration")]
    tables = [data["report"], data["properties"], *data["instruments"]]
    for value in (value for table in tables for value in table.values()):
        texts += value if isinstance(value, tuple) else [value] if isinstance(value, str) else []
    return plain("".join(texts))


def _reason(criteria: Sequence[dict[str, Any]]) -> str:
    """Return the criteria that are undecided or not met, and whether U is incomplete."""
    parts = []
    for verdict in VERDICTS[1:]:
        matching = [criterion for criterion in criteria if criterion["verdict"] == verdict]
        if names := [quantity_of(criterion).title for criterion in matching]:
            parts.append(f"{verdict}: {', '.join(names)}")
    parts = parts or ["all criteria are met"]
    if any(criterion["excluded"] for criterion in criteria):
        parts.append(f"U is incomplete where it is marked {INCOMPLETE}")
    return "; ".join(parts)


def _about(data: dict[str, Any]) -> list[tuple[str, str]]:
    """Return what is known of laboratory, client and item; [report] only where it is stated."""
    report = data["report"]
    return [
        ("Laboratory", data["laboratory"]),
        *_stated("Address", "\n".join(report["address"])),
        *_stated("Accreditation", report["accreditation"]),
        *_stated("Client", "\n".join(report["client"])),
        ("Ball", data["ball"]),
        ("Serial number", data["serial"]),
        *_stated("Item", report["item"]),
        *_stated("State of the item", report["state"]),
        *_stated("Received on", report["received"]),
        ("Measured on", data["date"]),
        *_stated("Issued on", report["issued"]),
    ]


def _stated(name: str, text: str) -> list[tuple[str, str]]:
    """Return a name with its text, if there is one."""
    return [(name, text)] if text else []


def _measured(data: dict[str, Any]) -> list[tuple[str, str]]:
    files, drops, report = data["files"], len(data["drops"]), data["report"]
    rates = sorted({file["sample_rate"] for file in files})
    range_text = " to ".join(dict.fromkeys(f"{rate / 1e3:.4g}" for rate in (rates[0], rates[-1])))
    amount = f"{_count(drops, 'drop')} in {_count(len(files), 'file')}, {range_text} kHz"
    calibrations = list(dict.fromkeys(file["calibration"] for file in files if file["calibration"]))
    relative = data["calibration_uncertainty"]
    uncertainty = (
        f"u = {100 * relative:.2g} %" if relative is not None else "uncertainty not stated"
    )
    calibration = "; ".join(shorten(calibrations, MAX_FILES)) or NOT_KNOWN
    pressure = report["pressure"]
    return [
        *_stated("Place", report["place"]),
        *_stated("Procedure", report["procedure"]),
        *_stated("Deviations", report["deviations"]),
        ("Temperature", _number_text(data["temperature"], 1, "°C")),
        *_stated("Humidity", _number_text(report["humidity"], 0, "%")),
        *_stated("Air pressure", _number_text(pressure and pressure / 100, 0, "hPa")),
        ("Recordings", amount),
        ("Calibration", f"{calibration}; {uncertainty}"),
        ("Instruments", "\n".join(map(_instrument, data["instruments"]))),
        *_stated("Traceability", report["traceability"]),
    ]


def _number_text(value: float | None, decimals: int, unit: str) -> str:
    return "" if value is None else f"{number(value, decimals)} {unit}"


def _instrument(item: dict[str, str]) -> str:
    """Return an instrument with its serial number, certificate and dates as text."""
    certificate = "certificate " * bool(item["certificate"]) + item["certificate"]
    if item["calibrated"]:
        certificate = f"{certificate or 'calibrated'} of {item['calibrated']}"
    parts = [item["name"], f"no. {item['serial']}" if item["serial"] else "", certificate]
    return ", ".join(filter(None, [*parts, f"due {item['due']}" if item["due"] else ""]))


def _properties(properties: dict[str, Any]) -> list[str]:
    """Return the stated properties of the ball, with the example of the standards."""
    lines = []
    for name, example in EXAMPLES.items():
        if properties[name] is not None:
            value = f"{1e3 * properties[name]:.4g} mm".replace("-", "−")
            lines.append(
                f"{name.replace('_', ' ')} {value} (standards: {1e3 * example:g} mm as an example, "
                "no tolerance)"
            )
    lines += [f"{name} {properties[name]}" for name in ("hardness", "surface") if properties[name]]
    if properties["temperature"] is not None:
        lines.append(f"temperature {number(properties['temperature'], 1)} °C")
    return lines


def _with_picture(row: Sequence[str], picture: str) -> list[str]:
    """Insert a picture before the verdict, the last cell of a row."""
    return [*row[:-1], picture, row[-1]]


def _has_budget(criterion: dict[str, Any]) -> bool:
    known = any(part["uncertainty"] for part in criterion["contributions"])
    return known and bool(criterion["uncertainty"]) and criterion["value"] is not None


def _budget(criterion: dict[str, Any]) -> tuple[str, list[tuple[str, ...]]]:
    """Return summary and contributions of the uncertainty budget of a criterion."""
    combined = criterion["uncertainty"]
    quantity = quantity_of(criterion)
    unit, scale = quantity.display_unit, quantity.display_scale

    def with_unit(value: float, unit: str) -> str:
        return f"{width_text(value)} {unit}".rstrip()

    result = f"{value_text(criterion)} ± {expanded_text(criterion)} {unit}".rstrip()
    summary = "; ".join(
        [
            f"{capital(quantity.title)}: {result}",
            f"u = {with_unit(combined * scale, unit)}",
            f"degrees of freedom {freedom_text(criterion['freedom'])}",
            f"k = {number(criterion['coverage_factor'], 2)}",
        ]
    )
    rows: list[tuple[str, ...]] = []
    for part in criterion["contributions"]:
        if not part["uncertainty"]:
            continue
        share = f"{100 * (part['uncertainty'] / combined) ** 2:.1f} %"
        size, sensitivity = with_unit(part["uncertainty"] * part["divisor"] * scale, unit), "1"
        if part["size"] is not None:
            size = with_unit(part["size"], part["unit"])
            per = f"/{part['unit']}" if part["unit"] else ""
            sensitivity = with_unit(part["sensitivity"] * scale, f"{unit}{per}")
        rows.append((
            part["name"], part["kind"], size, f"{part['divisor']:.4g}", sensitivity,
            with_unit(part["uncertainty"] * scale, unit), freedom_text(part["freedom"]),
            share if part["counted"] else "included",
        ))  # fmt: skip
    return summary, rows


def _range_picture(criterion: dict[str, Any]) -> Markup:
    """Return the limits of a criterion, its value and its expanded uncertainty as SVG."""
    lower, upper, value = (criterion[name] for name in ("lower", "upper", "value"))
    span = UPPER_LIMIT_X - LOWER_LIMIT_X
    box = f'<rect x="{LOWER_LIMIT_X}" y="1" width="{span}" height="8" fill="#ccc"/>'
    if value is None or lower == upper:
        return Markup()
    scale = span / (upper - lower)
    position = LOWER_LIMIT_X + scale * (value - lower)
    shown = min(max(position, 2.0), 98.0)
    half_width = scale * (criterion["expanded_uncertainty"] or 0.0)
    ends = [min(max(end, 1.0), 99.0) for end in (position - half_width, position + half_width)]
    bar = ""
    if ends[0] < ends[1]:
        bar = "".join(f"M{end:.2f} 2.5V7.5" for end in ends) + f"M{ends[0]:.2f} 5H{ends[1]:.2f}"
    mark = f'<circle cx="{shown:.2f}" cy="5" r="1.8"/>'
    if shown != position:
        tip = math.copysign(3.0, position - shown)
        mark = f'<path d="M{shown + tip / 2:.2f} 5l{-tip} -3v6z"/>'
    return Markup(  # noqa: S704 - numbers only
        f'<svg class="range" viewBox="0 0 100 10" aria-hidden="true">{box}'
        f'<path d="{bar}" fill="none" stroke="#000" stroke-width="0.9"/>{mark}</svg>'
    )


def _means(drops: Sequence[dict[str, Any]]) -> list[str]:
    means = []
    for name in ESTIMATES:
        known = [drop[name]["value"] for drop in drops if drop[name]["value"] is not None]
        # Contact time and restitution are rows of the table of criteria.
        if known and name not in {"contact_time", "restitution"}:
            quantity = QUANTITIES[name]
            unit = f" {quantity.display_unit}" if quantity.display_unit else ""
            means.append(f"{quantity.title} {quantity.show(sum(known) / len(known))}{unit}")
    methods: dict[str, list[float]] = {}
    for drop in drops:
        for method, estimate in drop["restitutions"].items():
            methods.setdefault(method, []).append(estimate["value"])
    restitutions = [
        f"by {name} {number(sum(values) / len(values), 3)}" for name, values in methods.items()
    ]
    return [
        f"mean: {', '.join(means)}",
        *([f"mean restitution: {', '.join(restitutions)}"] if restitutions else []),
    ]


def _drops_and_methods(data: dict[str, Any]) -> list[str]:
    drops, low, high = data["drops"], *BACKGROUND
    results = _means(drops)
    averaged = "energy average of the drops" if len(drops) > 1 else "of one drop"
    results.append(
        f"levels: {averaged}, method exact (band energy of the force from first touch to release, "
        "with a margin for their uncertainty; zero outside)"
    )
    flags = {entry["flag"] for entry in data["criteria"]}
    if "corrected" in flags:
        results.append(f"levels {low:g} to {high:g} dB above the background were corrected for it")
    if "background" in flags:
        results.append(f"levels less than {low:g} dB above the background are upper bounds")
    plate_checks = data["plate"]
    met = [check["reason"] for check in plate_checks if check["met"]]
    if met:
        results.append(f"force plate: {'; '.join(met)}")
    bands = [f"{entry['band']:g}" for entry in data["criteria"] if entry["band"] is not None]
    for method, differences in data["method_differences"].items():
        if any(differences):
            values = " / ".join("–" if d is None else number(d, 2) for d in differences)
            results.append(
                f"method {method} differs from exact by up to {values} dB in the octaves of "
                f"{bands[0]} to {bands[-1]} Hz, in this order"
            )
    return [*results, *_outliers(data)] if len(drops) >= MIN_DROPS else results


def _outliers(data: dict[str, Any]) -> list[str]:
    """Return how many drops are outliers, and the means with and without them."""
    outliers = [note for note in data["notes"] if note["code"] == "outlier"]
    names = {note["subject"] for note in outliers}
    if not names:
        return ["no drop differs from the others by more than chance (Grubbs, 5 %)"]
    count = _count(len(names), "outlier")
    lines = [
        f"{count} (Grubbs, 5 %), marked but not excluded: all values and averages include them"
    ]
    other = data["without_outliers"]
    if other:
        levels = " / ".join("–" if z is None else number(z, 2) for z in other["levels"])
        parts = [f"{levels} dB"]
        if other["contact_time"] is not None:
            parts.append(f"contact time {number(1e3 * other['contact_time'], 2)} ms")
        if other["restitution"] is not None:
            parts.append(f"restitution {number(other['restitution'], 3)}")
        lines.append(
            f"average of the other {_count(other['drops'], 'drop')}, without outliers: "
            f"{', '.join(parts)}"
        )
    return lines


def _files(files: Sequence[dict[str, Any]]) -> list[tuple[str, str]]:
    names = shorten([file["name"] for file in files], MAX_FILES)
    # If there are more files, the last text says how many and has no checksum.
    listed = files if len(files) <= MAX_FILES else files[: MAX_FILES - 1]
    checksums = [file["sha256"] for file in listed]
    return list(zip_longest(names, checksums, fillvalue=""))


def _count(number_of: int, noun: str) -> str:
    return f"{number_of} {noun}{'s' * (number_of != 1)}"
