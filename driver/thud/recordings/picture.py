"""A picture in a report."""

from __future__ import annotations

from typing import TYPE_CHECKING

from thud.base.checks import refuse
from thud.recordings.channel import shown_path, shown_text

if TYPE_CHECKING:
    from pathlib import Path

# Formats and maximum size, bytes.
PICTURES = {".svg": "image/svg+xml", ".png": "image/png", ".jpg": "image/jpeg"}
MAX_PICTURE = 300_000


def read_picture(path: Path) -> tuple[str, bytes]:
    """Return media type and content of a picture; raise InputError if it cannot be used."""
    kind = PICTURES.get(path.suffix.lower().replace(".jpeg", ".jpg"))
    allowed = f"{', '.join(PICTURES)} up to {MAX_PICTURE // 1000} kB"
    problem = f"report: accreditation_mark = {shown_path(path)} cannot be used"
    try:
        content = path.read_bytes() if kind and path.stat().st_size <= MAX_PICTURE else b""
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or shown_text(error)
        refuse(f"{problem} ({reason})", allowed, error)
    if not kind or not content:
        refuse(f"{problem} ({'too large or empty' if kind else 'no picture'})", allowed)
    return kind, content
