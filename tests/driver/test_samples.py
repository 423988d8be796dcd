"""Tables of samples through the executable."""

from __future__ import annotations

import csv
import re
import resource
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import SHELL, naming

import thud
from thud.case.keys import with_values
from thud.level.levels import SOURCES

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run

CASE = """&case name = 'ball' / &ball mass = 2.45 / &drop height = 1.0 /
&model name = 'hollow_sphere' /
"""
# Mass and other keys of a rubber ball that conforms by its floor force alone.
CONFORMING = "2.59, outer_radius = 0.06105, gauge_pressure = 17.8e3"


@pytest.fixture
def case(tmp_path: Path) -> Path:
    """Return a case file."""
    path = tmp_path / "ball.nml"
    path.write_text(CASE)
    return path


def rows_of(path: Path) -> list[dict[str, str]]:
    """Return the rows of a table of results."""
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_results_are_kept_where_no_set_has_any(run: Run, case: Path, tmp_path: Path) -> None:
    (tmp_path / "table.csv").write_text("height\n1\n0.5\n")
    assert run(case, "--samples", "table.csv", "-o", "out", "-q").returncode == 0
    before = (tmp_path / "out/samples.csv").read_bytes()
    case.write_text(CASE.replace("2.45", "-1"))
    assert run(case, "--samples", "table.csv", "-o", "out", "-q").returncode == 1
    assert (tmp_path / "out/samples.csv").read_bytes() == before


def test_rows_are_those_of_solve_many(run: Run, case: Path, tmp_path: Path) -> None:
    heights = np.random.default_rng(1).uniform(0.5, 1.5, 40)
    flux = np.resize(["momentum_balance", "retarding", "conservative", "none"], 40)
    lines = [f"{height!r} , {word}" for height, word in zip(heights.tolist(), flux, strict=True)]
    text = "\n".join(["# drops", "height,momentum_flux", *lines[:20], "", *lines[20:]])
    (tmp_path / "table.csv").write_text(text)
    case.write_text(CASE + "&levels bands = 'both' /\n")
    result = run(case, "--samples", "table.csv")
    assert (result.returncode, result.stderr) == (0, "")
    assert "40 samples, 40 computed, 0 conform" in result.stdout
    rows = rows_of(tmp_path / "outputs/ball_samples/samples.csv")
    parameters = {"mass": 2.45, "height": heights, "momentum_flux": flux}
    both = replace(SHELL, levels=thud.Levels(bands="both"))
    expected = thud.solve_many(parameters, both)
    assert [row["sample"] for row in rows] == [str(i + 1) for i in range(40)]
    np.testing.assert_array_equal([float(row["height"]) for row in rows], heights)
    assert [row["momentum_flux"] for row in rows] == list(flux)
    for name, values in {
        "contact_time_s": expected.contact_time,
        "peak_elastic_force_N": expected.peak_elastic_force,
        "impulse_N_s": expected.impulse,
        "elastic_octave_31.5_Hz_dB": expected.elastic_octave[:, 0],
        "floor_octave_500_Hz_dB": expected.floor_octave[:, 4],
        "elastic_third_31.5_Hz_dB": expected.results["elastic_third"][:, 1],
        "elastic_third_630_Hz_dB": expected.results["elastic_third"][:, -1],
    }.items():
        np.testing.assert_allclose([float(row[name]) for row in rows], values, rtol=1e-15)
    assert {(row["status"], row["reason"]) for row in rows} == {("0", "")}


def test_samples_that_fail_say_why(run: Run, case: Path, tmp_path: Path) -> None:
    (tmp_path / "table.csv").write_text("height,mass\r\n1,2.5\r\n500,2.5\r\n1,-2.5\r\n")
    result = run(case, "--samples", "table.csv", "--check")
    assert result.returncode == 3
    assert "3 samples, 1 computed" in result.stdout
    assert re.search(naming(case, 2, 3, "&drop: height", "500.0 m"), result.stderr)
    rows = rows_of(tmp_path / "outputs/ball_samples/samples.csv")
    assert [row["status"] for row in rows] == ["0", "2", "1"]
    assert re.search(naming("&drop: height", "500.0 m"), rows[1]["reason"])
    assert rows[1]["reason"].startswith("&drop")
    assert re.search(naming("&ball: mass", -2.5, "1.0e-12"), rows[2]["reason"])
    assert float(rows[0]["restitution"]) == pytest.approx(0.889, abs=1e-3)
    assert rows[1]["contact_time_s"] == rows[2]["floor_conforms"] == ""
    assert "nan" not in (tmp_path / "outputs/ball_samples/samples.csv").read_text().lower()


def test_conforming_samples_are_counted(run: Run, case: Path, tmp_path: Path) -> None:
    case.write_text(CASE.replace("2.45", CONFORMING) + "&levels force = 'floor' /\n")
    (tmp_path / "table.csv").write_text("wall_thickness,youngs_modulus\n0.0244,2.03e6\n")
    assert run(case, "--samples", "table.csv", "--check", "-o", "here").returncode == 0
    assert rows_of(tmp_path / "here/samples.csv")[0]["floor_conforms"] == "yes"


@pytest.mark.parametrize(
    "text",
    [
        "height;wall_thickness;momentum_flux;\n1,0;0,032;none; ;\n1,2;0,03;retarding\n;;\n",
        "height wall_thickness momentum_flux\n1 0.032 none\n" + "1.2 0.03 retarding".rjust(4096),
        "height\twall_thickness\tmomentum_flux\n1,0\t0,032\tnone\n1,2\t0,03\tretarding\n",
        "height wall_thickness  momentum_flux\n 1.0  0.032 none # first\n1.2 0.03 'retarding'\n",
        '"height", "wall_thickness", momentum_flux\n1.0, 0.032, NONE\n1.2, 3e-2, retarding\n',
        "height;wall_thickness;momentum_flux\n1,000;0,032;none\n1,200;0,03;retarding\n",
        "\ufeffheight,wall_thickness,momentum_flux\r\n" + 9000 * "#" + "\n1,0.032,none\r\n\r\n"
        "1.2,0.03,retarding",
    ],
)
def test_tables_are_read_as_records_are(run: Run, case: Path, tmp_path: Path, text: str) -> None:
    (tmp_path / "table.csv").write_text(text, encoding="utf-8", newline="")
    assert run(case, "--samples", "table.csv", "-q").returncode == 0
    rows = rows_of(tmp_path / "outputs/ball_samples/samples.csv")
    found = [(float(r["height"]), float(r["wall_thickness"]), r["momentum_flux"]) for r in rows]
    assert found == [(1.0, 0.032, "none"), (1.2, 0.03, "retarding")]


MODELS = {
    "modal_ball": ("loss_factor", [0.1, 0.15, 0.2], ""),
    "finite_element": (
        "bulk_ratio", [50.0, 200.0], "&mesh radial_elements = 2, polar_elements = 16 /",
    ),
    "hunt_crossley": ("contact_time", [0.018, 0.02, 0.022], ""),
    "two_mass": ("belt_mass", [0.2, 1.0, 2.0], ""),
    "measured_modes": (
        "frequency(2)", [80.0, 89.0, 95.0],
        "&measured_modes frequency = 24, 89, damping_ratio = 2*0.05, effective_mass = 2.35, 0.1 /",
    ),
}  # fmt: skip


@pytest.mark.parametrize("model", MODELS)
def test_every_model_has_sets(run: Run, case: Path, tmp_path: Path, model: str) -> None:
    """Rows are those of single drops, of each model, with any number of threads."""
    key, values, more = MODELS[model]
    text = CASE.replace("hollow_sphere", model) + more
    case.write_text(text)
    (tmp_path / "table.csv").write_text(f"{key}\n" + "\n".join(map(str, values)))
    for threads in ("1", "2"):
        result = run(case, "--samples", "table.csv", "--threads", threads, "-o", threads, "-q")
        assert (result.returncode, result.stderr) == (0, "")
    assert (tmp_path / "1/samples.csv").read_bytes() == (tmp_path / "2/samples.csv").read_bytes()
    rows = rows_of(tmp_path / "1/samples.csv")
    base = thud.Case.from_text(text)
    for row, value in zip(rows, values, strict=True):
        impact = thud.solve(with_values(base, {key: value}))
        assert float(row["contact_time_s"]) == impact.contact_time
        assert float(row["peak_force_N"]) == impact.peak_force
        level = float(row["floor_octave_125_Hz_dB"])
        assert level == pytest.approx(impact.levels(force="floor")[2], abs=1e-9)


def test_reasons_of_long_lists_tell_what_is_allowed(run: Run, case: Path, tmp_path: Path) -> None:
    ratio = ", ".join(f"{0.1 + 1e-15 * i:.17f}" for i in range(64))
    modes = f"&measured_modes allow_mass_mismatch = .true., damping_ratio = {ratio}, "
    modes += f"effective_mass = {ratio}, frequency = {', '.join(map(str, range(20, 84)))} /"
    case.write_text(CASE.replace("hollow_sphere", "measured_modes") + modes)
    (tmp_path / "table.csv").write_text("damping_ratio(64)\n0.05\n-1\n0.05\n")
    assert run(case, "--samples", "table.csv", "-o", "out", "-q").returncode == 0
    rows = rows_of(tmp_path / "out/samples.csv")
    assert [row["sample"] for row in rows] == ["1", "2", "3"]
    assert re.search(naming("damping_ratio", 0, 1), rows[1]["reason"])


def test_verdict_is_on_the_force_and_source_of_each_set(
    run: Run, case: Path, tmp_path: Path
) -> None:
    rubber = "wall_thickness = 0.0244, youngs_modulus = 2.03e6"
    case.write_text(
        CASE.replace("2.45", f"{CONFORMING}, {rubber}") + "&levels force = 'elastic' /\n"
    )
    lines = [f"{force},{source}" for force in ("elastic", "floor") for source in SOURCES]
    (tmp_path / "table.csv").write_text("\n".join(["force,source", *lines]))
    result = run(case, "--samples", "table.csv", "-o", "out")
    rows = rows_of(tmp_path / "out/samples.csv")
    impact = thud.solve(thud.Case.from_text(case.read_text()))
    expected = [bool(impact.assess(row["source"], row["force"])) for row in rows]
    assert [row["conforms"] == "yes" for row in rows] == expected
    assert [float(row["margin_dB"]) >= 0 for row in rows] == expected
    assert set(expected) == {True, False}
    assert f"{sum(expected)} conform to all their limits" in result.stdout
    # Levels of two forces have no common range.
    assert "level, " not in result.stdout


def test_results_of_single_drops_and_of_samples_are_kept_apart(
    run: Run, case: Path, tmp_path: Path
) -> None:
    (tmp_path / "table.csv").write_text("height\n1\n")
    assert run(case, "-o", "single").returncode == 0
    assert run(case, "--samples", "table.csv", "-o", "many").returncode == 0
    for arguments in (["-o", "many"], ["--samples", "table.csv", "-o", "single"]):
        result = run(case, *arguments)
        assert result.returncode == 1
        assert re.search(naming(arguments[-1], "holds"), result.stderr.splitlines()[0])


@pytest.mark.parametrize(
    ("arguments", "limit", "code"),
    [("none.csv --threads 64", 2**30, 2), ("/dev/zero", 300 * 2**20, 1)],
    ids=["threads", "endless line"],
)
def test_little_memory_is_reported(
    run: Run, case: Path, arguments: str, limit: int, code: int
) -> None:
    def set_limit() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))

    result = run(case, "--samples", *arguments.split(), preexec_fn=set_limit)
    assert (result.returncode, result.stdout, result.stderr.count("\n")) == (code, "", 1)
    if code == 1:
        assert re.search(naming("/dev/zero", "line 1", 2**20), result.stderr)
