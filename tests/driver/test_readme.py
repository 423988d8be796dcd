"""README and tutorial show what the program prints; the page of commands has all of them."""

from __future__ import annotations

import re

import pytest
from conftest import REPOSITORY

import thud
from thud import cli
from thud.base.tables import WIDTH, format_rows, wrap
from thud.comparison.comparison import read_all

README = (REPOSITORY / "README.md").read_text(encoding="utf-8")
TUTORIAL = (REPOSITORY / "docs/tutorials/paper.md").read_text(encoding="utf-8")
BLOCK = re.compile(r"^```([\w{}-]*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)


def without_times(text: str) -> list[str]:
    return [line for line in text.splitlines() if not line.startswith("computing time")]


@pytest.mark.slow
def test_first_result_is_that_of_the_commands() -> None:
    cases = re.search(r"^first=\((.*)\)$", (REPOSITORY / "bootstrap").read_text(), re.MULTILINE)
    assert cases is not None
    paths = [str(REPOSITORY / path) for path in cases[1].split()]
    page = thud.compare(read_all(paths))
    expected = wrap(format_rows(page.rows()))
    (shown,) = (text for _, text in BLOCK.findall(TUTORIAL) if "assessed force" in text)
    assert without_times(shown) == [
        *without_times(expected), "Results: outputs/comparison"
    ]  # fmt: skip


def test_outputs_fit_a_terminal() -> None:
    for _, text in BLOCK.findall(README):
        assert max(map(len, text.splitlines())) <= WIDTH


def test_commands_exist() -> None:
    page = (REPOSITORY / "docs/commands.md").read_text(encoding="utf-8")
    for command in re.findall(r"thud-driver ([a-z]+)", README + page):
        assert command in cli.COMMANDS
    for command in cli.COMMANDS:
        assert re.search(rf"`(thud-driver )?{command}`", page), command
