"""Files of predicted floors: every number as CSV and workbook, and a page for each floor."""

from __future__ import annotations

import io
from functools import partial
from importlib.util import find_spec
from typing import TYPE_CHECKING

from thud.base._schema import RATED_BANDS
from thud.base.bridge import version
from thud.base.display import draw_all
from thud.base.tables import csv_text
from thud.floors.description import CAVEAT, source_note, verdict_text
from thud.report.predicted_floor import tables

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence
    from pathlib import Path

    from thud.report.predicted_floor import PredictedFloor

WORKBOOK = "predictions.xlsx"
# Maximum width of its columns, characters.
_MAX_WIDTH = 60
# Tables that are files too, not only sheets of the workbook; the last is part of the report.
_TABLES = ("bands", "octaves", "ratings", "contributions", "paths", "modes", "changes")


def screen_text(floor: PredictedFloor) -> str:
    """Return the ratings of a floor, and what makes them uncertain, as lines."""
    prediction, verdict = floor.prediction, floor.prediction.verdict
    (title, _, _, text), *others = floor.ratings
    octaves = zip(RATED_BANDS["octave"], prediction.octave_level, strict=True)
    lines = [
        floor.name,
        f"  {title}: {', '.join(filter(None, (text, source_note(prediction))))}",
        *([f"  {verdict_text(prediction)}"] if verdict else []),
        f"  {CAVEAT.capitalize()}",
        *(f"    {title}: {text}" for title, _, _, text in others),
        f"    Octaves: {', '.join(f'{level:.1f} dB at {f:g} Hz' for f, level in octaves)}",
        *([f"  A-weighted energy by path: {floor.path_shares}"] if len(floor.paths) > 1 else []),
        "  Contributions to the standard uncertainty, dB:",
        *(f"    {value:.1f}  {name}" for name, value in floor.contributions.items()),
    ]
    return "\n".join(lines)


def file_names(files: Iterable[str], *, report: bool = True) -> list[str]:
    """Return the names of the files that `contents` may have; `files` are those of floors."""
    if not report:
        return [*(f"{name}.csv" for name in _TABLES[:-1]), WORKBOOK]
    pages = [f"{file}{ending}" for file in files for ending in (".html", ".pdf")]
    return [*(f"{name}.csv" for name in _TABLES), WORKBOOK, *pages]


def contents(floors: Sequence[PredictedFloor], folder: Path, *, report: bool) -> dict[str, bytes]:
    """Return the contents of files by name; with `report` also a page for each floor.

    The workbook needs openpyxl. Warn if a page cannot be drawn or printed; `folder` is named in the
    warning.
    """
    rows = tables(floors, changes=report)
    result = {f"{name}.csv": _csv(table) for name, table in rows.items() if name in _TABLES}
    if find_spec("openpyxl"):
        result[WORKBOOK] = _workbook(rows)
    if report:
        for floor in floors:
            result |= page_contents(floor, folder)
    return result


def page_contents(floor: PredictedFloor, folder: Path) -> dict[str, bytes]:
    """Return the page of a floor as HTML and, if possible, PDF, by file name."""
    # Matplotlib is slow to import.
    from thud.plot.floor_figures import draw_section
    from thud.plot.room_figures import draw_levels
    from thud.plot.save_figures import figure_files
    from thud.report.floor_page import floor_page
    from thud.report.pdf import pdf_file

    figures = figure_files(
        draw_all({
            "section": partial(draw_section, floor.layers),
            "levels": partial(draw_levels, floor.prediction),
        })
    )  # fmt: skip
    section, levels = (figures.get(f"{name}.svg", b"") for name in ("section", "levels"))
    page = floor_page(floor, section, levels)
    printed = pdf_file(page, f"{floor.file}.pdf", folder)
    return {f"{floor.file}.html": page.encode(), **printed}


def _csv(rows: Iterable[Iterable[object]]) -> bytes:
    comment = f"# thud {version()}; levels in the room in dB re 20 uPa\n"
    return (comment + csv_text(rows)).encode()


def _workbook(sheets: Mapping[str, Iterable[Sequence[str | float]]]) -> bytes:
    """Return a workbook of tables by the names of their sheets, each with a header row."""
    import openpyxl

    book = openpyxl.Workbook()
    book.remove(book.active)
    for name, rows in sheets.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(list(row))
            for cell in sheet[sheet.max_row]:
                # A text that begins with an equals sign is no formula.
                if isinstance(cell.value, str):
                    cell.data_type = "s"
        sheet.freeze_panes = "B2"
        for column in sheet.columns:
            values = (cell.value for cell in column)
            shown = (f"{v:.9g}" if isinstance(v, float) else str(v) for v in values)
            width = min(max(map(len, shown)) + 2, _MAX_WIDTH)
            sheet.column_dimensions[column[0].column_letter].width = width
    content = io.BytesIO()
    book.save(content)
    return content.getvalue()
