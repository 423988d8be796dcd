"""Refusals of bad input: one table, `refusals.toml`."""

from __future__ import annotations

import shlex
import tomllib
from typing import TYPE_CHECKING, NoReturn

import pytest
import refused
from conftest import REPOSITORY, naming

import thud
from thud import cli

if TYPE_CHECKING:
    from pathlib import Path

TABLE = tomllib.loads((REPOSITORY / "tests/driver/refusals.toml").read_text("utf-8"))
# Errors of groups that raise others than InputError.
KINDS = {"numerical": thud.NumericalError, "types": TypeError}
NAMES = {name: getattr(thud, name) for name in thud.__all__} | vars(refused)


@pytest.mark.parametrize(
    ("group", "row"),
    [
        pytest.param(group, row, id=f"{group}-{number}")
        for group, rows in TABLE.items()
        for number, row in enumerate(rows)
    ],
)
def test_message_names_what_is_refused(
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
    with pytest.raises(KINDS.get(group, thud.InputError), match=naming(*facts)) as error:
        eval(call, {**NAMES, "command": command})  # noqa: S307 - a table of the tests
    assert "\n" not in str(error.value), str(error.value)
