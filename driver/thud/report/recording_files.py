"""Texts for the screen and files of a measured recording: its tables, page and data."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from thud.base._schema import VERDICTS
from thud.base.bridge import version
from thud.base.checks import refuse, require_kind, shown_text
from thud.base.display import draw_all, warn_if_not_drawn
from thud.base.files import Results
from thud.base.tables import csv_text
from thud.level.levels import BANDWIDTHS, get_bands
from thud.recordings.recording import Recording
from thud.report.contents import criterion_members, json_bytes, report_data
from thud.report.rows import HEAD, criterion_row, reason_text

if TYPE_CHECKING:
    import os
    from collections.abc import Sequence

    from thud.recordings.measured_drop import Stages
    from thud.report.contents import ReportCriterion, ReportData

# Columns of the page that the printed table has.
_SHOWN = ("Criterion", "Value", "U (95 %)", "Limits", "Margin", "Verdict")
LEVELS, CRITERIA, JSON = "levels.csv", "criteria.csv", "report.json"
HTML, PDF, STAGES = "report.html", "report.pdf", "stages"
# Names of the figures of the page.
FIGURES: tuple[Literal["force", "levels"], ...] = ("force", "levels")
# Formats and maximum size of the accreditation mark, bytes.
PICTURES = {".svg": "image/svg+xml", ".png": "image/png", ".jpg": "image/jpeg"}
MAX_PICTURE = 300_000


def table(criteria: Sequence[ReportCriterion]) -> list[tuple[str, ...]]:
    """Return the criteria of a report as rows of text, without the columns of the page alone."""
    shown = [i for i, title in enumerate(HEAD) if title in _SHOWN]
    return [tuple(row[i] for i in shown) for row in (HEAD, *map(criterion_row, criteria))]


def verdict_text(data: ReportData) -> str:
    """Return the verdict of a report with its reason and a note on own limits."""
    verdict = data.verdict.conforms
    is_undecided = verdict == VERDICTS[2]
    subject, relation = ("The result is", "by") if is_undecided else ("The source", "to")
    limits = f"the limits of the {data.verdict.source.replace('_', ' ')}"
    has_own_limits = any(entry.has_own_limits for entry in data.criteria)
    note = " Limits marked * are those of the laboratory." if has_own_limits else ""
    result = f"{subject} {verdict} {relation} {limits} at 95 %"
    return f"{result}: {reason_text(data.criteria)}.{note}"


def levels_csv(recording: Recording) -> str:
    """Return the levels in all bands, with uncertainties and background, as CSV."""
    head = (
        "bandwidth", "nominal_Hz", "level_dB", "standard_uncertainty_dB", "expanded_dB",
        "background_dB", "spread_dB", "flag",
    )  # fmt: skip
    rows: list[Sequence[object]] = [head]
    for bands in BANDWIDTHS:
        average = recording.average(bands)
        columns = (
            get_bands(bands).nominal, average.level, [e.uncertainty for e in average.estimates],
            [e.expanded for e in average.estimates], average.background, average.spread,
        )  # fmt: skip
        cells = [
            [v if math.isfinite(v) else None for v in map(float, values)] for values in columns
        ]
        rows += [(bands, *row) for row in zip(*cells, average.flag, strict=True)]
    return csv_text(rows)


def criteria_csv(data: ReportData) -> str:
    """Return value, uncertainty, limits and verdict of each criterion of a report as CSV."""
    members = [criterion_members(entry) for entry in data.criteria]
    keys = [key for key, value in members[0].items() if not isinstance(value, list)]
    rows = [[row[key] for key in keys] for row in members]
    comment = f"# thud {version()}; SI units, levels in dB re 1 N, 1 s; uncertainties for 95 %\n"
    return comment + csv_text([keys, *rows])


def file_names(*, figures: bool = True, stages: bool = False) -> list[str]:
    """Return the names of the files that `save` writes."""
    page = [HTML, PDF, *(f"{name}.svg" for name in FIGURES)] if figures else []
    return [LEVELS, CRITERIA, JSON, *page, *([f"{STAGES}.svg"] if stages else [])]


def write_report(
    recording: Recording, directory: str | os.PathLike[str], *, replace: bool = False
) -> list[Path]:
    """Write the calibration report of a recording, its tables and figures; return their paths.

    The page, ``report.html`` and ``report.pdf``, is printed on sheets of A4; very long lists are
    complete in ``report.json`` only.

    Parameters
    ----------
    recording
        Measured recording.
    directory
        Directory for the files; replaced as a whole if it holds an earlier report.
    replace
        Whether to replace results of something else.

    Raises
    ------
    InputError
        If the directory holds a file that is not replaced.
    OSError
        If a file cannot be written.

    Warns
    -----
    ReportWarning
        If a file is not written because an extra is missing, or a font is missing.
    """
    require_kind("recording", recording, Recording)
    results = Results(Path(directory), "measure", replace=replace)
    return save(report_data(recording), results)


def save(
    data: ReportData, results: Results, *, figures: bool = True, stages: Stages | None = None
) -> list[Path]:
    """Write levels, criteria and data; with `figures` also the figures and the page.

    `data` is the result of `report_data`. With the stages of a drop, they are drawn too. For
    errors and warnings see `write_report`.
    """
    contents = {
        LEVELS: levels_csv(data.recording).encode(),
        CRITERIA: criteria_csv(data).encode(),
        JSON: json_bytes(data),
    }
    if figures and (drawings := draw_figures(data.recording)) is not None:
        contents |= page_contents(data, drawings, results.folder) | drawings
    if stages:
        from thud.plot.save_figures import figure_files

        contents |= figure_files({STAGES: stages.plot()})
    return results.write(contents)


def draw_figures(recording: Recording) -> dict[str, bytes] | None:
    """Return the figures of a recording as SVG, by file name; warn of those not drawn.

    None if matplotlib cannot be imported, without which there is no page.
    """
    # A damaged matplotlib, which is slow to import, leaves levels and data as they are.
    with warn_if_not_drawn(HTML):
        from thud.plot.save_figures import figure_files

        draws = draw_all({name: partial(recording.plot, kind=name) for name in FIGURES})
        return figure_files(draws)
    return None


def page_contents(data: ReportData, drawings: dict[str, bytes], folder: Path) -> dict[str, bytes]:
    """Return the page as HTML and, if possible, PDF, by file name.

    `drawings` are the figures as SVG. Warn if there is no PDF, or no font for some characters;
    `folder` is named in the warning.
    """
    from thud.report.page import report_page
    from thud.report.pdf import pdf_file

    mark = data.recording.config.report.accreditation_mark
    page = report_page(data, drawings.values(), read_picture(Path(mark)) if mark else None)
    return {HTML: page.encode(), **pdf_file(page, PDF, folder)}


def read_picture(path: Path) -> tuple[str, bytes]:
    """Return media type and content of a picture; raise InputError if it cannot be used."""
    kind = PICTURES.get(path.suffix.lower().replace(".jpeg", ".jpg"))
    allowed = f"{', '.join(PICTURES)} up to {MAX_PICTURE // 1000} kB"
    problem = f"report: accreditation_mark = {shown_text(path)} cannot be used"
    try:
        content = path.read_bytes() if kind and path.stat().st_size <= MAX_PICTURE else b""
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or shown_text(error)
        refuse(f"{problem} ({reason})", allowed, error)
    if not kind or not content:
        refuse(f"{problem} ({'too large or empty' if kind else 'no picture'})", allowed)
    return kind, content
