"""The README shows what the program prints, and the page of the commands has all of them."""

from __future__ import annotations

import contextlib
import io
import re

import pytest
from conftest import REPOSITORY

import thud
from thud import cli
from thud.base.tables import WIDTH, format_rows, wrap
from thud.comparison.comparison import read_all

README = (REPOSITORY / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(\w*)\n(.*?)```", README, re.DOTALL)


def shown_after(marker: str) -> str:
    """Return the block of output that follows a block with some words, or the first with them."""
    places = [i for i, (_, text) in enumerate(BLOCKS) if marker in text]
    return BLOCKS[places[0]][1]


def without_times(text: str) -> list[str]:
    """Return the lines of a text, without computing times."""
    return [line for line in text.splitlines() if not line.startswith("computing time")]


@pytest.mark.slow
def test_first_result_is_that_of_the_commands() -> None:
    cases = re.search(r"^first=\((.*)\)$", (REPOSITORY / "bootstrap").read_text(), re.MULTILINE)
    assert cases is not None
    paths = [str(REPOSITORY / path) for path in cases[1].split()]
    page = thud.compare(read_all(paths))
    expected = wrap(format_rows(page.rows()))
    shown = shown_after("assessed force")
    assert without_times(shown) == [
        *without_times(expected), "Results: outputs/comparison"
    ]  # fmt: skip


def test_outputs_fit_a_terminal() -> None:
    for _, text in BLOCKS:
        assert max(map(len, text.splitlines())) <= WIDTH


@pytest.mark.slow
def test_python_example_prints_what_is_shown() -> None:
    (code,) = (text for kind, text in BLOCKS if kind == "python")
    place = [text for _, text in BLOCKS].index(code)
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(code, "README.md", "exec"), {})  # noqa: S102 - our own
    assert printed.getvalue() == BLOCKS[place + 1][1]


def test_commands_exist() -> None:
    page = (REPOSITORY / "docs/commands.md").read_text(encoding="utf-8")
    for command in re.findall(r"thud-driver ([a-z]+)", README + page):
        assert command in cli.COMMANDS
    for command in cli.COMMANDS:
        assert re.search(rf"`(thud-driver )?{command}`", page), command
