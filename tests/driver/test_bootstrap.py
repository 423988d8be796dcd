"""Bootstrap: its first run on one screen, and builds in a checkout with any path."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import REPOSITORY, names_in, python

from thud.base.tables import WIDTH

# Lines of the first run.
LINES = 40
# Paths that CMake takes as they are, and one with all that it, ninja, shells or scripts do not.
PLAIN = "a b ü +1"
ODD = "a b ü 'q'\"x $HOME `&` #1 (y) [z] ] ; \\n <|>*?"
EXTENSION = """
cmake_minimum_required(VERSION 3.25)
project(tiny LANGUAGES C Fortran)
list(APPEND CMAKE_MODULE_PATH "${PROJECT_SOURCE_DIR}/cmake")
include(AddF2pyExtension)
add_f2py_extension(tiny tiny.f90 MAP f2cmap)
"""
SOURCE = """
subroutine twice(x)
   use, intrinsic :: iso_fortran_env, only: wp => real64
   real(wp), intent(inout) :: x(1)
   x = 2*x
end subroutine twice
"""


def in_checkout(checkout: Path, script: str, **env: str) -> subprocess.CompletedProcess[str]:
    """Run commands of a shell that has the functions of bootstrap."""
    shutil.copy(REPOSITORY / "bootstrap", checkout)
    return subprocess.run(
        ["/bin/bash", "-c", f"source ./bootstrap help >help\n{script}"],
        cwd=checkout,
        env={**os.environ, **env},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture
def built_checkout(tmp_path: Path, executable: str) -> Path:
    """Return a checkout whose commands are installed."""
    (tmp_path / "inputs").symlink_to(REPOSITORY / "inputs")
    (tmp_path / ".venv").mkdir()
    (tmp_path / ".venv/bin").symlink_to(Path(executable).parent)
    return tmp_path


def test_run_prints_one_screen(built_checkout: Path) -> None:
    done = in_checkout(built_checkout, "set_up() { :; }; run_first")
    assert done.returncode == 0, done.stderr
    assert done.stderr == "Simulating 3 drops ...\nComparing them ...\n"
    lines = [*done.stderr.splitlines(), *done.stdout.splitlines()]
    assert len(lines) <= LINES
    assert max(map(len, lines)) <= WIDTH
    shown = done.stdout.splitlines()
    row = next(i for i, line in enumerate(shown) if line.startswith("verdict"))
    assert shown[row].split()[1:] == ["does", "not", "conforms", "conforms"]
    assert shown[row + 1].split() == ["conform"]
    assert lines[-1] == "Results: outputs/comparison"
    assert "minimum step" not in done.stdout
    assert (built_checkout / "outputs/rubber_ball_fe/summary.nml").exists()


@pytest.mark.slow
def test_run_prints_the_numbers_of_the_solver_if_asked_for(built_checkout: Path) -> None:
    done = in_checkout(built_checkout, "set_up() { :; }; run_first --verbose")
    assert "minimum step" in done.stdout


def test_run_refuses_other_options(built_checkout: Path) -> None:
    done = in_checkout(built_checkout, "run_first --loud")
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == "bootstrap: run: unknown option --loud; allowed: --verbose\n"


def test_help_fits_a_terminal(tmp_path: Path) -> None:
    assert in_checkout(tmp_path, "").returncode == 0
    assert max(map(len, (tmp_path / "help").read_text().splitlines())) <= WIDTH


@pytest.mark.skipif(not shutil.which("cmake"), reason="there is no CMake")
@pytest.mark.parametrize("name", [PLAIN, ODD])
@pytest.mark.slow
def test_extension_is_built_in_any_checkout(name: str, tmp_path: Path) -> None:
    checkout = tmp_path / name / "thud"
    shutil.copytree(REPOSITORY / "cmake", checkout / "cmake")
    shutil.copy(REPOSITORY / "src/api/f2cmap", checkout)
    (checkout / "CMakeLists.txt").write_text(EXTENSION)
    (checkout / "tiny.f90").write_text(SOURCE)
    done = in_checkout(
        checkout,
        'leave_odd_path && cmake -S . -B build -G Ninja -DPython_EXECUTABLE="$PYTHON" >log && '
        "cmake --build build",
        XDG_CACHE_HOME=str(tmp_path / "cache"),
        PYTHON=sys.executable,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert (tmp_path / "cache").exists() == (name == ODD)
    use = "import numpy, tiny; x = numpy.array([1.5]); tiny.twice(x); print(*x)"
    done = python("-c", use, env={**os.environ, "PYTHONPATH": str(checkout / "build")})
    assert done.stdout == "3.0\n"


def test_directory_of_links_follows_the_checkout(tmp_path: Path) -> None:
    checkout = tmp_path / ODD
    checkout.mkdir()
    cache = {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    (checkout / "src").mkdir()
    (checkout / "src/main").write_text("kept")
    for entry in ("first", ".second"):
        (checkout / entry).write_text(entry)
        done = in_checkout(checkout, "leave_odd_path && pwd -P && echo kept >build/log", **cache)
        work = tmp_path / "cache/thud" / done.stdout.strip().rpartition("/")[2]
        assert (work / entry).read_text() == entry
        assert (work / "src/main").samefile(checkout / "src/main")
        (checkout / entry).unlink()
    assert (checkout / "build/log").read_text() == "kept\n"
    assert not os.path.lexists(work / "first")


def test_path_without_any_place_for_a_build_is_refused_at_once(tmp_path: Path) -> None:
    checkout = tmp_path / ODD
    checkout.mkdir()
    done = in_checkout(checkout, "set_up_tools", XDG_CACHE_HOME="/nowhere;")
    assert done.returncode == 1
    assert done.stderr.startswith("bootstrap: ")
    assert done.stderr.count("\n") == 1
    assert str(checkout) in done.stderr
    assert "XDG_CACHE_HOME" in done.stderr
    assert set(names_in(checkout)) == {"bootstrap", "help"}
