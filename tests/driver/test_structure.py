"""The structure of the sources: folders, names, and which folder uses which."""

from __future__ import annotations

import importlib
import re
import subprocess
import sys
from inspect import signature
from pathlib import Path
from pkgutil import walk_packages

import numpy as np
from conftest import REPOSITORY

import thud
from thud.recordings.contact import _shapes

SOURCES = REPOSITORY / "src"


def fortran_uses(root: Path) -> dict[str, set[str]]:
    """Return the modules that each Fortran file uses, by paths below the root.

    The two files of `thud_blas_threads`, of which CMake compiles one, count as one.
    """
    module_line = re.compile(r"^ *module +(?!procedure\b)(\w+)", re.IGNORECASE | re.MULTILINE)
    use_line = re.compile(r"^ *use\b[ ,\w]*?(?:::)? *(thud_\w+)", re.IGNORECASE | re.MULTILINE)
    texts = {path: path.read_text(encoding="utf-8") for path in sorted(root.rglob("*.f90"))}
    places = {
        name: path.relative_to(root).as_posix()
        for path, text in texts.items()
        for name in module_line.findall(text)
    }
    return {
        path.relative_to(root).as_posix(): {places[name] for name in use_line.findall(text)}
        for path, text in texts.items()
    }


def test_folders_use_those_before_them() -> None:
    text = (SOURCES / "CMakeLists.txt").read_text(encoding="utf-8")
    (found,) = re.findall(r"set\(thud_folders ([a-z ]+)\)", text)
    order = found.split()
    place = {name: i for i, name in enumerate(order)} | {"api": order.index("app")}
    # The façade stands above all but the executable.
    place["thud.f90"] = order.index("app")
    assert {path.split("/")[0] for path in fortran_uses(SOURCES)} == place.keys()
    wrong = {
        (path, used)
        for path, all_used in fortran_uses(SOURCES).items()
        for used in all_used
        if path.split("/")[0] != used.split("/")[0]
        and place[path.split("/")[0]] <= place[used.split("/")[0]]
    }
    assert not wrong
    assert fortran_uses(SOURCES)["base/text.f90"]


def test_modules_are_named_after_their_files() -> None:
    named = re.compile(r"^module +(\w+)", re.IGNORECASE | re.MULTILINE)
    for path in SOURCES.rglob("*.f90"):
        stem = "blas_threads" if path.stem.startswith("blas_threads_") else path.stem
        others = {"main": [], "thud": ["thud"]}
        expected = others.get(stem, [f"thud_{stem}"])
        assert named.findall(path.read_text(encoding="utf-8")) == expected, path


def test_every_call_of_python_is_guarded() -> None:
    """Interrupts end what computes, from the first statement to the last."""
    body = re.compile(r"(?sm)^   subroutine (\w+).*?\n\n(.*?)^   end subroutine")
    public = re.compile(r"(?m)^   public :: (.*)")
    unguarded = set()
    text = (SOURCES / "api/api.f90").read_text(encoding="utf-8")
    bodies = dict(body.findall(text))
    for name in re.findall(r"\w+", " ".join(public.findall(text))):
        lines = [line.partition("!")[0].strip() for line in bodies[name].splitlines()]
        ends = (lines[0], lines[-1])
        early = any(re.search(r"\breturn\b", line) for line in lines)
        if early or ends != ("call begin_call()", "call end_call()"):
            unguarded.add(name)
    # One asks another, the others compute nothing.
    assert unguarded == {"collect", "end_calls"}


def test_rooms_of_the_driver_are_in_order() -> None:
    """The contracts in pyproject.toml hold: no room uses one above it, no module itself."""
    command = [Path(sys.executable).with_name("lint-imports"), "--no-cache"]
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


def test_caches_of_functions_with_arguments_are_bounded() -> None:
    found = 0
    for module in walk_packages(thud.__path__, "thud."):
        if module.name == "thud.__main__":
            continue
        for name, function in vars(importlib.import_module(module.name)).items():
            if hasattr(function, "cache_parameters") and signature(function).parameters:
                found += 1
                assert function.cache_parameters()["maxsize"], f"{module.name}.{name}"
    assert found


def test_tables_of_flanks_are_kept_for_few_rates() -> None:
    sizes = [_shapes(1 / rate)[0].nbytes for rate in np.linspace(8.0, 64.0, 8)]
    assert _shapes.cache_info().currsize * max(sizes) <= 12e6
