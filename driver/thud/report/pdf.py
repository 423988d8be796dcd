"""A report as PDF, from its HTML."""

from __future__ import annotations

import contextlib
import io
import logging

NEEDED = (
    "pip install weasyprint, and Debian's libpango-1.0-0, libpangoft2-1.0-0 and "
    "libharfbuzz-subset0, or print report.html with a browser"
)


def html_to_pdf(page: str) -> bytes:
    """Return a page as PDF; nothing but what the page holds is read.

    Raises
    ------
    ImportError
        Where WeasyPrint or a library that it needs is missing.
    """
    try:
        # It prints where a library is missing.
        with contextlib.redirect_stdout(io.StringIO()):
            from weasyprint import HTML  # noqa: PLC0415 - optional
            from weasyprint.urls import URLFetcher  # noqa: PLC0415
    except OSError as error:
        raise ImportError(str(error)) from error
    # Fonts have tables that it does not use, and says so.
    logging.getLogger("fontTools").setLevel(logging.ERROR)
    fetcher = URLFetcher(allowed_protocols=("data",))
    content: bytes = HTML(string=page, url_fetcher=fetcher).write_pdf()
    return content
