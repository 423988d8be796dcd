"""The record of the oracles and its page are those of the tests."""

from __future__ import annotations

import ast
import json
import runpy
from pathlib import Path

REPOSITORY = Path(__file__).parents[2]
RECORD = json.loads((REPOSITORY / "docs/validation.json").read_text(encoding="utf-8"))
PAGE = runpy.run_path(str(REPOSITORY / "docs/site/validation.py"))


def oracles_of_the_tests() -> dict[str, str]:
    """Return the kinds of the oracles that the tests name, by what they hold."""
    found = {}
    for path in (REPOSITORY / "tests").rglob("test_*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and ast.unparse(node.func) == "oracle":
                what, kind = (argument.value for argument in node.args[:2])  # type: ignore[attr-defined]
                found[what] = kind
    return found


def test_record_holds_the_oracles_of_the_tests() -> None:
    recorded = {entry["what"]: entry["kind"] for entry in RECORD["oracles"]}
    assert recorded == oracles_of_the_tests(), "run ./bootstrap validation"
    assert set(recorded.values()) == set(PAGE["KINDS"])


def test_recorded_numbers_are_within_their_bounds() -> None:
    assert [o["what"] for o in RECORD["oracles"] if not 0 <= o["measured"] <= o["bound"]] == []


def test_page_is_that_of_the_record() -> None:
    page = (REPOSITORY / "docs/validation.md").read_text(encoding="utf-8")
    assert page == PAGE["page"](RECORD), "run docs/site/validation.py"
    assert all(entry["what"] in page for entry in RECORD["oracles"])
