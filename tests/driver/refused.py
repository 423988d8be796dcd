"""What the calls of `refusals.toml` use: short names for what is often refused, and its parts."""

from __future__ import annotations

from math import inf, nan
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import thud
from thud.base.files import inputs_folder
from thud.explorer.jobs import INPUT_ERRORS, TASKS
from thud.explorer.messages import describe_error
from thud.explorer.server import new_application
from thud.level.levels import peak_count

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

# What is only imported for the table.
__all__ = ["inf", "nan", "new_application", "np", "peak_count"]

PULSE = np.sin(np.pi * np.linspace(0, 1, 883))
RECORDINGS = inputs_folder() / "recordings"
WAV = (RECORDINGS / "drop_1.wav").read_bytes()
# Place of the length of its samples.
LENGTH = WAV.index(b"data") + 4
SHELL = {"model": {"name": "hollow_sphere"}}
TRAVEL = "travel (mm),force (N)\n0,0\n1,2"


def write(name: str, text: str | bytes) -> Path:
    """Write a file in the directory of the test; return its path."""
    path = Path(name)
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def levels(force: ArrayLike, sample_rate: Any = 44100.0, **options: Any) -> NDArray[np.float64]:  # noqa: ANN401
    """Return force exposure levels."""
    return thud.force_exposure_levels(force, sample_rate, **options)


def assess(**change: Any) -> thud.Verdict:  # noqa: ANN401
    """Return the verdict on the levels of the standard ball."""
    return thud.assess_levels(**({"levels": [39, 31, 23, 17, 12.5]} | change))


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
