"""Drops on floors that move: results in Python and in files, mobility, refusals."""

from __future__ import annotations

import csv
import re
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import naming
from scipy.integrate import cumulative_trapezoid

import thud
from thud.base._schema import QUANTITIES

if TYPE_CHECKING:
    from collections.abc import Callable

    from conftest import CaseFile, Run
    from numpy.typing import NDArray

    from thud.base._schema import FloorOptions, ModelOptions

MODES = thud.MeasuredModes([24.0, 89.0], [0.05, 0.1], [2.4, 0.1])
LIGHT = thud.InfinitePlate(1600.0)
# Models that couple with a floor, and floors. At 500 Hz the real part of the light oscillator's
# mobility is 1/600 of its magnitude: force times recorded velocity was 18 times the energy there.
COUPLED: dict[str, ModelOptions] = {
    "hollow_sphere": thud.HollowSphere(), "modal_ball": thud.ModalBall(),
    "two_mass": thud.TwoMass(),
    "hunt_crossley": thud.HuntCrossley(contact_time=0.02),
    "finite_element": thud.FiniteElement(radial_elements=2, polar_elements=24),
}  # fmt: skip
FLOORS: dict[str, FloorOptions] = {
    "infinite_plate": LIGHT,
    "oscillator": thud.Oscillator(),
    "light_oscillator": thud.Oscillator(20.0, 20 * (80 * np.pi) ** 2, 0.02 * 20 * 80 * np.pi),
    "plate": thud.Plate(thickness=0.05),
    "laminate_floor": thud.LaminateFloor(),
    "floating_floor": thud.Plate(screed_thickness=0.05),
    "joist_floor": thud.JoistFloor(),
    "measured_mobility": thud.MeasuredMobility(1e-4, [60.0], [0.05], [0.02], [0.0]),
}


# Lines 0.04 Hz apart: a seventh of the narrowest resonance.
LENGTH = 2**20
LINES = np.arange(0, 1000, 44100 / LENGTH)


@cache
def conductance_of(floor: FloorOptions) -> NDArray[np.float64]:
    """Return the real part of the mobility of a floor at the lines, m/(N s)."""
    return thud.mobility(floor, LINES).values.real


@pytest.fixture(scope="module")
def impact() -> thud.Impact:
    """Return the shell's impact on a light floor."""
    return thud.solve(floor=LIGHT)


@pytest.fixture(scope="module")
def moved(impact: thud.Impact) -> thud.FloorImpact:
    """Return its drop on the floor."""
    assert impact.on_floor is not None
    return impact.on_floor


def test_floor_leaves_the_blocked_impact_as_it_is(
    impact: thud.Impact, moved: thud.FloorImpact
) -> None:
    alone = thud.solve()
    assert alone.on_floor is None
    assert np.array_equal(impact.floor_force, alone.floor_force)
    assert impact.assess().rows() == alone.assess().rows()
    assert np.array_equal(moved.blocked_force, alone.floor_force)
    assert thud.solve(floor=thud.Rigid()).on_floor is None


def test_force_and_velocity_of_a_resistance_are_proportional(moved: thud.FloorImpact) -> None:
    assert moved.floor_velocity == pytest.approx(moved.floor_force / 1600, rel=1e-9, abs=1e-12)
    # Rectangles: both vanish at the ends.
    work = (moved.floor_force * moved.floor_velocity).sum() / moved.sample_rate
    assert moved.floor_work == pytest.approx(work, rel=1e-4)
    energy = moved.injected_energy("third")
    level = moved.levels("third", force="floor")
    assert energy.energy == pytest.approx(10 ** (level / 10) / 1600, rel=1e-9)
    assert energy.total == pytest.approx(work, rel=1e-9)
    assert energy.conductance == pytest.approx(1 / 1600)
    assert (moved.difference()[:3] < -1).all()
    blocked = replace(moved, floor_force=moved.blocked_force)
    assert blocked.injected_energy().total > 1.3 * moved.floor_work


@pytest.mark.parametrize("floor", FLOORS.values(), ids=FLOORS)
@pytest.mark.parametrize("model", COUPLED.values(), ids=COUPLED)
def test_energies_are_those_of_contact_force_and_mobility(
    model: ModelOptions, floor: FloorOptions
) -> None:
    moved = thud.solve(model=model, floor=floor).on_floor
    assert moved is not None
    power = abs(np.fft.rfft(moved.floor_force, LENGTH)[: len(LINES)] / moved.sample_rate) ** 2
    below = cumulative_trapezoid(2 * power * conductance_of(floor), LINES, initial=0)
    for bands in ("octave", "third"):
        edges = thud.get_bands(bands)
        expected = np.interp(edges.upper, LINES, below) - np.interp(edges.lower, LINES, below)
        assert moved.injected_energy(bands).energy == pytest.approx(expected, rel=0.02)
    # The mean of a force over a sampling interval has lost its content above 22 kHz.
    assert moved.injected_energy().total == pytest.approx(moved.floor_work, rel=0.02)


def test_mobility_is_that_of_the_closed_form(oracle: Callable[..., None]) -> None:
    floor = thud.Oscillator(mass=80.0, stiffness=1e6, damping=300.0)
    frequency = np.array([5.0, 17.8, 100.0])
    rate = 2 * np.pi * frequency
    expected = 1j * rate / (1e6 - 80 * rate**2 + 300j * rate)
    error = thud.mobility(floor, frequency).values / expected - 1
    oracle("mobility of an oscillator", "closed form", error, 1e-11)
    assert thud.mobility(thud.Rigid(), 50.0).values == pytest.approx([0.0])


def test_results_on_a_floor_are_written_and_shown(run: Run, case_file: CaseFile) -> None:
    case = case_file("&model name = 'hollow_sphere' /\n&floor name = 'oscillator' /\n")
    done = run(case, "-o", "out")
    assert done.returncode == 0, done.stderr
    moved = thud.read_results(case.parent / "out").on_floor
    assert moved is not None
    with (case.parent / "out/floor_levels.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    energy = moved.injected_energy()
    for name, values in {
        "blocked_level_dB": moved.blocked_levels(), "contact_level_dB": moved.levels(),
        "difference_dB": moved.difference(), "energy_J": energy.energy,
        "conductance_m_per_Ns": energy.conductance,
    }.items():  # fmt: skip
        assert [float(row[name]) for row in rows] == pytest.approx(values, rel=1e-9, abs=1e-12)
    table = done.stdout.partition("on oscillator")[2].splitlines()
    number = re.compile(r"\d+(?:\.\d+)?")
    shown = {line[2:24].strip(): number.findall(line[24:]) for line in table}
    for name in ("peak_force", "contact_time", "restitution", "impulse"):
        assert shown[name.replace("_", " ")] == [QUANTITIES[name].show(getattr(moved, name))]
    assert shown["energy to the floor"] == [QUANTITIES["floor_work"].show(moved.floor_work)]


def test_models_of_the_blocked_force_say_so() -> None:
    with pytest.warns(thud.PlausibilityWarning, match=naming("'measured_modes'", "floor")):
        impact = thud.solve(model=MODES, floor=LIGHT)
    assert impact.on_floor is None


def test_points_of_a_plate_move(run: Run, case_file: CaseFile) -> None:
    """The point under the source moves as the source feels it; a farther one as its transfer."""
    text = "&model /\n&floor name = 'plate' /\n&plate point_x = 2.5, 1.0 point_y = 2.0, 0.5 /\n"
    done = run(case_file(text), "-o", "out")
    assert done.returncode == 0, done.stderr
    found = thud.read_results(case_file(text).parent / "out").on_floor
    assert found is not None
    under, far = (found.histories()[f"point_{i}_velocity_m_per_s"] for i in (1, 2))
    scale = abs(found.floor_velocity).max()
    # The force is taken for constant in a sample: (w dt)**2 of the highest modes.
    assert under == pytest.approx(found.floor_velocity, abs=0.02 * scale)
    assert far == pytest.approx(found.velocity_at(1.0, 0.5), abs=1e-12)
    assert 0 < abs(far).max() < scale


def test_mobility_is_drawn_over_the_bands(moved: thud.FloorImpact) -> None:
    bands = thud.get_bands("third")
    for line in moved.plot().axes[-1].get_lines():
        drawn = np.asarray(line.get_xdata())
        assert drawn[[0, -1]] == pytest.approx([bands.lower[0], bands.upper[-1]])


def test_levels_of_both_forces_are_those_of_the_records(moved: thud.FloorImpact) -> None:
    contact, blocked = moved.floor_force, moved.blocked_force
    for bands in ("octave", "third"):
        first, second = (
            thud.force_exposure_levels(force, moved.sample_rate, bands)  # type: ignore[arg-type]
            for force in (contact, blocked)
        )
        assert (moved.blocked_levels(bands) == second).all()  # type: ignore[arg-type]
        assert moved.difference(bands) == pytest.approx(first - second)  # type: ignore[arg-type]
    energy = moved.injected_energy()
    rows = moved.rows()[1:]
    columns = (moved.blocked_levels(), moved.levels(force="floor"), moved.difference())
    for place, values in enumerate(columns, start=1):
        assert [row[place] for row in rows] == [f"{value:.2f}" for value in values]
    assert not any("e" in row[4] for row in rows)
    assert [float(row[4]) for row in rows] == pytest.approx(1e3 * energy.energy, rel=5e-3)
    assert f"{20 * np.log10(contact.max() / blocked.max()):+.2f} dB" in repr(moved)


def test_warning_says_where_the_modes_of_a_floor_end() -> None:
    with pytest.warns(thud.PlausibilityWarning, match="&joist_floor: above 678 Hz the modes"):
        thud.solve(floor=thud.JoistFloor(support="clamped"))


@pytest.mark.parametrize(
    "floor",
    [
        thud.LaminateFloor(cross_modulus=0.0),
        thud.LaminateFloor(length=30.0, width=30.0, support="clamped"),
        thud.LaminateFloor(length=100.0, width=100.0, support="clamped"),
        thud.JoistFloor(width=100.0, spacing=0.2),
        thud.JoistFloor(width=30.0, spacing=0.4, support="clamped"),
        thud.Plate(screed_thickness=0.0005),
        thud.Plate(length=100.0, width=100.0, support="clamped"),
    ],
)
def test_extreme_floors_have_a_mobility(floor: FloorOptions) -> None:
    """Beyond them floors are refused: the table of refusals."""
    assert 0 < abs(thud.mobility(floor, [31.5]).values[0]) < 1
