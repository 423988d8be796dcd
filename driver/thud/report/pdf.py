"""A report as PDF, from its HTML."""

from __future__ import annotations

import ctypes
import logging

NEEDED = (
    "pip install weasyprint, and Debian's libpango-1.0-0, libpangoft2-1.0-0 and "
    "libharfbuzz-subset0, or print report.html with a browser"
)
# What WeasyPrint loads.
LIBRARIES = (
    "libgobject-2.0.so.0",
    "libpango-1.0.so.0",
    "libharfbuzz.so.0",
    "libfontconfig.so.1",
    "libpangoft2-1.0.so.0",
)


def html_to_pdf(page: str) -> bytes:
    """Return a page as PDF; nothing but what the page holds is read.

    Raises
    ------
    ImportError
        Where WeasyPrint or a library that it needs is missing.
    """
    try:
        # WeasyPrint prints where one is missing.
        for library in LIBRARIES:
            ctypes.CDLL(library)
        from weasyprint import HTML
        from weasyprint.urls import URLFetcher
    except OSError as error:
        raise ImportError(str(error)) from error
    # Fonts have tables that it does not use, and says so.
    logging.getLogger("fontTools").setLevel(logging.ERROR)
    fetcher = URLFetcher(allowed_protocols=("data",))
    content: bytes = HTML(string=page, url_fetcher=fetcher).write_pdf()
    return content
