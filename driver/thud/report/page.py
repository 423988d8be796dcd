"""The page of a calibration report: one A4 sheet, in one HTML file with its figures."""

from __future__ import annotations

import html
import io
import math
import re
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

from thud.base._schema import QUANTITIES
from thud.base.display import warn_if_not_drawn
from thud.level.assessment import VERDICTS
from thud.plot.style import own_style
from thud.recordings.measured_drop import ESTIMATES
from thud.recordings.recorded_levels import BACKGROUND
from thud.report.fonts import FAMILY, font_faces
from thud.report.notes import group_by_kind, shorten
from thud.report.rows import HEAD, NOT_KNOWN, criterion_row, criterion_style, limits_of, number
from thud.report.template import BODY, PAGE

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from matplotlib.figure import Figure

# Maximum length of the lists of instruments and of files, and of each list of notes.
MAX_INSTRUMENTS, MAX_FILES, MAX_NOTES = 6, 5, 7
# Minimum number of drops for the test for outliers.
MIN_DROPS = 3
STANDARDS = {
    "rubber_ball": "JIS A 1418-2, ISO 10140-5 and ISO 16283-2",
    "tyre": "JIS A 1418-2",
}
# Horizontal positions of the limits in the picture of a criterion, whose width is 100.
LOWER_LIMIT_X, UPPER_LIMIT_X = 25.0, 75.0


def report_page(data: dict[str, Any], figures: Sequence[Figure], checksum: str) -> str:
    """Return the page as self-contained HTML.

    `data` is the result of `thud.report.contents.report_data`, `figures` are up to two figures of
    column width, and `checksum` is the SHA-256 of ``report.json``.
    """
    source = data["source"].replace("_", " ")
    body = BODY.substitute(
        source=_text(source),
        verdict=_text(data["verdict"]),
        reason=_text(_reason(data["criteria"])),
        about=_pairs(_about(data)),
        measured=_pairs(_measured(data)),
        head="".join(f"<th>{_text(name)}</th>" for name in _with_picture(HEAD, "")),
        rows="\n".join(map(_row, data["criteria"])),
        rule=_text(_rule(data)),
        figures="\n".join(_cells(figures)),
        drops=_notes("Drops and methods", _drops_and_methods(data)),
        processing=_notes("Signal processing", _messages(data, "steps") or ["nothing"]),
        warnings=_notes("Warnings", _messages(data, "warnings") or ["none"]),
        files=_files(data["files"]),
        footer=_text(f"thud {data['thud']} · report.json: SHA-256 {checksum}"),
    )
    title = f"Calibration report: {data['serial'] or data['name']}"
    characters = "".join(sorted(set(html.unescape(re.sub(r"<[^>]*>", "", body)))))
    return PAGE.substitute(
        title=_text(title),
        fonts=font_faces(characters),
        family=FAMILY,
        body=body,
    )


def laboratory_text(data: dict[str, Any]) -> str:
    """Return the texts that the laboratory stated, in any script."""
    keys = ("laboratory", "ball", "serial", "date", "name")
    files = [file[key] for file in data["files"] for key in ("name", "calibration")]
    return _plain("".join([*(data[key] for key in keys), *data["instruments"], *files]))


def _plain(text: str) -> str:
    """Return a text as one line of printable characters."""
    line = " ".join(text.split())
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in line)


def _text(text: str) -> str:
    return html.escape(_plain(text))


def _reason(criteria: Sequence[dict[str, Any]]) -> str:
    """Return the criteria that are inconclusive or not met, as text."""
    parts = []
    for verdict in VERDICTS[1:]:
        matching = [criterion for criterion in criteria if criterion["verdict"] == verdict]
        names = [criterion_style(criterion).title.split(",")[0] for criterion in matching]
        if names:
            parts.append(f"{verdict}: {', '.join(names).lower().replace(' hz', ' Hz')}")
    return "; ".join(parts) or "all criteria are met"


def _about(data: dict[str, Any]) -> list[tuple[str, str]]:
    temperature = data["temperature"]
    return [
        ("Laboratory", data["laboratory"]),
        ("Ball", data["ball"]),
        ("Serial number", data["serial"]),
        ("Measured on", data["date"]),
        ("Temperature", "" if temperature is None else f"{number(temperature, 1)} °C"),
    ]


def _measured(data: dict[str, Any]) -> list[tuple[str, str]]:
    files, drops = data["files"], len(data["drops"])
    rates = sorted({file["sample_rate"] for file in files})
    range_text = " to ".join(dict.fromkeys(f"{rate / 1e3:.4g}" for rate in (rates[0], rates[-1])))
    amount = f"{_count(drops, 'drop')} in {_count(len(files), 'file')}, {range_text} kHz"
    calibrations = list(dict.fromkeys(file["calibration"] for file in files if file["calibration"]))
    relative = data["calibration_uncertainty"]
    uncertainty = (
        f"u = {100 * relative:.2g} %" if relative is not None else "uncertainty not stated"
    )
    more = f" and {len(calibrations) - 1} more" if len(calibrations) > 1 else ""
    calibration = f"{calibrations[0]}{more}" if calibrations else NOT_KNOWN
    return [
        ("Recordings", amount),
        ("Calibration", f"{calibration}; {uncertainty}"),
        ("Instruments", "\n".join(shorten(data["instruments"], MAX_INSTRUMENTS))),
    ]


def _pairs(pairs: Iterable[tuple[str, str]]) -> str:
    rows = []
    for label, value in pairs:
        shown = "<br>".join(map(_text, value.split("\n"))) if value else NOT_KNOWN
        rows.append(f'<tr><th>{_text(label)}</th><td dir="auto">{shown}</td></tr>')
    return "\n".join(rows)


def _with_picture(row: Sequence[str], picture: str) -> list[str]:
    """Insert a picture before the verdict, the last cell of a row."""
    return [*row[:-1], picture, row[-1]]


def _row(criterion: dict[str, Any]) -> str:
    cells = _with_picture(
        [_text(cell) for cell in criterion_row(criterion)], _range_picture(criterion)
    )
    style = criterion["verdict"].replace(" ", "-")
    return f'<tr class="{style}">' + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>"


def _range_picture(criterion: dict[str, Any]) -> str:
    """Return the limits of a criterion, its value and its expanded uncertainty as SVG."""
    (lower, upper), value = limits_of(criterion), criterion["value"]
    span = UPPER_LIMIT_X - LOWER_LIMIT_X
    box = f'<rect x="{LOWER_LIMIT_X}" y="1" width="{span}" height="8" fill="#ccc"/>'
    if value is None or lower == upper:
        return ""
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
    return (
        f'<svg class="range" viewBox="0 0 100 10" aria-hidden="true">{box}'
        f'<path d="{bar}" fill="none" stroke="#000" stroke-width="0.9"/>{mark}</svg>'
    )


def _rule(data: dict[str, Any]) -> str:
    has_own_limits = any(not criterion["limits_of_standard"] for criterion in data["criteria"])
    limits = f"Limits of {STANDARDS.get(data['source'], 'the standards')}"
    limits += "; those marked * are the laboratory's own. " if has_own_limits else ". "
    return limits + (
        "U: expanded uncertainty for 95 % (JCGM 100, Student's t). A criterion conforms if "
        "value ± U lies within its limits, does not conform if it lies outside, and is "
        "inconclusive otherwise (JCGM 106). Spread: standard deviation of single drops."
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
    return [*results, _outliers(data["outliers"])] if len(drops) >= MIN_DROPS else results


def _outliers(outliers: Iterable[dict[str, Any]]) -> str:
    names: dict[str, list[str]] = {}
    for outlier in outliers:
        names.setdefault(outlier["name"], []).append(outlier["quantity"].split(",")[0])
    if not names:
        return "no drop differs from the others by more than chance (Grubbs, 5 %)"
    listed = "; ".join(f"{name} ({', '.join(quantities)})" for name, quantities in names.items())
    return f"{_count(len(names), 'outlier')}, marked but not excluded (Grubbs, 5 %): {listed}"


def _messages(data: dict[str, Any], kind: str) -> list[str]:
    messages = {
        key: [(entry["name"], entry[kind]) for entry in data[key]] for key in ("files", "drops")
    }
    return [*data[kind], *group_by_kind(messages)]


def _notes(title: str, messages: Sequence[str]) -> str:
    items = "".join(f"<li>{_text(message)}</li>" for message in shorten(messages, MAX_NOTES))
    return f"<h2>{_text(title)}</h2><ul>{items}</ul>"


def _files(files: Sequence[dict[str, Any]]) -> str:
    names = shorten([_plain(file["name"]) for file in files], MAX_FILES)
    # If there are more files, the last text says how many and has no checksum.
    listed = files if len(files) <= MAX_FILES else files[: MAX_FILES - 1]
    checksums = [file["sha256"] for file in listed]
    return "\n".join(
        f"<tr><td>{_text(name)}</td><td>{checksum}</td></tr>"
        for name, checksum in zip_longest(names, checksums, fillvalue="")
    )


def _count(number_of: int, noun: str) -> str:
    return f"{number_of} {noun}{'s' * (number_of != 1)}"


def _cells(figures: Sequence[Figure]) -> list[str]:
    cells = []
    for i, figure in enumerate(figures):
        with warn_if_not_drawn("a figure of the report"):
            cells.append(f"<td>{_svg(figure, f'f{i}')}</td>")
    return cells


@own_style()
def _svg(figure: Figure, prefix: str) -> str:
    """Return a figure as inline SVG; the prefix makes its identifiers unique on the page."""
    content = io.StringIO()
    figure.savefig(content, format="svg", metadata={"Date": None})
    text = content.getvalue()
    text = re.sub(r"<metadata>.*?</metadata>", "", text[text.index("<svg") :], flags=re.DOTALL)
    text = re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{prefix}-", text)
    box = re.search(r'viewBox="[^"]*"', text)
    assert box  # noqa: S101 - matplotlib writes it
    head = f'<svg class="figure" {box[0]} role="img" preserveAspectRatio="xMidYMax">'
    return head + text[text.index(">") + 1 :]
