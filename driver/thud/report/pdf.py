"""A report as PDF, from its HTML."""

from __future__ import annotations

import logging

from thud.report.fonts import font_faces

NEEDED = (
    "pip install weasyprint, and Debian's libpango-1.0-0, libpangoft2-1.0-0 and "
    "libharfbuzz-subset0, or print report.html with a browser"
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
