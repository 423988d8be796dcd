"""The pictures of the documentation can be drawn, and each is shown on a page."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from conftest import REPOSITORY, names_in, python
from PIL import Image

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.slow
def test_script_draws_the_figures_that_are_named(tmp_path: Path) -> None:
    command = [REPOSITORY / "docs/pictures/draw.py", "sketch_flow", "figure3_levels"]
    assert python(*command, "--folder", tmp_path).returncode == 0
    assert names_in(tmp_path) == ["figure3_levels.png", "sketch_flow.svg"]
    with Image.open(tmp_path / "figure3_levels.png") as picture:
        assert picture.mode == "P"
        assert picture.info["Title"] == "Figure3 levels"
    done = python(*command[:1], "figure_3")
    assert done.returncode == 2
    assert "figure_3" in done.stderr


def test_every_figure_is_shown() -> None:
    pages = [REPOSITORY / "README.md", *(REPOSITORY / "docs").rglob("*.md")]
    text = "".join(page.read_text(encoding="utf-8") for page in pages)
    figures = (REPOSITORY / "docs/figures").iterdir()
    assert [path.name for path in figures if f"figures/{path.name}" not in text] == []
