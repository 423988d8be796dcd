"""A floor by the modes of another program: closed forms, refusals, what is not known."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pytest
from conftest import names_in, naming

import thud
from thud.base.bridge import ask
from thud.case.case import case_text
from thud.plot.floor_figures import plate_modes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# A simply supported concrete slab, whose modes are products of sines.
LENGTH, WIDTH, THICKNESS, DENSITY, WAVE_SPEED = 5.0, 4.0, 0.18, 2300.0, 3500.0
MASS = DENSITY * THICKNESS
SOURCE = (0.4, 0.35)
LOSS = 0.03
ROOM = thud.Room(height=2.5, reverberation_time=0.5)
PLATE = thud.Plate(
    length=LENGTH, width=WIDTH, thickness=THICKNESS, density=DENSITY, wave_speed=WAVE_SPEED,
    loss_factor=LOSS, edges="absorption", source_x=SOURCE[0], source_y=SOURCE[1], support="simple",
)  # fmt: skip


class Modes(NamedTuple):
    """Modes of the slab: frequencies, Hz, and values at the points of a grid or at one point."""

    frequency: Array
    loss_factor: Array
    x: Array
    y: Array
    shape: Array

    def write(self, path: Path, **changes: Any) -> None:  # noqa: ANN401 - arrays
        """Write them to a file."""
        thud.write_floor_modes(path, **(self._asdict() | changes))


def slab(highest: float, x: Array, y: Array) -> Modes:
    """Return the modes of the slab up to a frequency, in closed form."""
    m, n = (number.ravel() for number in np.mgrid[1:40, 1:40])
    wave = (m * np.pi / LENGTH) ** 2 + (n * np.pi / WIDTH) ** 2
    frequency = wave * WAVE_SPEED * THICKNESS / np.sqrt(12) / (2 * np.pi)
    (kept,) = np.nonzero(frequency < highest)
    kept = kept[np.argsort(frequency[kept])]
    along, across = (
        np.sin(np.pi * number[kept, None] * position / side)
        for number, position, side in ((m, x, LENGTH), (n, y, WIDTH))
    )
    shape = 2 / np.sqrt(MASS * LENGTH * WIDTH) * along[:, :, None] * across[:, None, :]
    frequency = frequency[kept]
    # The losses of the plate of thud, with radiation.
    answer = ask("floor_modes", case=case_text(thud.Case(floor=PLATE, room=ROOM)), highest=highest)
    loss = np.interp(frequency, answer["frequency"], answer["loss_factor"])
    return Modes(frequency, loss, x, y, shape)


def grid(n_x: int, n_y: int) -> tuple[Array, Array]:
    """Return the coordinates of a uniform grid."""
    return np.linspace(0, LENGTH, n_x), np.linspace(0, WIDTH, n_y)


@pytest.fixture
def path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the path of a file of modes up to 800 Hz, in the current directory."""
    monkeypatch.chdir(tmp_path)
    slab(800, *grid(21, 17)).write(tmp_path / "modes.csv")
    return tmp_path / "modes.csv"


FLOOR = thud.ModalFloor(
    file="modes.csv", thickness=THICKNESS, density=DENSITY, wave_speed=WAVE_SPEED,
    source_x=SOURCE[0], source_y=SOURCE[1],
)  # fmt: skip
BARE = replace(FLOOR, thickness=0.0)


def radiation(floor: object) -> dict[str, Array]:
    """Return the radiation of a floor by its modes."""
    return ask("radiation", case=case_text(thud.Case(floor=floor, room=ROOM)))  # type: ignore[arg-type]


@cache
def of_plate() -> thud.RoomPrediction:
    """Return the level below the slab by its own modes."""
    return thud.predict_level(floor=PLATE, room=ROOM)


def decibels(ratio: Array) -> Array:
    return 10 * np.log10(ratio)


def test_mobility_is_the_sum_of_the_modes(path: Path) -> None:
    point = np.array([SOURCE[0] * LENGTH]), np.array([SOURCE[1] * WIDTH])
    modes = slab(800, *point)
    frequency = np.geomspace(10, 900, 300)
    s = 2j * np.pi * frequency[:, None]
    omega = 2 * np.pi * modes.frequency
    square = modes.shape[:, 0, 0] ** 2
    exact = np.sum(s * square / (s**2 + modes.loss_factor * omega * s + omega**2), axis=1)
    # Of the highest modes with five grid spacings per wavelength, splines miss up to 1 %.
    assert thud.mobility(BARE, frequency).values == pytest.approx(exact, rel=0.02, abs=1e-8)
    slab(800, *grid(41, 33)).write(path)
    assert thud.mobility(BARE, frequency).values == pytest.approx(exact, rel=2e-3, abs=1e-9)


@pytest.mark.usefixtures("path")
def test_plate_adds_the_modes_above_the_highest() -> None:
    frequency = np.linspace(22, 708, 2000)
    exact = thud.mobility(PLATE, frequency).values
    given = thud.mobility(FLOOR, frequency).values
    # The modes end at 800 Hz: up to half of it, and above.
    for low, high, error in ((22, 355, 0.1), (355, 708, 0.8)):
        band = (frequency >= low) & (frequency < high)
        change = decibels(given.real[band].mean() / exact.real[band].mean())
        assert abs(change) < error, low
    # The static compliance of the higher modes at one position differs from the mean one.
    higher = exact - thud.mobility(BARE, frequency).values
    below = frequency < 300
    assert (given - exact).imag[below] == pytest.approx(0, abs=0.4 * higher.imag[below].max())
    # A stated compliance replaces the mean one.
    omega = 2 * np.pi * frequency[:100]
    stated = replace(BARE, residual_compliance=2e-8)
    soft, bare = (thud.mobility(floor, frequency[:100]).values for floor in (stated, BARE))
    assert (soft - bare).imag == pytest.approx(2e-8 * omega, rel=1e-2)
    # Other points move as those of the plate.
    impacts = [thud.solve(model="modal_ball", floor=floor).on_floor for floor in (FLOOR, PLATE)]
    moved, known = (impact.velocity_at(1.2, 2.9) for impact in impacts if impact)
    assert moved == pytest.approx(known, abs=0.03 * abs(known).max())
    with pytest.raises(thud.InputError, match=naming("modal_floor", 5.5, 5.0)):
        impacts[0].velocity_at(5.5, 1.0)  # type: ignore[union-attr]


@pytest.mark.usefixtures("path")
def test_slab_by_its_sampled_modes_radiates_like_the_plate() -> None:
    given, exact = radiation(FLOOR), radiation(PLATE)
    for name in ("radiation_factor", "radiated"):
        change = decibels(given[name] / exact[name])
        assert np.abs(change[:-2]).max() < 0.02, name
        # The modes end at 800 Hz, those of the plate at 3 kHz.
        assert np.abs(change).max() < 0.1, name


@pytest.mark.usefixtures("path")
def test_levels_are_modal_ones_of_the_plate_and_statistical_ones_of_the_modes() -> None:
    given, exact = thud.predict_level(floor=FLOOR, room=ROOM), of_plate()
    modal = slice(0, exact.n_modal)
    assert given.n_modal == exact.n_modal > 0
    assert given.level[modal] == pytest.approx(exact.level[modal], abs=0.02)
    # The edges are those of the modes.
    assert given.rating.contributions["edges"] == 0
    assert not given.has_edges
    modes = slab(800, *grid(2, 2))
    omega, bands = 2 * np.pi * modes.frequency[:, None], thud.get_bands("third")
    rated = np.isin(bands.nominal, exact.frequency)
    edges = zip(bands.lower[rated], bands.upper[rated], strict=True)
    change = []
    for i, (low, high) in enumerate(edges):
        w = 2 * np.pi * np.linspace(low, high, 4001)
        # Mean-square velocity per mean-square force, over all positions of the force.
        velocity = w**2 / ((omega**2 - w**2) ** 2 + (modes.loss_factor[:, None] * omega * w) ** 2)
        mean = velocity.sum(axis=0).mean() / (MASS * LENGTH * WIDTH) ** 2
        center = 2 * np.pi * np.sqrt(low * high)
        conductance = mean * MASS * LENGTH * WIDTH * center * given.loss_factor[i]
        change.append(decibels(conductance / exact.conductance[i]))
    assert decibels(given.conductance / exact.conductance) == pytest.approx(change, abs=0.15)
    n = exact.n_modal
    assert (given.level - exact.level)[n:] == pytest.approx(change[n:], abs=0.3)


def test_plate_takes_over_above_the_highest_mode(path: Path) -> None:
    slab(330, *grid(15, 13)).write(path)
    given, exact = thud.predict_level(floor=FLOOR, room=ROOM), of_plate()
    assert any("above 304 Hz the file has no modes" in str(note) for note in given.notes)
    # The band of 250 Hz reaches to 282 Hz.
    last = given.frequency.tolist().index(250)
    assert given.conductance[last + 1 :] == pytest.approx(exact.conductance[last + 1 :])
    iso = thud.predict_level(floor=PLATE, room=replace(ROOM, radiation="iso_12354"))
    assert given.radiation_factor[last + 1 :] == pytest.approx(iso.radiation_factor[last + 1 :])
    # Modes of up to four times the frequency of the band drive the modal room of the plate.
    modal = slice(0, given.n_modal)
    assert given.level[modal] == pytest.approx(exact.level[modal], abs=0.1)
    slab(200, *grid(13, 11)).write(path)
    fewer = thud.predict_level(floor=FLOOR, room=ROOM)
    # The modes end at 174 Hz, the band of 160 Hz at 178 Hz.
    assert fewer.frequency[fewer.n_modal - 1] == 125
    assert fewer.level[: fewer.n_modal] == pytest.approx(exact.level[: fewer.n_modal], abs=0.5)


def test_coarse_grid_is_refused_and_nothing_stands_for_higher_modes(path: Path) -> None:
    # The eighth half-wave of the highest mode has 2.25 spacings of a grid of 19 points.
    slab(800, *grid(16, 17)).write(path)
    coarse = naming("too coarse", "along x", "four grid spacings")
    with pytest.raises(thud.InputError, match=coarse):
        thud.mobility(FLOOR, [30.0])
    slab(330, *grid(15, 13)).write(path)
    with pytest.raises(thud.InputError, match=naming("modal_floor", "thickness", "density")):
        thud.predict_level(floor=BARE, room=ROOM)
    for floor, words in ((BARE, "residual_compliance"), (FLOOR, "infinite plate")):
        with pytest.warns(UserWarning, match=f"above 304 Hz .*{words}"):
            thud.solve(floor=floor)


def test_masses_spacings_and_order_do_not_matter(path: Path) -> None:
    frequency = np.geomspace(20, 700, 50)
    exact = thud.mobility(FLOOR, frequency).values
    x, y = grid(41, 33)
    x[1:-1] += 0.03 * np.sin(np.arange(39))
    modes = slab(800, x, y)
    count = len(modes.frequency)
    mass = np.linspace(10, 1000, count)
    levels = []
    for order in (np.arange(count), np.argsort(np.sin(np.arange(count)))):
        modes.write(
            path, frequency=modes.frequency[order], loss_factor=modes.loss_factor[order],
            shape=modes.shape[order] * np.sqrt(mass)[:, None, None], modal_mass=mass,
        )  # fmt: skip
        assert thud.mobility(FLOOR, frequency).values == pytest.approx(exact, rel=0.02, abs=1e-8)
        levels.append(thud.predict_level(floor=FLOOR, room=ROOM).level)
    assert levels[1] == pytest.approx(levels[0], abs=1e-6)
    # Semicolons, another order of points, comments and line ends change nothing; losses do.
    head, points = path.read_text().splitlines()[:4], path.read_text().splitlines()[4:]
    same = thud.mobility(FLOOR, frequency).values
    text = "\r\n".join(["# a comment", "", *head, *reversed(points)])
    path.write_text(text.replace(",", ";"), encoding="utf-8-sig")
    assert thud.mobility(FLOOR, frequency).values == pytest.approx(same, rel=1e-12)
    modes.write(path, loss_factor=2 * modes.loss_factor)
    assert abs(thud.mobility(FLOOR, frequency).values / same - 1).max() > 0.1
    titles = [axes.get_title() for axes in plate_modes(FLOOR).axes[:2]]
    assert titles == [f"{frequency:.1f} Hz" for frequency in modes.frequency[:2]]


@pytest.mark.usefixtures("path")
def test_samples_of_floors_share_the_file() -> None:
    # Each thread reads the file for itself.
    parameters = {"source_x": [0.2, 0.3, 0.4, 0.5], "source_y": 0.35}
    case = thud.Case(floor=FLOOR, room=ROOM)
    many = thud.solve_many(parameters, case, threads=2)
    alone = thud.solve_many(parameters, case, threads=1)
    assert many.room_rating == pytest.approx(alone.room_rating, abs=1e-9)
    work = many.floor_work
    assert work is not None
    assert np.ptp(work) > 0.01 * work.mean()


def test_file_lies_beside_its_case(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    case = path.parent / "cases" / "slab.nml"
    case.parent.mkdir()
    path.rename(case.parent / "modes.csv")
    case.write_text(case_text(thud.Case(floor=FLOOR)).decode())
    floor = thud.read_case(case).floor
    assert isinstance(floor, thud.ModalFloor)
    assert floor.file == str(case.parent / "modes.csv")
    with pytest.raises(thud.InputError, match=naming("modes.csv", "no such file")):
        thud.mobility(FLOOR, [30.0])
    # The effective input lies beside the results, and not beside the modes.
    monkeypatch.chdir(case.parent)
    (path.parent / "effective.nml").write_text(case.read_text())
    assert thud.read_case(path.parent / "effective.nml").floor == FLOOR
    long = f"{'x' * 120}.csv"
    (case.parent / "modes.csv").rename(case.parent / long)
    case.write_text(case.read_text().replace("modes.csv", long))
    with pytest.raises(thud.InputError, match=naming("file", 128)):
        thud.read_case(case)


def test_long_rows_fill_no_stack_of_a_thread_and_leave_no_file_open(path: Path) -> None:
    """The rows of many modes are longer than the stacks of some systems' threads."""
    path.write_text("frequency,Hz," + ",".join(["20"] * 90_000) + "\n")
    before, open_files = threading.stack_size(1 << 20), len(names_in(Path("/dev/fd")))
    try:
        with ThreadPoolExecutor(1) as executor, pytest.raises(thud.InputError, match="loss_factor"):
            executor.submit(thud.mobility, FLOOR, [30.0]).result()
    finally:
        threading.stack_size(before)
    assert len(names_in(Path("/dev/fd"))) == open_files
