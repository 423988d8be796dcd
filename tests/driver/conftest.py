"""Fixtures: the executable, the inputs of the repository, a case file to be varied."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sysconfig
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import settings

import thud

if TYPE_CHECKING:
    from collections.abc import Callable

# Jobs in the background of a shell ignore interrupts, and so would all that they start.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Tests draw the same examples in each run.
settings.register_profile("thud", derandomize=True)
settings.load_profile("thud")

REPOSITORY = Path(__file__).parents[2]
INPUTS = sorted((REPOSITORY / "inputs").glob("*.nml"))
MINIMAL = "&ball /\n&drop /\n&model /\n"
# How patterns of `naming` begin: at the begin of a message, in any case, over all its lines.
NAMING = r"(?is)\A"


def recorded(impact: thud.Impact, **known: float) -> thud.Recording:
    """Return what a force plate with little noise records of an impact."""
    quiet = int(0.1 * impact.sample_rate)
    force = np.pad(impact.floor_force, quiet)
    force += np.random.default_rng(1).normal(scale=0.5, size=len(force))
    return thud.Recording.from_array(force, impact.sample_rate, **known)


def naming(*parts: object) -> str:
    """Return a pattern of messages that name all parts, in any order and wording.

    A part may have an ending ("octave" in "octaves"), but is not found within a longer key or
    number: neither `mass` in `added_mass` nor 1 in 10 or 0.1.
    """
    named = (rf"(?<!\w)(?<!\d\.){re.escape(str(part))}(?![\d_]|\.\d)" for part in parts)
    return NAMING + "".join(f"(?=.*{part})" for part in named)


def pytest_make_parametrize_id(val: object, argname: str) -> str | None:
    """Keep patterns of messages out of the names of tests."""
    return argname if isinstance(val, str) and val.startswith(NAMING) else None


@pytest.fixture(scope="session")
def executable() -> str:
    """Path of the Fortran executable that was installed with the package."""
    path = Path(sysconfig.get_path("scripts")) / "thud"
    assert path.exists(), f"{path} is missing: run ./bootstrap setup"
    return str(path)


@pytest.fixture
def run(executable: str, tmp_path: Path) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Run the executable in an empty directory."""

    def run_there(*arguments: str | Path, **options: object) -> subprocess.CompletedProcess[str]:
        return subprocess.run(  # type: ignore[call-overload, no-any-return]
            [executable, *map(str, arguments)],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
            env={**os.environ, "LC_ALL": "C"},
            **options,
        )

    return run_there


@pytest.fixture
def case_file(tmp_path: Path) -> Callable[[str], Path]:
    """Write a case file."""

    def write(text: str, name: str = "case.nml") -> Path:
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return write
