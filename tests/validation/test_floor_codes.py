"""Floors by modes against independent codes: finite elements, exact joists, radiators in space."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from baffled_plate import (
    SOUND_SPEED,
    THIRDS,
    SupportedPlate,
    band_points,
    get_shapes,
    grid_centers,
    radiated_power,
)
from joists import (
    JoistFloor,
    get_conductance,
    get_frequencies,
    get_octaves,
    get_radiated_energy as get_exact_energy,
)
from modal_room_reference import get_maximum_levels, get_pressure, modal_rate
from plate_elements import (
    CLAMPED,
    SUPPORTED,
    Edge,
    Plate,
    System,
    assemble,
    get_grid,
    get_modes,
    get_point_mobility,
    get_response,
    isotropic_plate,
)
from scipy.linalg import eigh

import thud
from thud.base.bridge import ask
from thud.case.case import case_text

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# 160 mm of concrete.
MASS = 2300 * 0.16
STIFFNESS = MASS * (3500 * 0.16) ** 2 / 12
CONCRETE = thud.Plate(thickness=0.16, loss_factor=0.03, edges="absorption")
ORTHOTROPIC = replace(CONCRETE, stiffness_ratio=0.25, torsion_ratio=0.6)


def frequencies_of(floor: object, highest: float) -> Array:
    """Return natural frequencies of a floor by thud, Hz."""
    case = thud.Case(floor=floor)  # type: ignore[arg-type]
    return np.asarray(ask("floor_modes", case=case_text(case), highest=highest)["frequency"])


def elements_of(floor: thud.Plate, edge: Edge = SUPPORTED, **parts: object) -> System:
    """Return the slab by elements of 0.25 m, with the Poisson ratio 0.2 of concrete."""
    ratio, twist = floor.stiffness_ratio**0.5, floor.torsion_ratio * STIFFNESS
    plate = Plate(
        d11=STIFFNESS / ratio, d12=0.2 * STIFFNESS, d22=STIFFNESS * ratio,
        d66=(twist - 0.2 * STIFFNESS) / 2, mass=MASS, edges=(edge,) * 4,
        loss_factor=floor.loss_factor,
    )  # fmt: skip
    return assemble(get_grid(5.0, 0.25), get_grid(4.0, 0.25), [plate], **parts)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("edge", "floor"),
    [
        (SUPPORTED, CONCRETE),
        (SUPPORTED, ORTHOTROPIC),
        (CLAMPED, replace(CONCRETE, support="clamped")),
        (
            Edge(translation=3e8, rotation=2e7),
            replace(CONCRETE, support="elastic", support_stiffness=(3e8,), support_rotation=(2e7,)),
        ),
    ],
)
def test_slabs_have_the_frequencies_of_finite_elements(
    edge: Edge, floor: thud.Plate, oracle: Callable[..., None]
) -> None:
    expected = get_modes(elements_of(floor, edge), 20)[0]
    oracle(
        "20 natural frequencies of a slab by finite elements",
        "independent code",
        frequencies_of(floor, 1000.0)[:20] / expected - 1,
        2e-3,
    )


def test_orthotropic_slab_has_the_mobility_of_finite_elements() -> None:
    """Statically and between modes, where losses do nothing."""
    floor = replace(ORTHOTROPIC, loss_factor=1e-6, source_x=0.4, source_y=0.375)
    system = elements_of(floor)
    modes = get_modes(system, 12)[0]
    frequency = np.append(0.1, (modes[:-1] + modes[1:]) / 2)[np.append(True, np.diff(modes) > 5)]
    assert len(frequency) > 6
    expected = get_point_mobility(system, frequency, 2.0, 1.5)[:, 0].imag
    found = thud.mobility(floor, frequency).values.imag
    # At a force, elements are up to 0.3 % of the static compliance too stiff.
    bound = 0.01 * abs(expected) + 3e-3 * expected[0] * frequency / 0.1
    assert (abs(found - expected) < bound).all()


def test_joists_have_the_frequencies_of_an_exact_solution(oracle: Callable[..., None]) -> None:
    """Discrete ribs with bending, shear, torsion, warping and slip on sheathing."""
    expected = get_frequencies(JoistFloor(), 150, maximum=400.0)
    found = np.sort(frequencies_of(thud.JoistFloor(), 480.0))[:150]
    oracle(
        "150 natural frequencies of a joist floor by an exact solution",
        "independent code",
        found / expected - 1,
        1.5e-2,
    )


ON, BETWEEN = (1.7, 2.3), (1.7, 2.1)


@pytest.mark.parametrize("point", [ON, BETWEEN])
def test_joists_have_the_mobility_of_an_exact_solution(
    point: tuple[float, float], oracle: Callable[..., None]
) -> None:
    expected = get_conductance(JoistFloor(), point)
    floor = thud.JoistFloor(
        source_on="position", source_x=point[0] / 4.0, source_y=point[1] / 5.0, loss_factor=0.05
    )
    found = [thud.mobility(floor, band_points(f, 200)).values.real.mean() for f in THIRDS.tolist()]
    oracle(
        "Re Y of a joist floor in one-third octaves by an exact solution",
        "independent code",
        10 * np.log10(found / expected),
        1.0,
        "dB",
    )


def radiated_by_thud(
    floor: thud.Plate | thud.JoistFloor, sides: tuple[float, float], strike: tuple[float, float]
) -> Array:
    """Return the power per mean-square force that a floor radiates in each band, m/(N s)."""
    case = case_text(thud.Case(floor=floor, room=thud.Room(sound_speed=343.0)))
    x, y = (np.array([point / side]) for point, side in zip(strike, sides, strict=True))
    return np.asarray(ask("radiation", case=case, x=x, y=y)["radiated"])


@pytest.mark.slow
@pytest.mark.parametrize("point", [ON, BETWEEN])
def test_joists_radiate_as_an_exact_solution(
    point: tuple[float, float], oracle: Callable[..., None]
) -> None:
    expected = get_octaves(get_exact_energy(JoistFloor(), point))
    found = radiated_by_thud(thud.JoistFloor(), (4.0, 5.0), point)
    # The exact solution has no losses by radiation, and those of thud are the same.
    oracle(
        "energy radiated by a joist floor in octaves by an exact solution",
        "independent code",
        10 * np.log10(get_octaves(found) / expected),
        2.0,
        "dB",
    )


def radiated_by_elements(
    system: System, sides: tuple[float, float], size: float, strike: tuple[float, float],
    bands: Array,
) -> Array:  # fmt: skip
    """Return the power per mean-square force that plate 1 radiates in each band, m/(N s)."""
    x, y = grid_centers(*sides, size)
    points = (grid.ravel() for grid in np.meshgrid(x, y, indexing="ij"))
    output, load = system.get_row(*points, 1), system.get_row(*strike)
    result = []
    for nominal in bands.tolist():
        frequency = band_points(nominal, 5)
        velocity = get_response(system, frequency, load, output)[:, :, 0]
        power = [
            radiated_power(v.reshape(len(x), len(y)), *sides, f)
            for v, f in zip(velocity, frequency, strict=True)
        ]
        result.append(2 * np.mean(power))
    return np.array(result)


def test_subceiling_below_joists_has_the_modes_and_the_radiation_of_finite_elements(
    oracle: Callable[..., None],
) -> None:
    """A second plate on line springs and air, with complex stiffnesses solved directly."""
    sides, strike = (2.6, 2.1), (1.1, 0.85)
    exact = JoistFloor(length=sides[0], width=sides[1], held=True)
    sheathing = isotropic_plate(exact.stiffness, 0.3, exact.mass, loss_factor=0.05)
    board = isotropic_plate(2.5e9 * 0.0125**3 / 12, 0.2, 9.0, loss_factor=0.02)
    nodes = [get_grid(sides[0], 0.14, strike[:1])]
    nodes.append(get_grid(sides[1], 0.14, [*exact.positions, strike[1]]))
    system = assemble(
        *nodes, [sheathing, board], joist=exact.joist, joists=exact.positions,
        channel=1e6 * (1 + 0.1j), layer=1.2 * SOUND_SPEED**2 / 0.25 * (1 + 0.3j),
    )  # fmt: skip
    floor = thud.JoistFloor(
        length=sides[0], width=sides[1], subceiling_thickness=0.0125, cavity_depth=0.25,
        channel_stiffness=1e6,
    )  # fmt: skip
    oracle(
        "20 natural frequencies of joists with a subceiling by finite elements",
        "independent code",
        frequencies_of(floor, 300.0)[:20] / get_modes(system, 20)[0] - 1,
        2e-3,
    )
    bands = THIRDS[::2][:4]
    expected = radiated_by_elements(system, sides, 0.1, strike, bands)
    found = radiated_by_thud(floor, sides, strike)
    # Losses by radiation, which only thud has, are up to a tenth of those of the joists.
    oracle(
        "energy radiated by a subceiling below joists by finite elements",
        "independent code",
        10 * np.log10(found[::2][:4] / expected),
        1.5,
        "dB",
    )


def test_plate_radiates_as_elementary_radiators(oracle: Callable[..., None]) -> None:
    plate = SupportedPlate(5.0, 4.0, 0.18, 2300.0, 3500.0, 0.03)
    expected = np.array([plate.radiation_factor(f) for f in THIRDS.tolist()])
    floor = thud.Plate(loss_factor=0.03, edges="absorption")
    case = thud.Case(floor=floor, room=thud.Room(sound_speed=SOUND_SPEED))
    found = ask("radiation", case=case_text(case))["radiation_factor"]
    oracle(
        "radiation factor of a concrete plate in thirds by elementary radiators",
        "independent code",
        10 * np.log10(found / expected),
        0.5,
        "dB",
    )


def test_laminate_has_the_frequencies_of_mindlin(oracle: Callable[..., None]) -> None:
    """Layers by hand: moments of the moduli, and the shear of the energy of Q**2/G."""
    floor = thud.LaminateFloor(added_mass=40.0)
    z = np.linspace(-0.08, 0.08, 320_001)
    center = (z[1:] + z[:-1]) / 2
    step = z[1] - z[0]
    along = ~((abs(center) > 0.02) & (abs(center) < 0.04))
    bending, shear = [], []
    for grain in (along, ~along):
        modulus = np.where(grain, 1.1e10, 3.7e8)
        shear_modulus = np.where(grain, 6.9e8, 5e7)
        moment = np.cumsum(modulus * center) * step
        bending.append((modulus * center**2).sum() * step)
        shear.append(bending[-1] ** 2 / ((moment**2 / shear_modulus).sum() * step))
    s1, s2 = shear
    twist, mass = 0.65 * 6.9e8 * 0.16**3 / 12, 470 * 0.16 + 40
    inertia = np.diag([mass, 470 * 0.16**3 / 12, 470 * 0.16**3 / 12])
    square = []
    # Simply supported: w = W sin sin, with rotations A cos sin and B sin cos of the sections.
    for m, n in np.ndindex(12, 12):
        p, q = np.pi * (m + 1) / 5.0, np.pi * (n + 1) / 4.0
        stiffness = [
            [s1 * p**2 + s2 * q**2, -s1 * p, -s2 * q],
            [-s1 * p, bending[0] * p**2 + twist * q**2 + s1, twist * p * q],
            [-s2 * q, twist * p * q, bending[1] * q**2 + twist * p**2 + s2],
        ]
        square.append(eigh(stiffness, inertia, eigvals_only=True)[0])
    expected = np.sqrt(np.sort(square)[:20]) / (2 * np.pi)
    found = frequencies_of(floor, 500.0)[:20]
    oracle(
        "20 natural frequencies of cross-laminated timber by Mindlin's theory",
        "closed form",
        found / expected - 1,
        1e-4,
    )


def test_two_bays_have_the_mobility_of_finite_elements(oracle: Callable[..., None]) -> None:
    system = elements_of(CONCRETE, support=(2.0, 1e14))
    frequency = np.array([30.0, 55.0, 90.0, 140.0])
    expected = get_point_mobility(system, frequency, 0.9, 1.3)
    floor = replace(CONCRETE, line_x=(2.0,), source_x=0.9 / 5, source_y=1.3 / 4)
    found = thud.mobility(floor, frequency).values
    # Dashpots lose as much as complex stiffness at resonance only.
    oracle(
        "mobility of a slab of two bays by finite elements",
        "independent code",
        20 * np.log10(abs(found / np.ravel(expected))),
        1.0,
        "dB",
    )


def test_levels_in_the_room_are_those_of_an_integration_in_time(
    oracle: Callable[..., None],
) -> None:
    """The room stepped in time, with other filters and another detector."""
    impact = thud.solve(model="modal_ball")
    floor = thud.Plate(length=4.5, width=3.7, thickness=0.16, edges="laboratory")
    room = thud.Room(volume=40.0, reverberation_time=(0.4,))
    ball, microphones = [1.1, 2.3], [[3.1, 0.9, 1.4], [1.0, 1.0, 1.2]]
    found = thud.modal_room(
        thud.predict_level(impact, floor, room), balls=[ball], microphones=microphones
    )
    rate = 4096.0
    time = np.arange(int(1.5 * rate)) / rate
    source = found.prediction.source
    force = np.interp(time, source.time, source.force("floor"), right=0.0)
    half_waves = np.array([(m, n) for m in range(1, 25) for n in range(1, 25)])
    unit = 3500 * 0.16 * np.pi / (4 * np.sqrt(3))
    natural = unit * ((half_waves / [4.5, 3.7]) ** 2).sum(axis=1)
    half_waves, natural = half_waves[natural < 1000], natural[natural < 1000]
    # A dashpot of the decay rate omega eta/2.
    omega, loss = 2 * np.pi * natural, 0.005 + MASS / (485 * np.sqrt(natural))
    drive = np.prod(np.sin(np.pi * half_waves * ball / [4.5, 3.7]), axis=1)
    drive /= MASS * 4.5 * 3.7 / 4
    steps = zip(drive, omega, omega * loss / 2, strict=True)
    velocity = np.stack([modal_rate(force * d, w, decay, rate) for d, w, decay in steps], axis=1)
    shapes = get_shapes(half_waves, *[(np.arange(60) + 0.5) / 60] * 2)
    pressure = get_pressure(
        velocity, shapes, rate, found.size, microphones, 0.4, maximum=450.0
    )  # fmt: skip
    expected = get_maximum_levels(pressure, rate, found.frequency)
    oracle(
        "levels in a modal room by an integration in time",
        "independent code",
        found.level[0].T - expected,
        0.3,
        "dB",
    )


def test_energies_given_are_those_that_are_lost(oracle: Callable[..., None]) -> None:
    impact = thud.solve()
    for floor in (thud.Plate(support="clamped"), thud.JoistFloor(), thud.LaminateFloor()):
        room = thud.modal_room(
            thud.predict_level(impact, floor, thud.Room()),
            balls=[(1.1, 2.3), (2.0, 0.7)],
            microphones=[(1.0, 1.5, 1.2)],
        )
        for energy in (room.floor_energy, room.room_energy):
            oracle(
                "modal room: energy into floor and room − energy lost",
                "balance",
                energy[:, 0] / energy[:, 1] - 1,
                1e-9,
            )
