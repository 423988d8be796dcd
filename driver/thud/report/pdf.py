"""A report as PDF, from its HTML."""

from __future__ import annotations

import logging

NEEDED = (
    "pip install weasyprint, and Debian's libpango-1.0-0, libpangoft2-1.0-0 and "
    "libharfbuzz-subset0, or print report.html with a browser"
)


def html_to_pdf(page: str) -> bytes:
    """Return a page as PDF, without access to other files.

    Raise ImportError if WeasyPrint or a library that it needs is missing.
    """
    try:
        from weasyprint import HTML
        from weasyprint.urls import URLFetcher
    except OSError as error:
        raise ImportError(str(error)) from error
    # fontTools logs each font table that it does not use.
    logging.getLogger("fontTools").setLevel(logging.ERROR)
    fetcher = URLFetcher(allowed_protocols=("data",))
    content: bytes = HTML(string=page, url_fetcher=fetcher).write_pdf()
    return content
