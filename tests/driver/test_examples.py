"""The inputs that the package brings, and the examples of its public names."""

from __future__ import annotations

import os
import shutil
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from conftest import REPOSITORY, load_script, names_in

import thud
from thud import cli

if TYPE_CHECKING:
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


EXAMPLES = load_script("docs/site/examples.py").read_examples()


def test_each_public_name_has_one_example() -> None:
    shown = [name for example in EXAMPLES for name in example.names]
    modules = {"plot", "recordings"}
    assert sorted(shown) == sorted(set(thud.__all__) - modules)


@pytest.mark.slow
@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example.names[0])
def test_examples_run(
    example: Any,  # noqa: ANN401 - of a script
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    executable: str,
) -> None:
    (tmp_path / "inputs").symlink_to(REPOSITORY / "inputs")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", str(Path(executable).parent), prepend=os.pathsep)
    with warnings.catch_warnings():
        exec(example.code, {})  # noqa: S102 - our own
