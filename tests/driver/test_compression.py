"""Quasi-static compression: from Python, from a file, and what it refuses."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import names_in

import thud
from thud import cli

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import Run


def test_curve_has_points_table_and_figure() -> None:
    curve = thud.compress(model="modal_ball", max_deflection=0.03, points=13, gas="adiabatic")
    np.testing.assert_allclose(curve.deflection, np.linspace(0, 0.03, 13), rtol=1e-14)
    assert curve.force[0] == 0
    assert np.all(np.diff(curve.force) > 0)
    assert repr(curve) == f"<CompressionCurve, modal_ball: {curve.force[-1]:.1f} N at 30.0 mm>"
    (axes,) = curve.plot().axes
    assert axes.get_xlabel() == "Approach of the plates, mm"
    assert axes.lines[0].get_ydata()[-1] == curve.force[-1]  # type: ignore[index]
    named = thud.plot.compression({"first": curve, "second": curve})
    assert [text.get_text() for text in named.legends[0].get_texts()] == ["first", "second"]


def test_arguments_are_keys_of_the_case() -> None:
    ball, model = thud.Ball(youngs_modulus=2e6), thud.ModalBall(rings=24)
    case = thud.compress(ball, model, max_deflection=0.01, points=7, gas="adiabatic").case
    assert (case.ball, case.model) == (ball, model)
    assert case.compression == thud.Compression(0.01, 7, "adiabatic")
    default = thud.compress()
    assert default.case == thud.Case(compression=thud.Compression())
    # About ten rows, from the first point on.
    rows = thud.compress(points=41, max_deflection=0.02).rows()[1:]
    assert [float(row[0]) for row in rows] == pytest.approx(np.arange(0, 0.0201, 0.002))
    few = thud.compress(points=5, max_deflection=0.02)
    assert [float(row[1]) for row in few.rows()[1:]] == pytest.approx(few.force, abs=0.006)


def test_gas_that_leaves_gives_no_force() -> None:
    ball = thud.Ball(youngs_modulus=1.0)
    forces = {
        gas: thud.compress(ball, "hollow_sphere", gas=gas).force[-1]  # type: ignore[arg-type]
        for gas in ("vented", "isothermal", "adiabatic")
    }
    assert forces["vented"] < 1e-3
    assert 1.3 * forces["isothermal"] < forces["adiabatic"] < 1.6 * forces["isothermal"]


CASE = "&drop / &ball poisson_ratio = 0.45 / &model name = 'modal_ball' / "


def test_file_asks_for_a_compression(run: Run, tmp_path: Path) -> None:
    case = tmp_path / "ball.nml"
    case.write_text(CASE + "&compression max_deflection = 0.02 points = 5 gas = 'isothermal' /")
    done = run(case)
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "outputs/ball"
    found = np.genfromtxt(folder / "compression.csv", delimiter=",", names=True)
    compression = thud.Compression(0.02, 5, "isothermal")
    curve = thud.compress(thud.Ball(poisson_ratio=0.45), "modal_ball", **vars(compression))
    assert found["deflection_m"].tolist() == curve.deflection.tolist()
    assert found["force_N"].tolist() == curve.force.tolist()
    assert f"force there {curve.force[-1]:20.1f} N" in done.stdout
    rows = [line.split() for line in done.stdout.splitlines() if line.endswith("kN/m")]
    stiffness = 1e-3 * curve.force[[-1, 1]] / curve.deflection[[-1, 1]]
    assert [float(row[-2]) for row in rows] == pytest.approx(stiffness, abs=5.1e-3)
    assert thud.read_results(folder).case.compression == compression


def test_driver_draws_the_compression_of_a_case(tmp_path: Path) -> None:
    case = tmp_path / "ball.nml"
    case.write_text(CASE + "&compression points = 5 /")
    assert cli.main(["run", "-q", "-o", str(tmp_path / "out"), str(case)]) == 0
    assert {"compression.csv", "compression.svg"} <= set(names_in(tmp_path / "out"))
