"""A report as PDF, from its HTML, with the font that comes with matplotlib."""

from __future__ import annotations

import logging
import warnings
from pathlib import Path

import matplotlib as mpl
from matplotlib import font_manager, ft2font

from thud.base.errors import ReportWarning
from thud.plot.templates import FAMILY

FILES = {"normal": "DejaVuSans.ttf", "bold": "DejaVuSans-Bold.ttf"}
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


def pdf_file(page: str, name: str, folder: Path) -> dict[str, bytes]:
    """Return a page as PDF by the name of its file; empty, with a warning, without WeasyPrint.

    Warn also if no font has some of its characters; `folder` is named in the warnings.
    """
    try:
        content = html_to_pdf(page)
    except ImportError as error:
        cause = " ".join(str(error).split())
        message = f"{folder}: {name} is not written ({cause}); allowed: {NEEDED}"
        warnings.warn(message, ReportWarning, stacklevel=3)
        return {}
    missing = missing_characters(page)
    if missing:
        message = (
            f"{folder}: no installed font has {missing}, used in {name}; allowed: "
            "a font that has them, such as that of Debian's fonts-noto-cjk"
        )
        warnings.warn(message, ReportWarning, stacklevel=3)
    return {name: content}


def font_faces() -> str:
    """Return CSS that names the files of the font, normal and bold."""
    return "\n".join(
        f"@font-face {{ font-family: '{FAMILY}'; font-weight: {weight}; "
        f"src: url({_path(weight).as_uri()}); }}"
        for weight in FILES
    )


def missing_characters(text: str) -> str:
    """Return the characters of a text that no installed font has."""
    missing = {c for c in text if c.isprintable() and not c.isspace()}
    missing -= _characters(_path("normal"))
    for path in font_manager.findSystemFonts() if missing else ():
        try:
            missing -= _characters(path)
        except (OSError, RuntimeError):
            continue
    return "".join(c for c in dict.fromkeys(text) if c in missing)


def _characters(path: str | Path) -> set[str]:
    return set(map(chr, ft2font.FT2Font(path).get_charmap()))


def _path(weight: str) -> Path:
    return Path(mpl.get_data_path(), "fonts", "ttf", FILES[weight]).resolve()
