"""What the calls of `explorer.toml` use."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from refusals.core import write

import thud
from thud.base.files import inputs_folder
from thud.explorer.jobs import INPUT_ERRORS, TASKS
from thud.explorer.messages import describe_error
from thud.explorer.server import new_application

if TYPE_CHECKING:
    from pathlib import Path

# What is only imported for the table.
__all__ = ["new_application"]

RECORDINGS = inputs_folder() / "recordings"
WAV = (RECORDINGS / "drop_1.wav").read_bytes()
# Place of the length of its samples.
LENGTH = WAV.index(b"data") + 4
SHELL = {"model": {"name": "hollow_sphere"}}
TRAVEL = "travel (mm),force (N)\n0,0\n1,2"


def page(task: str, *arguments: Any) -> None:  # noqa: ANN401
    """Run a task of the explorer; raise what its page says, and in brackets at which field."""
    try:
        TASKS[task](*arguments)
    except INPUT_ERRORS as error:
        report = describe_error(error)
        message = f"{report['error']} [{report['field']}]"
        raise thud.InputError(message) from error


def assessed(*files: Path, **table: Any) -> None:  # noqa: ANN401
    """Let the page assess files of a recording, by default an example, with values of a table."""
    page("recording", files or [write("a.wav", WAV)], table)
