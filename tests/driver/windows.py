"""thud for Windows under Wine: what the archive and the wheel in `dist` do for a new user.

`./bootstrap windows` runs this file by the Python of Linux, whose results are the oracle.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import httpx2
import numpy as np
import pandas as pd
import pytest

import thud

ROOT = Path(__file__).parents[2]
# Processors and compilers round otherwise.
TOLERANCE = 1e-9


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Unpack the archive in a folder whose name is not plain."""
    place = tmp_path_factory.mktemp("windows") / "Prüfung 1 für Bälle"
    (archive,) = (ROOT / "dist").glob("thud-*-windows-*.zip")
    shutil.unpack_archive(archive, place)
    (unpacked,) = place.iterdir()
    return unpacked


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Install the wheel with its extras for Windows."""
    place = tmp_path_factory.mktemp("site")
    (wheel,) = (ROOT / "dist").glob("*win_amd64.whl")
    pip = (sys.executable, "-m", "pip", "install", "-q", "--target", place)
    given = ("--platform=win_amd64", "--only-binary=:all:", "colorama")
    subprocess.run([*pip, *given, f"{wheel}[recordings,explorer,studies]"], check=True)
    return place


def start(place: Path, *command: str | Path, **environment: str) -> subprocess.Popen[str]:
    """Start a program of Windows."""
    pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
    options = {"cwd": place, "env": {**os.environ, **environment}, **pipes}
    return subprocess.Popen(["wine", *command], encoding="utf-8", errors="replace", **options)


def python(site: Path, place: Path, *arguments: str) -> subprocess.Popen[str]:
    """Start the Python of Windows; its C library is Microsoft's, as Wine's lacks functions."""
    command = (ROOT / "build/windows/python/python.exe", *arguments)
    return start(place, *command, WINEDLLOVERRIDES="ucrtbase=n", PYTHONPATH=f"Z:{site}")


def finish(process: subprocess.Popen[str]) -> str:
    """Return what a program prints."""
    said, errors = process.communicate()
    assert process.returncode == 0, errors
    return said


@pytest.mark.parametrize("case", sorted(ROOT.glob("inputs/*.nml")), ids=lambda path: path.stem)
def test_numbers_are_those_of_linux(folder: Path, tmp_path: Path, case: Path) -> None:
    finish(start(folder, "thud.exe", f"inputs\\{case.name}", "-q"))
    subprocess.run(["thud", "-q", case], cwd=tmp_path, check=True)
    found, expected = (
        {path.name: pd.read_csv(path) for path in (place / "outputs" / case.stem).glob("*.csv")}
        for place in (folder, tmp_path)
    )
    assert found.keys() == expected.keys() != set()
    for file, table in expected.items():
        assert [*found[file]] == [*table]
        for name, values in table.items():
            size = values.abs().max() if values.dtype.kind == "f" else 0
            pd.testing.assert_series_equal(found[file][name], values, rtol=0, atol=TOLERANCE * size)


def test_paths_may_have_blanks_umlauts_and_both_slashes(folder: Path) -> None:
    place = folder / "Öl und Gummi"
    place.mkdir()
    text = (folder / "inputs/rubber_ball_100cm.nml").read_text()
    (place / "Bälle 1.nml").write_text(text, newline="\r\n")
    # The second run replaces the results of the first.
    for path in (r"Öl und Gummi\Bälle 1.nml", "Öl und Gummi/Bälle 1.nml"):
        finish(start(folder, "thud.exe", path, "-o", r"Öl und Gummi\Ergebnis ß"))
    assert (place / "Ergebnis ß/levels.csv").exists()
    assert {path.name for path in place.iterdir()} == {"Bälle 1.nml", "Ergebnis ß"}


def test_interrupt_leaves_nothing(folder: Path) -> None:
    (folder / "many.csv").write_text("drop.height\n" + 200_000 * "1.5\n")
    before = {*folder.rglob("*")}
    case = "inputs/rubber_ball_modal.nml"
    with start(folder, "thud.exe", case, "--samples", "many.csv") as process:
        time.sleep(3)
        assert process.poll() is None
        process.send_signal(signal.SIGINT)
        process.communicate()
    assert process.returncode == 128 + signal.SIGINT
    assert {*folder.rglob("*")} == before


def test_each_bundled_library_has_its_licence(site: Path) -> None:
    (information,) = site.glob("thud_acoustics-*.dist-info")
    metadata = (information / "METADATA").read_text(encoding="utf-8")
    assert "\nLicense-Expression: BSD-3-Clause AND GPL-2.0-or-later AND GPL-3.0" in metadata
    libraries = {path.name for path in (site / "thud").glob("*.dll")}
    assert libraries == {"libfftw3-3.dll", "libscipy_openblas.dll"}
    licensed = {path.parent.name for path in information.glob("licenses/bundled/*/*")}
    assert licensed == {"gfortran-mingw-w64-x86-64-posix", "libfftw3-dev", "openblas"}


def test_models_have_the_levels_of_linux(site: Path, tmp_path: Path) -> None:
    models = "hollow_sphere", "modal_ball", "finite_element"
    levels = f"[thud.solve(thud.Ball(), model=name).levels().tolist() for name in {models}]"
    said = finish(python(site, tmp_path, "-W", "ignore", "-c", f"import thud; print({levels})"))
    expected = [thud.solve(thud.Ball(), model=model).levels() for model in models]
    assert np.abs(np.array(json.loads(said)) - expected).max() < TOLERANCE


def test_recordings_are_measured(site: Path, tmp_path: Path) -> None:
    shutil.copytree(ROOT / "inputs/recordings", tmp_path / "Fallversuche ä")
    drops = [rf"Fallversuche ä\drop_{n}.wav" for n in range(1, 6)]
    given = (*drops, "--config", r"Fallversuche ä\lab.toml")
    said = finish(python(site, tmp_path, "-m", "thud", "measure", *given))
    assert "does not conform" in " ".join(said.split())
    assert (tmp_path / "outputs/drop_1/report.html").exists()


def test_explorer_answers_at_its_doors(site: Path, tmp_path: Path) -> None:
    recording = (ROOT / "inputs/recordings/drop_1.wav").read_bytes()
    table = {"table": '{"calibration": "2000 N/FS"}'}
    form = {"data": table, "files": {"file": ("drop_1.wav", recording)}}
    floor = {"json": {"floor": {"name": "plate"}, "room": {}}}
    process = python(site, tmp_path, "-m", "thud", "explore", "--no-browser")
    try:
        found = re.search(r"(http://.+)/#token=(\S+)", process.stdout.readline())
        head = {"X-Thud-Token": found[2]}
        with httpx2.Client(base_url=found[1], headers=head, timeout=120) as client:
            for path, content in (("/solve", {"json": {}}), ("/solve", floor), ("/measure", form)):
                answer = client.post(path, **content)
                assert "answer" in answer.json(), answer.text
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
    finally:
        process.kill()
