"""The Fortran library in other programs: add_subdirectory, find_package, pkg-config."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import REPOSITORY

import thud

EXAMPLE = REPOSITORY / "docs/examples/fortran"


def run(*command: str | Path, cwd: Path | None = None) -> str:
    """Return what a command prints."""
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=cwd)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def build(source: Path, *options: str) -> Path:
    """Return the directory in which a project was built, quickly and without optimization."""
    place = source / "build"
    options += (f"-DPython_EXECUTABLE={sys.executable}", "-DCMAKE_BUILD_TYPE=MinSizeRel")
    options += ("-DCMAKE_Fortran_FLAGS_MINSIZEREL=-O0",)
    run("cmake", "-S", source, "-B", place, "-G", "Ninja", *options)
    run("cmake", "--build", place)
    return place


@pytest.fixture(scope="module")
def embedded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the build of the example with the sources of thud inside."""
    source = Path(shutil.copytree(EXAMPLE, tmp_path_factory.mktemp("embedded") / "drop"))
    lists = source / "CMakeLists.txt"
    text = lists.read_text(encoding="utf-8")
    wanted = "find_package(thud REQUIRED)"
    assert wanted in text
    lists.write_text(text.replace(wanted, f"add_subdirectory({REPOSITORY} thud)"), encoding="utf-8")
    return build(source, "-DTHUD_NATIVE=OFF")


@pytest.fixture(scope="module")
def installed(embedded: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return an installed tree."""
    prefix = tmp_path_factory.mktemp("installed")
    run("cmake", "--install", embedded / "thud", "--prefix", prefix)
    return prefix


def expected() -> str:
    """Return what the example should print."""
    impact = thud.solve(model="modal_ball")
    lines = [f"contact{1e3 * impact.contact_time:6.2f} ms"]
    middles = [1000.0 * 10 ** (0.3 * k) for k in range(-5, 0)]
    lines += [
        f"{f:7.1f} Hz{level:7.2f} dB" for f, level in zip(middles, impact.levels(), strict=True)
    ]
    return "\n".join(lines) + "\n"


@pytest.mark.slow
def test_the_sources_are_part_of_another_project(embedded: Path) -> None:
    assert run(embedded / "drop") == expected()


@pytest.mark.slow
def test_another_project_finds_the_installed_package(installed: Path, tmp_path: Path) -> None:
    source = Path(shutil.copytree(EXAMPLE, tmp_path / "drop"))
    place = build(source, f"-DCMAKE_PREFIX_PATH={installed}")
    assert run(place / "drop") == expected()


@pytest.mark.slow
def test_pkg_config_names_all_that_is_needed(installed: Path, tmp_path: Path) -> None:
    (description,) = installed.rglob("thud.pc")
    flags = run("pkg-config", "--static", "--cflags", "--libs", description).split()
    run("gfortran", EXAMPLE / "drop.f90", *flags, "-o", tmp_path / "drop", cwd=tmp_path)
    assert run(tmp_path / "drop") == expected()


@pytest.mark.slow
def test_the_executable_of_the_installed_tree_runs(installed: Path) -> None:
    assert run(installed / "bin/thud", "--version").split()[1] == thud.__version__
    made = REPOSITORY / "share/man/man1/thud.1"
    assert (installed / "share/man/man1/thud.1").exists() == made.exists()
    assert not list(installed.rglob("*thud-driver*"))


def test_the_page_shows_the_example_and_what_it_prints() -> None:
    page = (REPOSITORY / "docs/fortran.md").read_text(encoding="utf-8")
    code = (EXAMPLE / "drop.f90").read_text(encoding="utf-8")
    assert code[code.index("program drop") :] in page
    assert f"```\n{expected()}```" in page
