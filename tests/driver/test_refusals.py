"""Refusals of bad input: the tables of the folder `refusals`, one for each room of the driver."""

from __future__ import annotations

import shlex
import tomllib
from importlib import import_module
from typing import TYPE_CHECKING, NoReturn

import pytest
from conftest import REPOSITORY, naming
from refusals import core

import thud
from thud import cli

if TYPE_CHECKING:
    from pathlib import Path

TABLES = sorted((REPOSITORY / "tests/driver/refusals").glob("*.toml"))
NAMES = {name: getattr(thud, name) for name in thud.__all__} | vars(core)
# Errors of groups that raise others than InputError.
KINDS = {"numerical": thud.NumericalError, "types": TypeError}


@pytest.mark.parametrize(
    ("table", "group", "row"),
    [
        pytest.param(path.stem, group, row, id=f"{path.stem}-{group}-{number}")
        for path in TABLES
        for group, rows in tomllib.loads(path.read_text("utf-8")).items()
        for number, row in enumerate(rows)
    ],
)
def test_message_names_what_is_refused(  # noqa: PLR0913, PLR0917 - of pytest
    table: str,
    group: str,
    row: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def command(line: str, code: int = 1) -> NoReturn:
        """Run a command of the driver that fails; raise what it says."""
        assert cli.main(shlex.split(line)) == code
        raise thud.InputError(capsys.readouterr().err.strip())

    monkeypatch.chdir(tmp_path)
    call, *facts = row
    names = {**NAMES, **vars(import_module(f"refusals.{table}")), "command": command}
    with pytest.raises(KINDS.get(group, thud.InputError), match=naming(*facts)) as error:
        eval(call, names)  # noqa: S307 - a table of the tests
    assert "\n" not in str(error.value), str(error.value)
