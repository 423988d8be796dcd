"""Finite elements from end to end: files, figures, results read back, sentences on bad input."""

from __future__ import annotations

import os
import sys
import xml.etree.ElementTree as ET
from typing import TYPE_CHECKING, Any

import f90nml
import meshio
import numpy as np
import pytest
from conftest import RESULT_FILES, names_in, naming, python

import thud
from thud import cli

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import CaseFile

COARSE = {"radial_elements": 2, "polar_elements": 16}
# Steps as long as a coarse mesh allows see the viscosity to 0.1 %, branches to 1 %.
VISCOUS: dict[str, Any] = {"viscosity": "kelvin_voigt", "loss_factor": 0.2}
MESH = "&mesh radial_elements = 2, polar_elements = 16 /\n"
IMPACT = f"&ball /\n&drop /\n&model name = 'finite_element' /\n{MESH}"
SNAPSHOTS = f"{IMPACT}&output snapshot_interval = 1e-3 /\n"
MODES = "&ball /\n&modes count = 3 /\n"


pytestmark = pytest.mark.usefixtures("working_directory")


@pytest.fixture(scope="module")
def impact() -> thud.Impact:
    return thud.solve(model="finite_element", **COARSE)


def areas(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Return the areas of cells, positive if their nodes run counterclockwise."""
    x, y = points[cells, :2].transpose(2, 0, 1)
    return np.asarray(np.sum(x * np.roll(y, -1, 1) - y * np.roll(x, -1, 1), axis=1) / 2)


def test_snapshots_are_files_for_anybody(tmp_path: Path) -> None:
    found = thud.solve(model="finite_element", snapshot_interval=1e-3, **COARSE)
    motion = found.motion
    assert motion
    index, *files = motion.save(tmp_path / "ball.pvd")
    listed = ET.parse(index).findall("Collection/DataSet")  # noqa: S314 - our own
    assert [float(one.attrib["timestep"]) for one in listed] == motion.time.tolist()
    assert [one.attrib["file"] for one in listed] == [file.name for file in files]
    for i, file in enumerate(files):
        grid = meshio.read(file)
        np.testing.assert_array_equal(grid.points[:, :2], motion.position[i].reshape(-1, 2))
        area = areas(grid.points, grid.cells_dict["quad"])
        assert len(area) == 32
        assert (area > 0).all()
        data = grid.point_data
        np.testing.assert_array_equal(data["velocity"][:, :2], motion.velocity[i].reshape(-1, 2))
        pressure = data["contact_pressure"].reshape(17, 3)
        np.testing.assert_array_equal(pressure[:, -1], motion.contact_pressure[i])
        assert not pressure[:, :-1].any()
        cavity = data["cavity_pressure"].reshape(17, 3)
        assert (cavity == [motion.cavity_pressure[i], 0, 0]).all()


def test_mode_shapes_are_grids_for_anybody() -> None:
    modes = thud.free_modes(count=3)
    modes.save("modes.vtu")
    grid = meshio.read("modes.vtu")
    assert (areas(grid.points, grid.cells_dict["quad"]) > 0).all()
    for i, (name, shape) in enumerate(grid.point_data.items()):
        assert name == f"mode {i + 1}, {modes.frequency[i]:.3f} Hz"
        np.testing.assert_array_equal(shape[:, :2], modes.shape[i].reshape(-1, 2))


def test_missing_package_of_meshes_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "meshio", None)
    with pytest.raises(thud.InputError, match=naming("meshio")):
        thud.free_modes().save("modes.vtu")


def test_modes_alone_need_no_drop(
    case_file: CaseFile, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["run", str(case_file(MODES)), "--check"]) == 0
    assert names_in(tmp_path / "outputs/case") == [
        "effective.nml", "modes.csv", "modes.svg", "thud.txt",
    ]  # fmt: skip
    rows = capsys.readouterr().out.partition("free modes")[2].splitlines()[2:5]
    modes = thud.free_modes(count=3)
    assert [row.split()[0] for row in rows] == ["1", "2", "3"]
    assert [float(row.split()[1]) for row in rows] == [
        float(f"{frequency:.2f}") for frequency in modes.frequency
    ]
    assert sorted(f90nml.read("outputs/case/effective.nml")) == ["ball", "case", "modes"]
    table = np.genfromtxt("outputs/case/modes.csv", delimiter=",", names=True, dtype=None)
    assert table["mode"].tolist() == [1, 2, 3]
    np.testing.assert_array_equal(table["frequency_Hz"], modes.frequency)
    np.testing.assert_array_equal(table["pole_participation"], modes.participation)
    assert table["harmonic"].tolist() == [2, 3, 4]


@pytest.mark.slow
def test_a_shorter_run_leaves_nothing_of_a_longer_one(case_file: CaseFile, tmp_path: Path) -> None:
    folder = tmp_path / "outputs/case"
    assert cli.main(["run", "-q", str(case_file(SNAPSHOTS)), "--all", "--animation"]) == 0
    assert (folder / "motion.gif").read_bytes()[:4] == b"GIF8"
    assert (folder / "model_histories.csv").exists()
    assert len(thud.read_results(folder).motion.time) > 20  # type: ignore[union-attr]
    assert cli.main(["run", "-q", "--no-figures", str(case_file(IMPACT))]) == 0
    assert names_in(folder) == RESULT_FILES


def test_channels_keep_the_balance_of_energy(impact: thud.Impact) -> None:
    total = sum(values for name, values in impact.model_histories.items() if "energy_J" in name)
    assert abs(total - total[0]).max() < 0.005 * 2.5 * 9.81
    assert impact.energy_residual < 0.005
    assert impact.impulse_residual < 1e-8
    assert impact.model_histories["contact_radius_m"].max() < 0.089
    # K = 200 mu and E = 9 K mu/(3 K + mu).
    assert impact.model_quantities["bulk_modulus"] == pytest.approx(601 / 9 * 2.06e6)
    np.testing.assert_allclose(
        impact.floor_force.sum() / impact.sample_rate, impact.impulse, rtol=1e-12
    )


def test_record_goes_on_as_free_flight(impact: thud.Impact) -> None:
    end = np.flatnonzero(impact.floor_force)[-1] + 10
    np.testing.assert_allclose(np.diff(impact.velocity[end:]) * impact.sample_rate, 9.81, rtol=0.02)
    fall = np.diff(impact.deflection[end:]) * impact.sample_rate
    np.testing.assert_allclose(fall, impact.velocity[end:-1], atol=9.81 / impact.sample_rate)
    assert (impact.model_histories["minimum_volume_ratio"] > 0).all()
    long = thud.solve(model="finite_element", duration=1.0, sample_rate=16000, **COARSE)
    # The flight ends where the next contact would begin.
    assert long.deflection[-1] == pytest.approx(0, abs=1e-12)
    speed = np.sqrt(2 * 9.81 * -long.deflection.min())
    assert long.velocity[-1] == pytest.approx(speed, rel=1e-3)


@pytest.mark.slow
def test_flight_ends_before_a_contact_that_is_not_asked_for(impact: thud.Impact) -> None:
    long = thud.solve(model="finite_element", duration=1.5, flight_after=1.4, **COARSE)
    np.testing.assert_allclose(long.levels(), impact.levels(), atol=1e-6)
    assert long.model_histories["contact_radius_m"][1500:].max() == 0


def test_peak_is_that_of_the_recorded_band() -> None:
    peaks = [
        thud.solve(model="finite_element", sample_rate=rate, **COARSE, **VISCOUS).peak_force
        for rate in (16e3, 44.1e3, 200e3)
    ]
    np.testing.assert_allclose(peaks, peaks[0], rtol=2e-3)


@pytest.mark.slow
def test_pressure_is_even_at_the_pole() -> None:
    missing = []
    for elements in (64, 128):
        impact = thud.solve(
            model="finite_element", radial_elements=4, polar_elements=elements,
            snapshot_interval=1e-3, **VISCOUS,
        )  # fmt: skip
        assert impact.motion
        middle = np.argmin(abs(impact.motion.time - 9e-3))
        pole, first, second = impact.motion.contact_pressure[middle, :3]
        # Against a parabola through the next two nodes.
        missing.append(1 - pole / (first - (second - first) / 3))
    # The elements at the axis take some of it; areas of half the frustums would add 1/3.
    assert 0 < missing[1] < missing[0] < 0.1


def test_modes_have_the_shapes_of_their_nodes() -> None:
    ball = thud.Ball(poisson_ratio=0.45)
    found = thud.free_modes(ball, 3)
    assert found.ball == ball
    assert len(found.frequency) == len(found.harmonic) == len(found.participation) == 3
    # From the lowest point to the highest and from within outwards.
    assert found.start.shape == (129, 17, 2)
    assert found.shape.shape == (3, *found.start.shape)
    radius = np.linalg.norm(found.start, axis=-1)
    assert radius[:, 0] == pytest.approx(0.057, rel=1e-3)
    assert radius[:, -1] == pytest.approx(0.089, rel=1e-3)
    assert found.start[0, -1] == pytest.approx([0, -0.089], abs=1e-9)
    assert found.start[-1, -1] == pytest.approx([0, 0.089], abs=1e-9)
    size = np.linalg.norm(found.shape, axis=-1)
    assert size.max(axis=(1, 2)) == pytest.approx(np.ones(3))
    for shape in found.shape:
        # No twist, no motion off the axis at the poles, and the lowest point moves upwards.
        assert shape[[0, -1], :, 0] == pytest.approx(0, abs=1e-9)
        assert shape[0, -1, 1] > 0
    assert (np.diff(found.frequency) > 0).all()


def test_drops_at_the_same_time_equal_those_one_after_the_other(tmp_path: Path) -> None:
    """A forked process, which lacks the threads of its parent, computes them too."""
    script = tmp_path / "script.py"
    script.write_text("""
import hashlib
import multiprocessing
import thud

def drops(_=0):
    model = thud.FiniteElement(radial_elements=3, polar_elements=32)
    ball = thud.Ball(youngs_modulus=2.08e6)
    found = thud.solve(thud.Case(ball=ball, model=model, floor=thud.Plate()))
    return found.force("floor").tobytes(), found.on_floor.force("floor").tobytes()

if __name__ == "__main__":
    before = drops()
    with multiprocessing.get_context("fork").Pool(1) as pool:
        assert pool.map(drops, range(1)) == [before]
    print(hashlib.sha256(b"".join(before)).hexdigest())
""")
    answers = [
        python(script, timeout=60, env=os.environ | {"OMP_NUM_THREADS": str(threads)})
        for threads in (1, 2)
    ]
    assert [answer.returncode for answer in answers] == [0, 0]
    assert answers[0].stdout == answers[1].stdout != ""
