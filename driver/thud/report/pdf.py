"""A report as PDF, from its HTML."""

from __future__ import annotations

import logging
import warnings
from typing import TYPE_CHECKING

from thud.base.errors import ReportWarning
from thud.report.fonts import font_faces, missing_characters

if TYPE_CHECKING:
    from pathlib import Path

NEEDED = (
    "pip install weasyprint, and Debian's libpango-1.0-0, libpangoft2-1.0-0 and "
    "libharfbuzz-subset0, or print the HTML with a browser"
)


def html_to_pdf(page: str) -> bytes:
    """Return a page as PDF, without access to files other than its font.

    Raise ImportError if WeasyPrint or a library that it needs is missing.
    """
    try:
        from weasyprint import CSS, HTML
        from weasyprint.text.fonts import FontConfiguration
        from weasyprint.urls import URLFetcher
    except OSError as error:
        raise ImportError(str(error)) from error
    # fontTools logs each font table that it does not use.
    logging.getLogger("fontTools").setLevel(logging.ERROR)
    fonts = FontConfiguration()
    files = URLFetcher(allowed_protocols=("file",))
    style = CSS(string=font_faces(), url_fetcher=files, font_config=fonts)
    document = HTML(string=page, url_fetcher=URLFetcher(allowed_protocols=("data",)))
    content: bytes = document.write_pdf(stylesheets=[style], font_config=fonts)
    return content


def pdf_file(page: str, name: str, folder: Path, texts: str) -> dict[str, bytes]:
    """Return a page as PDF by the name of its file; empty, with a warning, without WeasyPrint.

    Warn also if no font has some characters of `texts`; `folder` is named in the warnings.
    """
    try:
        content = html_to_pdf(page)
    except ImportError as error:
        cause = " ".join(str(error).split())
        message = f"{folder}: {name} is not written ({cause}); allowed: {NEEDED}"
        warnings.warn(message, ReportWarning, stacklevel=3)
        return {}
    missing = missing_characters(texts)
    if missing:
        message = (
            f"{folder}: no installed font has {missing}, used in {name}; allowed: "
            "a font that has them, such as that of Debian's fonts-noto-cjk"
        )
        warnings.warn(message, ReportWarning, stacklevel=3)
    return {name: content}
