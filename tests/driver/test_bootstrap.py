"""The path of a checkout: bootstrap and CMake build in it, whatever its characters are."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from conftest import REPOSITORY, names_in, python

if TYPE_CHECKING:
    from pathlib import Path

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
