"""Write the calibration report of a recording: a page to be signed, and its data."""

from __future__ import annotations

import hashlib
import json
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

from thud.errors import ReportWarning
from thud.files import replace_file

if TYPE_CHECKING:
    import os

    from thud.recordings.recording import Recording


def write_report(recording: Recording, directory: str | os.PathLike[str]) -> list[Path]:
    """Write ``report.json``, ``report.html`` and ``report.pdf`` and return their paths.

    The page is one sheet of A4; lists that are too long for it are complete in ``report.json``.

    Parameters
    ----------
    recording
        The recording.
    directory
        Directory of the files; it is made where there is none.

    Raises
    ------
    OSError
        Where a file cannot be written.

    Warns
    -----
    ReportWarning
        Where WeasyPrint is missing, so that there is no PDF, or a font for some letters.
    """
    # Matplotlib, SciPy and fontTools take their time.
    from thud.plot.recording import recording_forces, recording_levels  # noqa: PLC0415
    from thud.report.data import report_data  # noqa: PLC0415
    from thud.report.fonts import missing_characters  # noqa: PLC0415
    from thud.report.page import page_text, report_page  # noqa: PLC0415
    from thud.report.pdf import NEEDED, html_to_pdf  # noqa: PLC0415

    folder = Path(directory)
    folder.mkdir(parents=True, exist_ok=True)
    data = report_data(recording)
    machine = (json.dumps(data, indent=1, allow_nan=False) + "\n").encode()
    figures = [recording_forces(recording), recording_levels(recording)]
    page = report_page(data, figures, hashlib.sha256(machine).hexdigest())
    contents = {"report.json": machine, "report.html": page.encode()}
    try:
        contents["report.pdf"] = html_to_pdf(page)
    except ImportError as error:
        # One of an earlier report is not of this recording.
        (folder / "report.pdf").unlink(missing_ok=True)
        cause = " ".join(str(error).split())
        message = f"{folder}: report.pdf is not written ({cause}); allowed: {NEEDED}"
        warnings.warn(message, ReportWarning, stacklevel=2)
    else:
        missing = missing_characters(page_text(data))
        if missing:
            message = (
                f"{folder}: no installed font has {missing}, of the names in report.pdf; allowed: "
                "a font that has them, such as that of Debian's fonts-noto-cjk"
            )
            warnings.warn(message, ReportWarning, stacklevel=2)
    for name, content in contents.items():
        replace_file(folder / name, content)
    return [folder / name for name in contents]
