"""A copy of the sources, built once as part of another project, with what pages say of Fortran.

It has all that docs/how_to_add.md adds, and is used as docs/fortran.md says: by add_subdirectory,
find_package and pkg-config, and from Python.
"""

from __future__ import annotations

import ast
import csv
import json
import math
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import REPOSITORY, python

import thud

EXAMPLE = REPOSITORY / "docs/examples/fortran"

CASE = """&ball mass = 2.5 /
&drop height = 1.0 /
&model name = 'linear_spring' /
&linear_spring stiffness = 62000.0 /
&levels bands = 'low_third' /
&limits source = 'sandbag' /
"""
QUANTITY = """
import sys, numpy as np, thud
impact = thud.solve()
force = np.concatenate([np.zeros_like(impact.floor_force), impact.floor_force])
frequency = np.fft.rfftfreq(len(force), 1 / impact.sample_rate)
inside = (44.7 < frequency) & (frequency < 354.8)
peak = np.fft.irfft(np.fft.rfft(force) * inside, len(force)).max()
assert abs(impact.mid_peak / peak - 1) < 0.05, (impact.mid_peak, peak)
assert ("peak, 63 to 250 Hz, N", f"{impact.mid_peak:.1f}", "") in thud.compare([impact]).rows()
assert impact.to_xarray()["mid_peak"].attrs["units"] == "N"
many = thud.solve_many({"height": [0.8, 1.0]})
assert abs(many.mid_peak[1] / impact.mid_peak - 1) < 1e-9, (many.mid_peak, impact.mid_peak)
assert "peak, 63 to 250 Hz, N" in dict(row[:2] for row in many.rows())
study = {"parameters": {"height": {"values": [0.8, 1.0]}}}
assert np.allclose(thud.sweep(study).dataset["mid_peak"], many.mid_peak)
learned = thud.surrogate(
    {"design": {"size": 64}, "parameters": {"height": {"low": 0.9, "high": 1.0}}}
)
assert "mid_peak" in learned.outputs, learned.outputs
target = thud.LevelTarget(
    impact.levels(), 0.2, quantities={"mid_peak": (impact.mid_peak, 1.0)}
)
assert target.compare().size == 6
recording = thud.read_recording(sys.argv[1], mass=2.5, height=1.0)
assert abs(recording.quantity("mid_peak") / recording.peak_force - 0.5) < 0.4
thud.write_report(recording, "report")
assert "mid_peak" in open("report/report.json").read()
from thud.explorer.answer import answer_case
names = [name for name, *_ in answer_case(thud.Case(model=thud.HollowSphere()))["numbers"]]
assert "peak, 63 to 250 Hz" in names, names
"""
DRIVE = """
import math, sys, thud
assert thud.LinearSpring().travel == 0.1
impact = thud.solve(model="linear_spring", stiffness=62000.0)
assert abs(impact.contact_time / (math.pi * math.sqrt(2.5 / 62000)) - 1) < 1e-9
many = thud.solve_many({"stiffness": [5e4, 6e4, -1.0]}, model="linear_spring", threads=2)
assert many.status.tolist() == [0, 0, 1], many.reason
for k, time in zip([5e4, 6e4], many.contact_time):
    assert abs(time / (math.pi * math.sqrt(2.5 / k)) - 1) < 1e-9
study = {"fixed": {"model": "linear_spring"}, "parameters": {"stiffness": {"values": [5e4, 6e4]}}}
assert thud.sweep(study).dataset.contact_time.values.tolist() == many.contact_time[:2].tolist()
found = thud.fit(impact, {"stiffness": 5e4}, thud.Case(model=thud.LinearSpring()))
assert abs(found.values["stiffness"] - 62000.0) < 1.0, found
assert len(thud.get_bands("low_third").nominal) == 4
try:
    thud.solve(model="linear_spring", travel=20.0)
except thud.InputError as error:
    assert "0 < travel <= 10 m" in str(error), error
else:
    sys.exit("a key beyond its range passed")
"""


def example(page: str, name: str) -> str:
    (block,) = re.findall(rf"```{name}\n(.*?)```", page, re.DOTALL)
    return str(block)


def insert(path: Path, after: str, text: str) -> None:
    """Put a text behind the one place of another."""
    content = path.read_text()
    assert content.count(after) == 1
    path.write_text(content.replace(after, after + text))


def run(*command: str | Path, cwd: Path | None = None) -> str:
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=cwd)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
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
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a copy of the sources with everything that the page adds, built."""
    root = tmp_path_factory.mktemp("copy")
    shutil.copy(REPOSITORY / "CMakeLists.txt", root)
    ignored = shutil.ignore_patterns("__pycache__", "_core*.so")
    for name in ("cmake", "src", "driver", "docs", "share"):
        if name != "share" or (REPOSITORY / name).exists():
            shutil.copytree(REPOSITORY / name, root / name, ignore=ignored)
    page = (REPOSITORY / "docs/how_to_add.md").read_text()
    model = root / "src/models/linear_spring.f90"
    model.write_text(example(page, "fortran"))
    registry = root / "src/case/registry.f90"
    floor = "   use thud_joist_floor, only: joist_floor_type\n"
    insert(registry, floor, example(page, "fortran use"))
    insert(registry, "'two_mass'", example(page, "fortran name").rstrip("\n"))
    insert(registry, "(two_mass_type :: models(6)%model)\n", example(page, "fortran allocation"))
    insert(model, "      real(wp) :: stiffness = 6.0e4_wp\n", example(page, "fortran component"))
    insert(model, "      fields = [ &\n", example(page, "fortran field"))
    insert(
        root / "src/level/band.f90",
        "      band_set_type('octave', width=3, first=-15, last=-3), &\n",
        example(page, "fortran band"),
    )
    insert(
        root / "src/level/source_limits.f90", "sources(*) = [ &\n", example(page, "fortran source")
    )
    quantities = root / "src/impact/quantities.f90"
    impulse = "'time integral of the force on the floor', of_sample), &\n"
    insert(quantities, impulse, example(page, "fortran entry"))
    value = "get_mid_peak(history%floor_force, history%sample_rate), "
    insert(quantities, "history%restitution, history%impulse, ", value)
    insert(quantities, "contains\n\n", example(page, "fortran function"))
    insert(quantities, "public :: ", "get_mid_peak, ")
    ensemble = root / "src/sweep/ensemble.f90"
    batch = example(page, "fortran batch").rstrip("\n")
    insert(ensemble, "outcome%restitution, outcome%impulse", batch)
    insert(ensemble, "use thud_quantities, only: ", "get_mid_peak, ")
    drop = root / "driver/thud/recordings/measured_drop.py"
    insert(drop, '"impulse", "effective_mass"', ', "mid_peak"')
    insert(drop, "    effective_mass: Estimate\n", "    mid_peak: Estimate\n")
    insert(drop, "        impulse=impulse,\n", example(page, "python estimate"))
    drop.write_text(drop.read_text() + example(page, "python function"))
    source = Path(shutil.copytree(EXAMPLE, root / "drop"))
    lists = source / "CMakeLists.txt"
    wanted = "find_package(thud REQUIRED)"
    assert wanted in lists.read_text()
    lists.write_text(lists.read_text().replace(wanted, f"add_subdirectory({root} thud)"))
    build(source, "-DTHUD_NATIVE=OFF", "-DTHUD_PYTHON=ON")
    (extension,) = source.rglob("_core*.so")
    shutil.copy(extension, root / "driver/thud")
    schema = run(program(root), "--schema")
    generate = [sys.executable, root / "driver/generate_schema.py", root]
    subprocess.run(generate, input=schema, check=True, text=True)
    return root


def program(copy: Path) -> Path:
    return copy / "drop/build/thud/src/thud"


@pytest.mark.slow
def test_executable_and_files_know_what_was_added(copy: Path, tmp_path: Path) -> None:
    (tmp_path / "case.nml").write_text(CASE)
    (tmp_path / "table.csv").write_text("stiffness;height\n62000,0;1,0\n31000;1\n")
    assert "peak, 63 to 250 Hz" in run(program(copy), "case.nml", cwd=tmp_path)
    run(program(copy), "case.nml", "--samples", "table.csv", cwd=tmp_path)
    expected = math.pi * math.sqrt(2.5 / 62000)
    with (tmp_path / "outputs/case_samples/samples.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert float(rows[0]["contact_time_s"]) == pytest.approx(expected, rel=1e-9)
    assert float(rows[1]["contact_time_s"]) == pytest.approx(expected * math.sqrt(2), rel=1e-9)
    assert {"floor_low_third_10_Hz_dB", "mid_peak_N"} <= rows[0].keys()
    levels = (tmp_path / "outputs/case/levels.csv").read_text()
    assert [line.split(",")[0] for line in levels.splitlines()[1:]] == ["low_third"] * 4
    summary = (tmp_path / "outputs/case/summary.nml").read_text()
    assert "source = 'sandbag'" in summary
    assert "mid_peak = " in summary
    assert "&linear_spring" in run(program(copy), "--keys")
    assert "`&linear_spring`" in (copy / "docs/keys.md").read_text()
    assert "model: Literal['linear_spring']" in ast.unparse(
        ast.parse((copy / "driver/thud/impact/solve.pyi").read_text())
    )


@pytest.mark.slow
@pytest.mark.parametrize("script", [DRIVE, QUANTITY], ids=["model", "quantity"])
def test_python_knows_what_was_added(script: str, copy: Path, tmp_path: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": str(copy / "driver")}
    record = REPOSITORY / "inputs/recordings/drop_1.csv"
    done = python("-c", script, record, env=environment, cwd=tmp_path)
    assert done.returncode == 0, done.stderr


def test_schema_of_the_repository_is_fresh(executable: str, tmp_path: Path) -> None:
    """`./bootstrap schema` was run after the latest change of a key."""
    made = ("__init__.pyi", "base/_schema.py", "impact/solve.pyi", "../../docs/keys.md")
    package, ours = tmp_path / "driver/thud", REPOSITORY / "driver/thud"
    for name in made:
        (package / name).parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(ours / "__init__.pyi", package)
    schema = subprocess.run([executable, "--schema"], capture_output=True, check=True).stdout
    generate = [sys.executable, REPOSITORY / "driver/generate_schema.py", tmp_path]
    subprocess.run(generate, input=schema, check=True)
    for name in made:
        assert (package / name).read_text() == (ours / name).read_text(), "run ./bootstrap schema"
    assert {entry["group"] for entry in json.loads(schema)["keys"]} >= {"ball", "mesh", "limits"}


@pytest.fixture(scope="module")
def installed(copy: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    prefix = tmp_path_factory.mktemp("installed")
    run("cmake", "--install", copy / "drop/build/thud", "--prefix", prefix)
    return prefix


def expected() -> str:
    impact = thud.solve(model="modal_ball")
    lines = [f"contact{1e3 * impact.contact_time:6.2f} ms"]
    middles = [1000.0 * 10 ** (0.3 * k) for k in range(-5, 0)]
    lines += [
        f"{f:7.1f} Hz{level:7.2f} dB" for f, level in zip(middles, impact.levels(), strict=True)
    ]
    return "\n".join(lines) + "\n"


@pytest.mark.slow
def test_the_sources_are_part_of_another_project(copy: Path) -> None:
    assert run(copy / "drop/build/drop") == expected()


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
