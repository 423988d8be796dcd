"""The font of reports: part of the file, so that a report looks the same everywhere."""

from __future__ import annotations

import base64
import io
from functools import cache, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl
from fontTools.subset import Options, Subsetter
from fontTools.ttLib import TTFont
from matplotlib import font_manager, ft2font

if TYPE_CHECKING:
    from collections.abc import Iterable

# The font of figures, which comes with matplotlib.
FAMILY = "DejaVu Sans"
FILES = {"normal": "DejaVuSans.ttf", "bold": "DejaVuSans-Bold.ttf"}
POINT = 25.4 / 72
# Kerning and words that break elsewhere take up to this part of a line.
SLACK = 0.97
ELLIPSIS = "…"


def font_faces(text: str) -> str:
    """Return CSS that holds the characters of a text in the font, normal and bold."""
    return "\n".join(
        f"@font-face {{ font-family: '{FAMILY}'; font-weight: {weight}; "
        f"src: url(data:font/woff;base64,{_subset(weight, text)}) format('woff'); }}"
        for weight in FILES
    )


def missing_characters(text: str) -> str:
    """Return the characters of a text that no installed font has."""
    missing = {c for c in text if c.isprintable() and not c.isspace() and ord(c) not in _widths()}
    for path in font_manager.findSystemFonts() if missing else ():
        try:
            known = ft2font.FT2Font(path).get_charmap()
        except (OSError, RuntimeError):
            continue
        missing = {c for c in missing if ord(c) not in known}
        if not missing:
            break
    return "".join(sorted(missing))


def text_width(text: str, size: float) -> float:
    """Return the width of a text of a size, pt, in mm."""
    widths = _widths()
    return size * POINT * sum(widths.get(ord(c), 1.0) for c in text)


def count_lines(text: str, size: float, width: float) -> int:
    """Return the lines that a text of a size, pt, takes in a column of a width, mm."""
    return len(_lines(text.split(), size, SLACK * width))


def clip(text: str, size: float, width: float, lines: int = 1) -> str:
    """Return a text that takes no more lines, with an ellipsis where it is cut."""
    if count_lines(text, size, width) <= lines:
        return text
    low, high = 0, len(text)
    while high - low > 1:
        middle = (low + high) // 2
        if count_lines(text[:middle] + ELLIPSIS, size, width) <= lines:
            low = middle
        else:
            high = middle
    return text[:low].rstrip() + ELLIPSIS


def _lines(words: Iterable[str], size: float, width: float) -> list[float]:
    """Return the widths of lines of words; words that are wider than a line are broken."""
    space = text_width(" ", size)
    lines = [0.0]
    for word in words:
        length = text_width(word, size)
        if lines[-1] and lines[-1] + space + length <= width:
            lines[-1] += space + length
            continue
        if lines[-1]:
            lines.append(0.0)
        for c in word if length > width else ():
            step = text_width(c, size)
            if lines[-1] + step > width:
                lines.append(0.0)
            lines[-1] += step
        if length <= width:
            lines[-1] = length
    return lines


@lru_cache
def _path(weight: str) -> Path:
    return Path(mpl.get_data_path(), "fonts", "ttf", FILES[weight])


@cache
def _widths() -> dict[int, float]:
    """Return the widths of characters over the size of the font."""
    with TTFont(_path("normal"), lazy=True) as font:
        scale = font["head"].unitsPerEm
        widths, names = font["hmtx"].metrics, font.getBestCmap()
        return {code: widths[name][0] / scale for code, name in names.items()}


def _subset(weight: str, text: str) -> str:
    """Return the font of the characters of a text, in base 64."""
    options = Options(flavor="woff", notdef_outline=True, hinting=False)
    # Times of the font's making, which it cannot subset.
    options.drop_tables.append("FFTM")
    with TTFont(_path(weight)) as font:
        subsetter = Subsetter(options)
        subsetter.populate(text=text)
        subsetter.subset(font)
        font.flavor = "woff"
        # The same report gives the same bytes.
        font.recalcTimestamp = False
        content = io.BytesIO()
        font.save(content)
    return base64.b64encode(content.getvalue()).decode()
