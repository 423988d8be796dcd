"""What the calls of `refusals.toml` use: short names for what is often refused, and its parts."""

from __future__ import annotations

import shlex
import subprocess
import sysconfig
from concurrent.futures import ThreadPoolExecutor
from math import inf, nan
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

import thud
from thud.level.levels import peak_count
from thud.studies.run import evaluate

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

# What is only imported for the table.
__all__ = ["ThreadPoolExecutor", "evaluate", "inf", "nan", "np", "peak_count"]

PULSE = np.sin(np.pi * np.linspace(0, 1, 883))
SHELL = "&model name = 'hollow_sphere' /"
LARGE = {"low": 1, "high": 2, "count": 257}
HEIGHTS = {"parameters": {"height": {"values": [0.5, 1.0]}}}


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


def study(tables: str | bytes, varied: str = "height.values = [1]") -> thud.Study:
    """Read the file of a study with varied parameters."""
    head = tables if isinstance(tables, bytes) else tables.encode()
    entry = f"parameters = {varied}" if varied.startswith("{") else f"parameters.{varied}"
    return thud.read_study(write("study.toml", head + b"\n" + entry.encode()))


def heated(law: str, model: str = "modal_ball", more: str = "") -> thud.Study:
    """Read the file of a study in which the temperature varies."""
    tables = f"fixed.model = {model!r}\ntemperature = {{{law}}}"
    return study(tables, f"temperature.values = [1]\n{more and f'parameters.{more}'}")


def many(parameters: Any = None, **options: Any) -> thud.Ensemble:  # noqa: ANN401
    """Solve samples."""
    return thud.solve_many({} if parameters is None else parameters, **options)


def samples(table: str = "height\n1\n", case: str = SHELL, arguments: str = "") -> NoReturn:
    """Run the executable with a table of samples that is refused; raise what it says."""
    write("table.csv", table)
    write("ball.nml", f"&ball / &drop / {case}")
    executable = Path(sysconfig.get_path("scripts")) / "thud"
    command = [executable, "ball.nml", *shlex.split(arguments or "--samples table.csv")]
    result = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert result.returncode == 1
    assert not Path("outputs/ball_samples").exists()
    raise thud.InputError(result.stderr.splitlines()[0] if arguments else result.stderr.strip())
