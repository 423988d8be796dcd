"""The Python of the documentation runs, and prints what the pages show."""

from __future__ import annotations

import contextlib
import io
import re
import warnings
from typing import TYPE_CHECKING

import pytest
from conftest import REPOSITORY

if TYPE_CHECKING:
    from pathlib import Path

# A block of Python, and the output that follows it at once, if there is one. A comment before a
# block says why it cannot be run.
BLOCK = re.compile(
    r"(?<!-->\n)^```python\n(.*?)^```\n(?:\n```\n(.*?)^```\n)?", re.DOTALL | re.MULTILINE
)
# The parts of programs in how_to_add are tested with the programs.
PAGES = [
    page
    for page in [REPOSITORY / "README.md", *sorted((REPOSITORY / "docs").glob("*.md"))]
    if "```python" in page.read_text(encoding="utf-8") and page.stem != "how_to_add"
]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
@pytest.mark.slow
@pytest.mark.usefixtures("working_directory")
def test_python_of_a_page_prints_what_is_shown(page: Path, tmp_path: Path) -> None:
    for name in ("inputs", "docs"):
        (tmp_path / name).symlink_to(REPOSITORY / name)
    names: dict[str, object] = {"__name__": "page"}
    for code, shown in BLOCK.findall(page.read_text(encoding="utf-8")):
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            exec(compile(code, page.name, "exec"), names)  # noqa: S102 - our own
        if shown:
            assert printed.getvalue() == shown
