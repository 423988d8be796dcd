"""The pictures of the documentation can be drawn, and each is shown on a page."""

from __future__ import annotations

import runpy
import sys
from typing import TYPE_CHECKING

import pytest
from conftest import REPOSITORY, names_in

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.slow
def test_pictures_are_drawn_and_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scripts = REPOSITORY / "docs/pictures"
    monkeypatch.setattr(sys, "path", [str(scripts), *sys.path])
    runpy.run_path(str(scripts / "draw.py"))["draw"](tmp_path)
    drawn = set(names_in(tmp_path))
    kept = set(names_in(REPOSITORY / "docs/figures"))
    assert {"flagship.png", *(name for name in kept if name.startswith("sketch_"))} == drawn


def test_every_figure_is_shown() -> None:
    pages = [REPOSITORY / "README.md", *(REPOSITORY / "docs").rglob("*.md")]
    text = "".join(page.read_text(encoding="utf-8") for page in pages)
    figures = (REPOSITORY / "docs/figures").iterdir()
    assert [path.name for path in figures if f"figures/{path.name}" not in text] == []
