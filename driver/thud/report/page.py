"""The page of a calibration report: one sheet of A4 in one file, from its data and its figures."""

from __future__ import annotations

import html
import io
import math
import re
from typing import TYPE_CHECKING, Any

from thud.base.display import left_out
from thud.level.assessment import RESULTS
from thud.plot.style import own_style
from thud.recordings.recorded_levels import BACKGROUND, MARGIN
from thud.report.fonts import FAMILY, clip, count_lines, font_faces, text_width
from thud.report.notes import fit_lines, group_places
from thud.report.rows import HEAD, NOT_KNOWN, criterion_row, limits_of, number, style_of
from thud.report.template import BODY, PAGE

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from matplotlib.figure import Figure

# Sizes of text, pt; width of the page within its margins, of a column, of labels and of
# the verdict, mm.
SIZE = 7.3
WIDTH, COLUMN, LABEL, REASON = 186.0, 91.0, 23.0, 112.0
# Lines of a value, of the instruments, of files, of the blocks of notes and of a note.
VALUE_LINES, INSTRUMENT_LINES, FILES = 2, 6, 5
RESULT_LINES, STEP_LINES, WARNING_LINES = 13, 8, 7
SENTENCE_LINES = 3
# Of two drops, none is an outlier.
MIN_DROPS = 2
STANDARDS = {
    "rubber_ball": "JIS A 1418-2, ISO 10140-5 and ISO 16283-2",
    "tyre": "JIS A 1418-2",
}
# Part of a range that lies within the limits, and its ends.
LOW, HIGH = 25.0, 75.0


def report_page(data: dict[str, Any], figures: Sequence[Figure], checksum: str) -> str:
    """Return the page as self-contained HTML.

    Parameters
    ----------
    data
        What `thud.report.contents.report_data` returns.
    figures
        Two figures of column width, or those of them that can be drawn.
    checksum
        SHA-256 of ``report.json``.
    """
    source = data["source"].replace("_", " ")
    body = BODY.substitute(
        source=_text(source),
        verdict=_text(data["verdict"]),
        reason=_text(_reason(data["criteria"])),
        about=_pairs(_about(data)),
        measured=_pairs(_measured(data)),
        head="".join(f"<th>{_text(name)}</th>" for name in _columns(HEAD, "")),
        rows="\n".join(map(_row, data["criteria"])),
        rule=_text(_rule(data)),
        figures="\n".join(_cells(figures)),
        results=_notes("Drops and methods", _results(data), RESULT_LINES),
        done=_notes("Signal processing", _told(data, "steps") or ["nothing"], STEP_LINES),
        warnings=_notes("Warnings", _told(data, "warnings") or ["none"], WARNING_LINES),
        files=_files(data["files"]),
        footer=_text(f"thud {data['thud']} · report.json: SHA-256 {checksum}"),
    )
    title = f"Calibration report: {data['serial'] or data['name']}"
    used = "".join(sorted(set(html.unescape(re.sub(r"<[^>]*>", "", body)))))
    return PAGE.substitute(
        title=_text(title),
        fonts=font_faces(used),
        family=FAMILY,
        size=SIZE,
        body=body,
    )


def page_text(data: dict[str, Any]) -> str:
    """Return the words that a laboratory chooses, which may need any font."""
    keys = ("laboratory", "ball", "serial", "date", "name")
    files = [one[key] for one in data["files"] for key in ("name", "calibration")]
    return _plain("".join([*(data[key] for key in keys), *data["instruments"], *files]))


def _plain(text: str) -> str:
    """Return a text in one line of printable characters."""
    line = " ".join(text.split())
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in line)


def _text(text: str) -> str:
    """Return a text as HTML."""
    return html.escape(_plain(text))


def _reason(criteria: Sequence[dict[str, Any]]) -> str:
    """Return which criteria are not met."""
    parts = []
    for verdict in RESULTS[1:]:
        names = [style_of(one).title.split(",")[0] for one in criteria if one["verdict"] == verdict]
        if names:
            parts.append(f"{verdict}: {', '.join(names).lower().replace(' hz', ' Hz')}")
    return clip("; ".join(parts), 0.93 * SIZE, REASON, 2) if parts else "all criteria are met"


def _about(data: dict[str, Any]) -> list[tuple[str, str]]:
    """Return what the ball is."""
    temperature = data["temperature"]
    return [
        ("Laboratory", data["laboratory"]),
        ("Ball", data["ball"]),
        ("Serial number", data["serial"]),
        ("Measured on", data["date"]),
        ("Temperature", "" if temperature is None else f"{number(temperature, 1)} °C"),
    ]


def _measured(data: dict[str, Any]) -> list[tuple[str, str]]:
    """Return how it was measured."""
    files, drops = data["files"], len(data["drops"])
    rates = sorted({one["sample_rate"] for one in files})
    listed = " to ".join(dict.fromkeys(f"{rate / 1e3:.4g}" for rate in (rates[0], rates[-1])))
    amount = f"{_count(drops, 'drop')} in {_count(len(files), 'file')}, {listed} kHz"
    ways = list(dict.fromkeys(one["calibration"] for one in files if one["calibration"]))
    share = data["calibration_uncertainty"]
    given = f"u = {100 * share:.2g} %" if share is not None else "uncertainty not given"
    way = f"{ways[0]}{f' and {len(ways) - 1} more' if len(ways) > 1 else ''}" if ways else NOT_KNOWN
    instruments = [clip(_plain(one), SIZE, COLUMN - LABEL) for one in data["instruments"]]
    fitted = fit_lines(instruments, INSTRUMENT_LINES, lambda _: 1)
    return [
        ("Recordings", amount),
        ("Calibration", f"{way}; {given}"),
        ("Instruments", "\n".join(fitted)),
    ]


def _pairs(pairs: Iterable[tuple[str, str]]) -> str:
    """Return labels and values as rows."""
    rows = []
    for label, value in pairs:
        lines = value.split("\n") if "\n" in value else [_clipped(value, VALUE_LINES)]
        shown = "<br>".join(map(_text, lines)) if any(lines) else NOT_KNOWN
        rows.append(f'<tr><th>{_text(label)}</th><td dir="auto">{shown}</td></tr>')
    return "\n".join(rows)


def _clipped(value: str, lines: int) -> str:
    return clip(_plain(value), SIZE, COLUMN - LABEL, lines)


def _columns(row: Sequence[str], picture: str) -> list[str]:
    """Return a row with a picture before the verdict."""
    return [*row[:-1], picture, row[-1]]


def _row(criterion: dict[str, Any]) -> str:
    """Return a criterion as a row of the table."""
    cells = _columns([_text(cell) for cell in criterion_row(criterion)], _range(criterion))
    style = criterion["verdict"].replace(" ", "-")
    return f'<tr class="{style}">' + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>"


def _range(criterion: dict[str, Any]) -> str:
    """Return a picture of the limits, the value and its expanded uncertainty."""
    (lower, upper), value = limits_of(criterion), criterion["value"]
    box = f'<rect x="{LOW}" y="1" width="{HIGH - LOW}" height="8" fill="#ccc"/>'
    if value is None or lower == upper:
        return ""
    scale = (HIGH - LOW) / (upper - lower)
    place = LOW + scale * (value - lower)
    shown = min(max(place, 2.0), 98.0)
    width = scale * (criterion["expanded_uncertainty"] or 0.0)
    ends = [min(max(end, 1.0), 99.0) for end in (place - width, place + width)]
    bar = "".join(f"M{end:.2f} 2.5V7.5" for end in ends) + f"M{ends[0]:.2f} 5H{ends[1]:.2f}"
    bar *= ends[0] < ends[1]
    mark = f'<circle cx="{shown:.2f}" cy="5" r="1.8"/>'
    if shown != place:
        tip = math.copysign(3.0, place - shown)
        mark = f'<path d="M{shown + tip / 2:.2f} 5l{-tip} -3v6z"/>'
    return (
        f'<svg class="range" viewBox="0 0 100 10" aria-hidden="true">{box}'
        f'<path d="{bar}" fill="none" stroke="#000" stroke-width="0.9"/>{mark}</svg>'
    )


def _rule(data: dict[str, Any]) -> str:
    """Return how limits and verdicts are to be read."""
    own = any(not one["limits_of_standard"] for one in data["criteria"])
    limits = f"Limits of {STANDARDS.get(data['source'], 'the standards')}"
    limits += ", those marked * of the laboratory. " if own else ". "
    return limits + (
        "U: expanded uncertainty for 95 % (JCGM 100, Student's t). A criterion conforms where "
        "value ± U lies within its limits, does not conform where it lies outside, and cannot be "
        "decided otherwise (JCGM 106). Spread: standard deviation of single drops."
    )


def _means(drops: Sequence[dict[str, Any]]) -> list[str]:
    """Return sentences on means of the drops that are no criteria."""
    names = {"peak_force": ("peak force below 1.25 kHz", "N", 0), "impulse": ("impulse", "N s", 2)}
    names["effective_mass"] = ("effective mass", "kg", 3)
    means = []
    for key, (title, unit, decimals) in names.items():
        known = [one[key]["value"] for one in drops if one[key]["value"] is not None]
        if known:
            means.append(f"{title} {number(sum(known) / len(known), decimals)} {unit}")
    ways: dict[str, list[float]] = {}
    for one in drops:
        for way, estimate in one["restitutions"].items():
            ways.setdefault(way, []).append(estimate["value"])
    by = [f"by {way} {number(sum(found) / len(found), 3)}" for way, found in ways.items()]
    return [f"mean: {', '.join(means)}", *([f"mean restitution: {', '.join(by)}"] if by else [])]


def _results(data: dict[str, Any]) -> list[str]:
    """Return sentences on drops, other quantities and methods."""
    drops, low, high = data["drops"], *BACKGROUND
    found = _means(drops)
    averaged = "energy average of the drops" if len(drops) > 1 else "of one drop"
    found.append(
        f"levels: {averaged}, method exact (band energy of the contact and at least "
        f"{1e3 * MARGIN:g} ms of silence around it)"
    )
    flags = {one["flag"] for one in data["criteria"]}
    if "corrected" in flags:
        found.append(f"levels {low:g} to {high:g} dB above the background were corrected for it")
    if "background" in flags:
        found.append(f"levels less than {low:g} dB above the background are upper bounds")
    met = [one["sentence"] for one in data["plate"] if one["met"]]
    if met:
        found.append(f"force plate: {'; '.join(met)}")
    bands = [f"{one['band']:g}" for one in data["criteria"] if one["band"] is not None]
    for method, differences in data["method_differences"].items():
        if any(differences):
            values = " / ".join("–" if d is None else number(d, 2) for d in differences)
            found.append(
                f"method {method} differs by up to {values} dB at {bands[0]} to {bands[-1]} Hz"
            )
    return [*found, _outliers(data["outliers"])] if len(drops) > MIN_DROPS else found


def _outliers(outliers: Iterable[dict[str, Any]]) -> str:
    """Return a sentence on the drops that differ from the others."""
    names: dict[str, list[str]] = {}
    for one in outliers:
        names.setdefault(one["name"], []).append(one["quantity"].split(",")[0])
    if not names:
        return "no drop differs from the others by more than chance (Grubbs, 5 %)"
    listed = "; ".join(f"{name} ({', '.join(what)})" for name, what in names.items())
    return f"{_count(len(names), 'outlier')}, marked and not left out (Grubbs, 5 %): {listed}"


def _told(data: dict[str, Any], kind: str) -> list[str]:
    """Return the steps or warnings of all, of files and of drops; those of several as one."""
    places = {key: [(one["name"], one[kind]) for one in data[key]] for key in ("files", "drops")}
    return [*data[kind], *group_places(places)]


def _notes(title: str, sentences: Sequence[str], lines: int) -> str:
    """Return sentences as a list that takes a limited number of lines."""
    width = COLUMN - 5.0
    clipped = [clip(_plain(one), SIZE, width, SENTENCE_LINES) for one in sentences]
    fitted = fit_lines(clipped, lines, lambda one: count_lines(one, SIZE, width))
    items = "".join(f"<li>{_text(one)}</li>" for one in fitted)
    return f"<h2>{_text(title)}</h2><ul>{items}</ul>"


def _files(files: Sequence[dict[str, Any]]) -> str:
    """Return the names and checksums of the files, those that fit."""
    shown = files if len(files) <= FILES else files[: FILES - 1]
    room = WIDTH - text_width("0" * 66, SIZE)
    rows = [
        f"<tr><td>{_text(clip(_plain(one['name']), SIZE, room))}</td>"
        f"<td>{_text(one['sha256'])}</td></tr>"
        for one in shown
    ]
    if len(shown) < len(files):
        rest = f"and {_count(len(files) - len(shown), 'file')} more, in report.json"
        rows.append(f"<tr><td>{_text(rest)}</td><td></td></tr>")
    return "\n".join(rows)


def _count(number_of: int, what: str) -> str:
    return f"{number_of} {what}{'s' * (number_of != 1)}"


def _cells(figures: Sequence[Figure]) -> list[str]:
    """Return the cells of the figures that can be drawn."""
    cells = []
    for i, figure in enumerate(figures):
        with left_out("a figure of the report"):
            cells.append(f"<td>{_svg(figure, f'f{i}')}</td>")
    return cells


@own_style()
def _svg(figure: Figure, prefix: str) -> str:
    """Return a figure as a part of a page, its names with a prefix."""
    content = io.StringIO()
    figure.savefig(content, format="svg", metadata={"Date": None})
    text = content.getvalue()
    text = re.sub(r"<metadata>.*?</metadata>", "", text[text.index("<svg") :], flags=re.DOTALL)
    text = re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{prefix}-", text)
    box = re.search(r'viewBox="[^"]*"', text)
    assert box  # noqa: S101 - matplotlib writes it
    head = f'<svg class="figure" {box[0]} role="img" preserveAspectRatio="xMidYMax">'
    return head + text[text.index(">") + 1 :]
