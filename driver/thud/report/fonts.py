"""The font of reports, embedded so that a report looks the same everywhere."""

from __future__ import annotations

import base64
import io
from pathlib import Path

import matplotlib as mpl
from fontTools.subset import Options, Subsetter
from fontTools.ttLib import TTFont
from matplotlib import font_manager, ft2font

# The font of figures, which comes with matplotlib.
FAMILY = "DejaVu Sans"
FILES = {"normal": "DejaVuSans.ttf", "bold": "DejaVuSans-Bold.ttf"}


def font_faces(text: str) -> str:
    """Return CSS that embeds the characters of a text, in the normal and the bold font."""
    return "\n".join(
        f"@font-face {{ font-family: '{FAMILY}'; font-weight: {weight}; "
        f"src: url(data:font/woff;base64,{_subset(weight, text)}) format('woff'); }}"
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
    return "".join(sorted(missing))


def _characters(path: str | Path) -> set[str]:
    return set(map(chr, ft2font.FT2Font(path).get_charmap()))


def _path(weight: str) -> Path:
    return Path(mpl.get_data_path(), "fonts", "ttf", FILES[weight])


def _subset(weight: str, text: str) -> str:
    options = Options(flavor="woff", notdef_outline=True, hinting=False)
    # FontForge's time stamps: fontTools cannot subset this table.
    options.drop_tables.append("FFTM")
    with TTFont(_path(weight)) as font:
        subsetter = Subsetter(options)
        subsetter.populate(text=text)
        subsetter.subset(font)
        font.flavor = "woff"
        # A report has the same bytes each time it is written.
        font.recalcTimestamp = False
        content = io.BytesIO()
        font.save(content)
    return base64.b64encode(content.getvalue()).decode()
