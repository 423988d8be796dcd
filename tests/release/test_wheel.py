"""The wheel, installed where there is no compiler: its libraries, licences, kinds of processor.

`./bootstrap wheel` runs this file by the interpreter of a fresh environment.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import sysconfig
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest

import thud

PACKAGE = Path(thud.__file__).parent
LIBRARIES = PACKAGE.with_name("thud_acoustics.libs")
SCRIPTS = Path(sysconfig.get_path("scripts"))
LOADER = "/lib64/ld-linux-x86-64.so.2"
# What each Linux has: glibc, and the library of gcc by which it ends threads.
OF_THE_SYSTEM = {"libc.so.6", "libm.so.6", "libmvec.so.1", "libpthread.so.0", "libgcc_s.so.1"}
# Kinds of processor, best first, with what hides all better ones from the loader.
HIDDEN = {"x86-64-v4": "", "x86-64-v3": "-AVX512F", "x86-64": "-AVX2,-AVX512F"}
# Fused operations round once instead of twice.
TOLERANCE = 1e-9  # dB
LEVELS = """
import json, thud
from thud.base import bridge as _api
levels = {model: list(thud.solve(thud.Ball(), model=model).levels()) for model in MODELS}
print(json.dumps({"compiler": _api.compiler(), "levels": levels}))
"""
MODELS = ("hollow_sphere", "modal_ball", "finite_element")


def outcome(processor: str) -> dict[str, object]:
    """Return levels and compiler of the library for a kind of processor, the best for the best."""
    environment = {**os.environ, "GLIBC_TUNABLES": f"glibc.cpu.hwcaps={HIDDEN[processor]}"}
    command = [sys.executable, "-W", "ignore", "-c", f"MODELS = {MODELS}\n{LEVELS}"]
    done = subprocess.run(command, check=True, capture_output=True, text=True, env=environment)
    found = json.loads(done.stdout)
    assert isinstance(found, dict)
    return found


def supported() -> list[str]:
    """Return the kinds that this processor is, best first."""
    shown = subprocess.run([LOADER, "--help"], check=True, capture_output=True, text=True).stdout
    lines = [line.split() for line in shown.splitlines() if "(supported" in line]
    return [kind for kind in HIDDEN if kind == "x86-64" or [kind] in [line[:1] for line in lines]]


def binaries() -> list[Path]:
    """Return all that the loader is to load."""
    return [PACKAGE / "lib/thud", *PACKAGE.rglob("*.so"), *LIBRARIES.iterdir()]


@pytest.mark.parametrize("binary", binaries(), ids=lambda path: path.relative_to(PACKAGE.parent))
def test_libraries_come_with_the_wheel(binary: Path) -> None:
    done = subprocess.run([LOADER, "--list", binary], capture_output=True, text=True, check=True)
    for line in done.stdout.splitlines():
        name, _, place = line.strip().partition(" => ")
        if place and name not in OF_THE_SYSTEM:
            assert PACKAGE.parent in Path(place.rpartition(" ")[0]).resolve().parents, line


def test_each_bundled_library_has_its_licence() -> None:
    files = metadata.files("thud-acoustics")
    assert files is not None
    (materials,) = [file for file in files if file.name == "auditwheel.cdx.json"]
    parts = json.loads(materials.read_text())["components"]
    packages = {part["name"] for part in parts} - {"thud_acoustics"}
    licensed = {file.parent.name for file in files if "bundled" in file.parts}
    assert len(packages) >= 4
    assert packages <= licensed
    licence = metadata.metadata("thud-acoustics")["License-Expression"]
    assert licence.startswith("BSD-3-Clause AND GPL-2.0-or-later AND ")


@pytest.mark.parametrize("processor", supported())
def test_each_kind_of_processor_has_its_library(processor: str) -> None:
    assert f"-march={processor} " in str(outcome(processor)["compiler"])


def test_kinds_of_processor_agree() -> None:
    levels = [outcome(processor)["levels"] for processor in supported()]
    for others in levels[1:]:
        for model in MODELS:
            np.testing.assert_allclose(others[model], levels[0][model], rtol=0, atol=TOLERANCE)


def test_a_newcomer_gets_a_figure_and_a_verdict(tmp_path: Path) -> None:
    def driver(*arguments: str) -> str:
        command = [SCRIPTS / "thud-driver", *arguments]
        return subprocess.run(
            command, cwd=tmp_path, capture_output=True, text=True, check=True
        ).stdout

    driver("examples")
    driver("run", "inputs/rubber_ball_100cm.nml")
    assert (tmp_path / "outputs/rubber_ball_100cm/levels.svg").stat().st_size > 10_000
    recordings = sorted(map(str, (tmp_path / "inputs/recordings").glob("drop_*.wav")))
    printed = driver("measure", *recordings, "--config", "inputs/recordings/lab.toml")
    assert "does not conform" in printed


def test_wheel_holds_the_calibrated_sets() -> None:
    assert thud.assess(thud.Case()).counts == (32, 32)
