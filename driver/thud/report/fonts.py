"""The font of reports, which comes with matplotlib."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
from matplotlib import font_manager, ft2font

FAMILY = "DejaVu Sans"
FILES = {"normal": "DejaVuSans.ttf", "bold": "DejaVuSans-Bold.ttf"}


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
