"""The inputs that the package brings."""

from __future__ import annotations

from typing import TYPE_CHECKING

from conftest import REPOSITORY

import thud
from thud import cli

if TYPE_CHECKING:
    from pathlib import Path

    import pytest


def test_examples_are_those_of_the_repository(tmp_path: Path) -> None:
    copied = tmp_path / "mine"
    assert cli.main(["examples", str(copied), "--quiet"]) == 0
    names = [path.relative_to(copied) for path in copied.rglob("*") if path.is_file()]
    assert len(names) > 50
    for name in names:
        assert (copied / name).read_bytes() == (REPOSITORY / "inputs" / name).read_bytes()
    assert thud.read_case(copied / "rubber_ball_100cm.nml").drop.height == 1.0


def test_examples_replace_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "kept").write_text("mine")
    assert cli.main(["examples", str(tmp_path)]) == 1
    assert str(tmp_path) in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["kept"]
