"""thud for Windows under Wine: what the archive and the wheel in `dist` do for a new user.

`./bootstrap windows` runs this file by the Python of Linux, whose results are the oracle.
"""

from __future__ import annotations

import csv
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
import zipfile
from contextlib import closing
from http.client import HTTPConnection
from pathlib import Path

import numpy as np
import pytest

import thud

ROOT = Path(__file__).parents[2]
BUILD = ROOT / "build/windows"
THUD = Path(sys.executable).with_name("thud")
# Processors and compilers round otherwise.
TOLERANCE = 1e-9
CASES = sorted(path.name for path in (ROOT / "inputs").glob("*.nml"))


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Unpack the archive in a folder whose name is not plain."""
    place = tmp_path_factory.mktemp("windows") / "Prüfung 1 für Bälle"
    (archive,) = (ROOT / "dist").glob("thud-*-windows-*.zip")
    zipfile.ZipFile(archive).extractall(place)
    (unpacked,) = place.iterdir()
    return unpacked


def start(*command: str | Path, place: Path, **environment: str) -> subprocess.Popen[str]:
    """Start a program of Windows."""
    return subprocess.Popen(
        ["wine", *command],
        cwd=place,
        env={**os.environ, **environment},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        encoding="utf-8",
        errors="replace",
    )


def use(folder: Path, *arguments: str, code: int = 0) -> str:
    """Return what `thud.exe` prints."""
    with start("thud.exe", *arguments, place=folder) as process:
        said, errors = process.communicate()
    assert process.returncode == code, errors
    return said + errors


def columns(folder: Path) -> dict[tuple[str, str], list[str]]:
    """Return the columns of the tables of results, by the names of file and column."""
    found = {}
    for path in folder.glob("*.csv"):
        with path.open(newline="", encoding="utf-8") as file:
            for name, *cells in zip(*csv.reader(file), strict=True):
                found[path.name, name] = cells
    return found


@pytest.mark.parametrize("name", CASES)
def test_numbers_are_those_of_linux(folder: Path, tmp_path: Path, name: str) -> None:
    use(folder, f"inputs\\{name}", "-q")
    case = folder / "inputs" / name
    subprocess.run([THUD, "-q", case], cwd=tmp_path, check=True)
    stem = Path(name).stem
    found, expected = columns(folder / "outputs" / stem), columns(tmp_path / "outputs" / stem)
    assert found.keys() == expected.keys()
    assert found
    for column, cells in expected.items():
        try:
            values = np.array(cells, dtype=float)
        except ValueError:
            assert found[column] == cells
        else:
            error = np.abs(np.array(found[column], dtype=float) - values).max()
            assert error <= TOLERANCE * np.abs(values).max(), column


def test_paths_may_have_blanks_umlauts_and_both_slashes(folder: Path) -> None:
    place = folder / "Öl und Gummi"
    place.mkdir()
    text = (folder / "inputs/rubber_ball_100cm.nml").read_text()
    (place / "Bälle 1.nml").write_text(text, newline="\r\n")
    for path in (r"Öl und Gummi\Bälle 1.nml", "Öl und Gummi/Bälle 1.nml"):
        use(folder, path, "-o", r"Öl und Gummi\Ergebnis ß")
    assert (place / "Ergebnis ß/levels.csv").exists()
    assert {path.name for path in place.iterdir()} == {"Bälle 1.nml", "Ergebnis ß"}


def test_files_of_others_stay(folder: Path) -> None:
    use(folder, "inputs/tyre.nml", "-q", "-o", "mine")
    (folder / "mine/notes.txt").write_text("mine")
    assert "notes.txt is in the way" in use(folder, "inputs/tyre.nml", "-o", "mine", code=1)
    assert (folder / "mine/notes.txt").read_text() == "mine"


def test_interrupt_leaves_nothing(folder: Path) -> None:
    samples = "\n".join(["drop.height", *map(str, np.linspace(0.5, 1.5, 200_000))])
    (folder / "many.csv").write_text(samples)
    before = {*folder.rglob("*")}
    with start(
        "thud.exe", "inputs/rubber_ball_modal.nml", "--samples", "many.csv", place=folder
    ) as process:
        time.sleep(3)
        assert process.poll() is None
        process.send_signal(signal.SIGINT)
        process.communicate()
    assert process.returncode == 130
    assert {*folder.rglob("*")} == before


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Install the wheel with its extras for Windows."""
    place = tmp_path_factory.mktemp("site")
    (wheel,) = (ROOT / "dist").glob("*win_amd64.whl")
    pip = (sys.executable, "-m", "pip", "install", "--quiet", "--target", place)
    where = (
        "--platform=win_amd64",
        "--only-binary=:all:",
        f"{wheel}[recordings,explorer,studies]",
        "colorama",
    )
    subprocess.run([*pip, *where], check=True)
    return place


def python(site: Path, place: Path, *arguments: str) -> subprocess.Popen[str]:
    """Start the Python of Windows; its C library is Microsoft's, as Wine's lacks functions."""
    return start(
        BUILD / "python/python.exe",
        *arguments,
        place=place,
        WINEDLLOVERRIDES="ucrtbase=n",
        PYTHONPATH=f"Z:{site}",
    )


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
    code = f"import thud; print({levels})"
    with python(site, tmp_path, "-W", "ignore", "-c", code) as process:
        said, errors = process.communicate()
    expected = [thud.solve(thud.Ball(), model=model).levels() for model in models]
    assert np.abs(np.array(json.loads(said or errors)) - expected).max() < TOLERANCE


def test_recordings_are_measured(site: Path, tmp_path: Path) -> None:
    shutil.copytree(ROOT / "inputs/recordings", tmp_path / "Fallversuche ä")
    drops = [rf"Fallversuche ä\drop_{n}.wav" for n in range(1, 6)]
    with python(
        site, tmp_path, "-m", "thud", "measure", *drops, "--config", r"Fallversuche ä\lab.toml"
    ) as process:
        said, errors = process.communicate()
    assert process.returncode == 0, errors
    assert "does not conform" in " ".join(said.split())
    assert (tmp_path / "outputs/drop_1/report.html").exists()


def test_explorer_answers_at_its_doors(site: Path, tmp_path: Path) -> None:
    recording = (ROOT / "inputs/recordings/drop_1.wav").read_bytes()
    floor = {"floor": {"name": "plate"}, "room": {}}
    fields = (
        (b'"table"', b'{"calibration": "2000 N/FS"}'),
        (b'"file"; filename="drop_1.wav"', recording),
    )
    form = b"".join(
        b"--thud\r\nContent-Disposition: form-data; name=%b\r\n\r\n%b\r\n" % field
        for field in fields
    )
    requests = (
        ("/solve", b"{}", "application/json"),
        ("/solve", json.dumps(floor).encode(), "application/json"),
        ("/measure", form + b"--thud--\r\n", "multipart/form-data; boundary=thud"),
    )
    process = python(site, tmp_path, "-m", "thud", "explore", "--no-browser")
    try:
        assert process.stdout is not None
        found = re.search(r"http://(.+):(\d+)/#token=(\S+)", process.stdout.readline())
        assert found
        with closing(HTTPConnection(found[1], int(found[2]), timeout=120)) as connection:
            for path, content, kind in requests:
                headers = {"X-Thud-Token": found[3], "Content-Type": kind}
                connection.request("POST", path, content, headers)
                answer = json.loads(connection.getresponse().read())
                assert "answer" in answer, answer
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
    finally:
        process.kill()
