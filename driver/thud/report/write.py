"""Write the calibration report of a recording: a page to sign, and its data."""

from __future__ import annotations

import hashlib
import json
import warnings
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from thud.base.checks import refuse, require_kind, shown_text
from thud.base.display import draw_all
from thud.base.errors import ReportWarning
from thud.base.files import Results, read_input

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping

    from thud.recordings.recording import Recording

JSON, HTML, PDF = "report.json", "report.html", "report.pdf"
# Formats and maximum size of the accreditation mark, bytes.
PICTURES = {".svg": "image/svg+xml", ".png": "image/png", ".jpg": "image/jpeg"}
MAX_PICTURE = 300_000


def write_report(
    recording: Recording, directory: str | os.PathLike[str], *, replace: bool = False
) -> list[Path]:
    """Write ``report.json``, ``report.html`` and ``report.pdf`` and return their paths.

    The page is printed on sheets of A4; very long lists are complete in ``report.json`` only.

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
        If WeasyPrint (needed for the PDF) or a font is missing, or the report of another recording
        is replaced.
    """
    # SciPy is slow to import.
    from thud.recordings.recording import Recording
    from thud.report.contents import report_data

    require_kind("recording", recording, Recording)
    folder, data = Path(directory), report_data(recording)
    contents = {
        JSON: json_bytes(data),
        **page_contents(recording, data, figures(recording), folder),
    }
    return write_files(Results(folder, "measure", replace=replace), data, contents)


def json_bytes(data: dict[str, Any]) -> bytes:
    """Return the content of ``report.json``."""
    return (json.dumps(data, indent=1, allow_nan=False) + "\n").encode()


def figures(recording: Recording) -> dict[str, bytes]:
    """Return the figures of a recording as SVG, by file name; warn of those not drawn."""
    # Matplotlib is slow to import.
    from thud.plot.save_figures import figure_files

    drawn = draw_all({name: partial(recording.plot, name) for name in ("force", "levels")})
    return figure_files(drawn)


def page_contents(
    recording: Recording, data: dict[str, Any], drawings: Mapping[str, bytes], folder: Path
) -> dict[str, bytes]:
    """Return the page as HTML and, if possible, PDF, by file name.

    `drawings` are the figures as SVG. Warn if there is no PDF, or no font for some characters;
    `folder` is named in the warning.
    """
    from thud.report.page import laboratory_text, report_page
    from thud.report.pdf import pdf_file

    mark = recording.config.report.accreditation_mark
    page = report_page(
        data,
        [content.decode() for content in drawings.values()],
        hashlib.sha256(json_bytes(data)).hexdigest(),
        read_picture(Path(mark)) if mark else None,
    )
    return {HTML: page.encode(), **pdf_file(page, PDF, folder, laboratory_text(data))}


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


def write_files(
    results: Results, data: dict[str, Any], contents: Mapping[str, bytes]
) -> list[Path]:
    """Write the files of a recording; warn if they replace those of another one."""
    earlier = _earlier(results.folder)
    paths = results.write(contents)
    if earlier is not None and earlier != _checksums(data):
        message = f"{results.folder}: replaces the results of another recording"
        warnings.warn(message, ReportWarning, stacklevel=3)
    return paths


def _checksums(data: dict[str, Any]) -> list[str]:
    return [file["sha256"] for file in data["files"]]


def _earlier(folder: Path) -> list[str] | None:
    from thud.report.contents import FORMAT

    try:
        data = json.loads(read_input(folder / JSON))
        return _checksums(data) if data["format"] == FORMAT else None
    except (OSError, ValueError, RecursionError, KeyError, TypeError):
        return None
