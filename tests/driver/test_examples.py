"""The inputs that the package brings."""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING

from conftest import REPOSITORY, names_in

import thud
from thud import cli

if TYPE_CHECKING:
    from pathlib import Path

    import pytest
    from conftest import ErrorsOf


def test_examples_are_those_of_the_repository(tmp_path: Path) -> None:
    copied = tmp_path / "mine"
    assert cli.main(["examples", str(copied), "--quiet"]) == 0
    names = [path.relative_to(copied) for path in copied.rglob("*") if path.is_file()]
    assert len(names) > 50
    for name in names:
        assert (copied / name).read_bytes() == (REPOSITORY / "inputs" / name).read_bytes()
    assert thud.read_case(copied / "rubber_ball_100cm.nml").drop.height == 1.0


def test_examples_are_copied_whole_or_not_at_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, errors_of: ErrorsOf
) -> None:
    def fail(_: Path, target: Path, **_options: object) -> None:
        target.mkdir()
        (target / "half").touch()
        raise shutil.Error([("source", str(target), "No space left on device")])

    monkeypatch.setattr("shutil.copytree", fail)
    assert str(tmp_path / "new") in errors_of("examples", tmp_path / "new")
    assert list(tmp_path.iterdir()) == []


def test_examples_replace_nothing(tmp_path: Path, errors_of: ErrorsOf) -> None:
    (tmp_path / "kept").write_text("mine")
    assert str(tmp_path) in errors_of("examples", tmp_path)
    assert names_in(tmp_path) == ["kept"]
