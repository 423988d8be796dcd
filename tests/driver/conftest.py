"""Fixtures: the executable, the inputs of the repository, a case file to be varied."""

from __future__ import annotations

import importlib.util
import os
import re
import shutil
import signal
import subprocess
import sys
import sysconfig
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import settings

import thud
from thud import cli
from thud.base.bridge import ask
from thud.case.case import case_text
from thud.recordings.config import Config
from thud.recordings.signal import Signal

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from types import ModuleType

    from numpy.typing import NDArray
    from playwright.sync_api import Browser

    from thud.base.note import Note

    Run = Callable[..., subprocess.CompletedProcess[str]]
    CaseFile = Callable[..., Path]
    ErrorsOf = Callable[..., str]

# Jobs in the background of a shell ignore interrupts, and so would all that they start.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Tests draw the same examples in each run.
settings.register_profile("thud", derandomize=True)
settings.load_profile("thud")

REPOSITORY = Path(__file__).parents[2]
INPUTS = sorted((REPOSITORY / "inputs").glob("*.nml"))
# The case of the paper: its ball by its shell.
SHELL = thud.Case(model=thud.HollowSphere())
MINIMAL = "&ball /\n&drop /\n&model name = 'hollow_sphere' /\n"
RESULT_FILES = ["effective.nml", "force.csv", "levels.csv", "summary.nml", "thud.txt"]
# How patterns of `naming` begin: at the begin of a message, in any case, over all its lines.
NAMING = r"(?is)\A"


def recorded(impact: thud.Impact, noise: float = 0.5, **known: float) -> thud.Recording:
    """Return what a force plate with white noise, N, records of an impact."""
    force = np.pad(impact.floor_force, int(0.1 * impact.sample_rate))
    force += np.random.default_rng(1).normal(scale=noise, size=len(force))
    return thud.read_recording(Signal.from_array(force, impact.sample_rate), config=Config(**known))


def load_script(path: str) -> ModuleType:
    """Return a script of the repository as a module."""
    spec = importlib.util.spec_from_file_location(Path(path).stem, REPOSITORY / path)
    assert spec
    assert spec.loader
    # Dataclasses look for their module.
    sys.modules[spec.name] = module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def naming(*parts: object) -> str:
    """Return a pattern of messages that name all parts, in any order and wording.

    A part may have an ending ("octave" in "octaves"), but is not found within a longer key or
    number: neither `mass` in `added_mass` nor 1 in 10 or 0.1.
    """
    named = (rf"(?<!\w)(?<!\d\.){re.escape(str(part))}(?![\d_]|\.\d)" for part in parts)
    return NAMING + "".join(f"(?=.*{part})" for part in named)


def codes(notes: Iterable[Note]) -> list[str]:
    """Return the codes of notes."""
    return [note.code for note in notes]


def noted(notes: Iterable[Note], code: str) -> Note:
    """Return the only note of a code."""
    (note,) = (note for note in notes if note.code == code)
    return note


def frequencies_of(
    floor: thud.FloorOptions, highest: float, room: thud.Room | None = None
) -> NDArray[np.float64]:
    """Return natural frequencies of a floor, Hz."""
    case = thud.Case(floor=floor, room=room)
    return np.asarray(ask("floor_modes", case=case_text(case), highest=highest)["frequency"])


def quiet_fit(*arguments: Any, **options: Any) -> thud.Fit:  # noqa: ANN401 - of fit
    """Return a fit whose warnings do not matter."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", thud.FitWarning)
        return thud.fit(*arguments, **options)


def names_in(folder: Path) -> list[str]:
    """Return the sorted names of the files of a directory."""
    return sorted(path.name for path in folder.iterdir())


def contents(folder: Path) -> dict[str, bytes]:
    """Return the contents of the files of a directory by name."""
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def python(*arguments: str | Path, **options: Any) -> subprocess.CompletedProcess[str]:  # noqa: ANN401 - of subprocess
    """Run the interpreter of the tests."""
    command = [sys.executable, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, **options)


def pytest_make_parametrize_id(val: object, argname: str) -> str | None:
    """Keep patterns of messages out of the names of tests."""
    return argname if isinstance(val, str) and val.startswith(NAMING) else None


@pytest.fixture(scope="session")
def executable() -> str:
    """Path of the Fortran executable that was installed with the package."""
    path = Path(sysconfig.get_path("scripts")) / "thud"
    assert path.exists(), f"{path} is missing: run ./bootstrap setup"
    return str(path)


@pytest.fixture(scope="session")
def shell() -> thud.Impact:
    """Return the impact of the standard drop by the model of the paper."""
    return thud.solve(model="hollow_sphere")


@pytest.fixture(scope="session")
def flagship() -> thud.Impact:
    """Return the impact of the standard ball by finite elements: 19.3 ms, 1.6 kN."""
    return thud.solve(
        thud.Ball(), model="finite_element", viscosity="kelvin_voigt", loss_factor=0.2
    )


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """Return a headless browser; its loop of events must end before others begin."""
    api = pytest.importorskip("playwright.sync_api")
    path = shutil.which("chromium") or shutil.which("chromium-browser")
    if path is None:
        pytest.skip("needs Debian's chromium")
    with api.sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield found
        found.close()


@pytest.fixture
def run(executable: str, tmp_path: Path) -> Run:
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
def case_file(tmp_path: Path) -> CaseFile:
    """Write a case file."""

    def write(text: str, name: str = "case.nml") -> Path:
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return write


@pytest.fixture
def errors_of(capsys: pytest.CaptureFixture[str]) -> ErrorsOf:
    """Run a command of the driver that fails; return its errors."""

    def run_failing(*arguments: object, code: int = 1) -> str:
        assert cli.main([str(one) for one in arguments]) == code
        return capsys.readouterr().err

    return run_failing


@pytest.fixture
def working_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make the directory of the test the working directory."""
    monkeypatch.chdir(tmp_path)
