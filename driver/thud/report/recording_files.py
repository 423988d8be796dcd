"""Tables and result files of a measured recording."""

from __future__ import annotations

import math
import warnings
from typing import TYPE_CHECKING, Any

from thud.base._schema import VERDICTS
from thud.base.bridge import version
from thud.base.display import warn_if_not_drawn
from thud.base.errors import InputError, ReportWarning
from thud.base.extras import require_extra
from thud.base.tables import csv_text, marked
from thud.level.estimate import UNKNOWN, Estimate
from thud.level.levels import get_bands
from thud.report import write
from thud.report.contents import report_data
from thud.report.rows import HEAD, NOT_KNOWN, criterion_row
from thud.report.write import HTML, JSON, PDF, json_bytes, page_contents, write_files

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from thud.base.files import Results
    from thud.recordings.read_recording import Stages
    from thud.recordings.recording import Recording

# Columns of the page that the printed table has.
_SHOWN = ("Criterion", "Value", "U (95 %)", "Limits", "Margin", "Verdict")
# Verdicts of several criteria.
_PLURALS = {VERDICTS[0]: "conform", VERDICTS[1]: "do not conform"}
DATASET = "recording.nc"
_PAGE = (HTML, PDF, "force.svg", "levels.svg")
STAGES = "stages"


def drop_table(recording: Recording) -> list[tuple[str, ...]]:
    """Return a row of text for each drop: first touch, contact, restitutions, peak and levels.

    The number after ± is the standard uncertainty due to the noise of the drop.
    """
    nominal = get_bands().nominal
    levels = recording.average().drops.level
    methods = dict.fromkeys(method for drop in recording.drops for method in drop.restitutions)
    restitutions = [f"restitution by {method} (± u)" for method in methods] or ["restitution"]
    head = ("drop", "at, s", "contact, ms (± u)", *restitutions, "peak, N")
    rows: list[tuple[str, ...]] = [(*head, *(f"{f:g} Hz, dB" for f in nominal))]
    rows += [
        (
            drop.name,
            f"{drop.onset:.3f}",
            _with_u(drop.contact_time, 1e-3, 2),
            *(_with_u(drop.restitutions.get(m, UNKNOWN), 1.0, 3) for m in methods or [""]),
            f"{drop.peak_force.value:.0f}",
            *(f"{level:z.2f}" for level in levels[i]),
        )
        for i, drop in enumerate(recording.drops)
    ]
    return rows


def table(criteria: Sequence[dict[str, Any]]) -> list[tuple[str, ...]]:
    """Return the criteria of a report as rows of text, without the columns of the page alone."""
    shown = [i for i, title in enumerate(HEAD) if title in _SHOWN]
    return [tuple(row[i] for i in shown) for row in (HEAD, *map(criterion_row, criteria))]


def _with_u(estimate: Estimate, unit: float, decimals: int) -> str:
    if math.isnan(estimate.value):
        return NOT_KNOWN
    return f"{estimate.value / unit:.{decimals}f} ± {estimate.uncertainty / unit:.{decimals + 1}f}"


def verdict_text(recording: Recording, criteria: Sequence[dict[str, Any]]) -> str:
    """Return the verdict, marked, as a sentence with a note on limits of the laboratory."""
    assessment = recording.assess()
    is_undecided = assessment.conforms == VERDICTS[2]
    subject, relation = ("The result is", "by") if is_undecided else ("The source", "to")
    verdict = marked(assessment.conforms, assessment.conforms)
    limits = f"the limits of the {assessment.source.replace('_', ' ')}"
    has_own_limits = any(not criterion["limits_of_standard"] for criterion in criteria)
    note = " Limits marked * are those of the laboratory." if has_own_limits else ""
    counts = count_verdicts(criterion.conforms for criterion in assessment.criteria)
    return f"{subject} {verdict} {relation} {limits} at 95 %: {counts}.{note}"


def count_verdicts(results: Iterable[str]) -> str:
    """Return a text with the number of criteria for each verdict.

    >>> count_verdicts(["conforms", "conforms", "does not conform"])
    '2 criteria conform, 1 does not conform'
    """
    listed = list(results)
    counts = {verdict: listed.count(verdict) for verdict in VERDICTS if verdict in listed}
    parts: list[str] = []
    for verdict, count in counts.items():
        noun = "" if parts else " criterion" if count == 1 else " criteria"
        parts.append(f"{count}{noun} {verdict if count == 1 else _PLURALS.get(verdict, verdict)}")
    return ", ".join(parts)


def levels_csv(data: dict[str, Any]) -> str:
    """Return the levels of a report in all bands, with uncertainties and background, as CSV."""
    head = (
        "bandwidth nominal_Hz level_dB standard_uncertainty_dB expanded_dB background_dB spread_dB "
        "flag"
    )
    keys = ("level", "uncertainty", "expanded_uncertainty", "background", "spread", "flag")
    rows = [
        [bands, f"{nominal:g}", *(levels[key][i] for key in keys)]
        for bands, levels in data["levels"].items()
        for i, nominal in enumerate(levels["band"])
    ]
    return csv_text([head.split(), *rows])


def criteria_csv(data: dict[str, Any]) -> str:
    """Return value, uncertainty, limits and verdict of each criterion of a report as CSV."""
    keys = ("expanded_uncertainty", "lower", "upper", "margin", "verdict")
    rows = [
        [
            criterion["name"],
            criterion["unit"],
            criterion["value"],
            str(criterion["upper_bound"]).lower(),
            *(criterion[key] for key in keys),
        ]
        for criterion in data["criteria"]
    ]
    head = "criterion unit value upper_bound uncertainty lower upper margin verdict"
    comment = f"# thud {version()}; SI units, levels in dB re 1 N; uncertainty expanded, 95 %\n"
    return comment + csv_text([head.split(), *rows])


def file_names(*, figures: bool = True, stages: bool = False) -> list[str]:
    """Return the names of the files that `save` writes."""
    drawn = (*(_PAGE if figures else ()), *([f"{STAGES}.svg"] if stages else ()))
    return ["levels.csv", "criteria.csv", JSON, DATASET, *drawn]


def save(
    recording: Recording, results: Results, *, figures: bool = True, stages: Stages | None = None
) -> None:
    """Write levels, criteria and data; with `figures` also the figures and the page.

    With the stages of a drop, they are drawn too.

    The directory of the results is replaced as a whole.

    Raises
    ------
    InputError
        If the directory holds a file that is not replaced.
    OSError
        If a file cannot be written.

    Warns
    -----
    ReportWarning
        If a file is not written, or the results of another recording are replaced.
    """
    data = report_data(recording)
    contents = {
        "levels.csv": levels_csv(data).encode(),
        "criteria.csv": criteria_csv(data).encode(),
        JSON: json_bytes(data),
        **_dataset(data, results.folder),
    }
    if figures and _has_matplotlib():
        drawings = write.figures(recording)
        contents |= page_contents(recording, data, drawings, results.folder) | drawings
    if stages and _has_matplotlib():
        from thud.plot.save_figures import figure_files

        contents |= figure_files({STAGES: stages.plot()})
    write_files(results, data, contents)


def _has_matplotlib() -> bool:
    with warn_if_not_drawn("the page"):
        import matplotlib as mpl

        return bool(mpl.__version__)
    return False


def _dataset(data: dict[str, Any], folder: Path) -> dict[str, bytes]:
    try:
        with require_extra("studies"):
            from thud.report.netcdf import netcdf
    except InputError as error:
        message = f"{folder}: {DATASET} is not written: {error}"
        warnings.warn(message, ReportWarning, stacklevel=3)
        return {}
    return {DATASET: netcdf(data)}
