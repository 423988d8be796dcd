"""Floors by modes against independent codes: finite elements, exact joists, radiators in space."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from baffled_plate import (
    SupportedPlate,
    band_points,
    band_radiation_factor,
    get_third,
    grid_centers,
    radiated_power,
)
from joists import (
    JoistFloor,
    Subceiling,
    get_conductance,
    get_frequencies,
    get_joists,
    get_octaves,
    get_radiated_energy as get_exact_energy,
    to_elements,
)
from mindlin_plate import ThickPlate, get_supported_frequencies
from modal_room_reference import get_maximum_levels, get_plate_velocity, get_pressure
from plate_elements import (
    CLAMPED,
    SUPPORTED,
    Edge,
    Layer,
    LineSpring,
    Plate,
    System,
    assemble,
    get_grid,
    get_modes,
    get_point_mobility,
    get_response,
    isotropic_plate,
)

import thud
from thud.base.bridge import ask
from thud.case.case import case_text

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

THIRDS = np.array([50, 63, 80, 100, 125, 160, 200, 250, 315, 400, 500, 630], float)
# 160 mm of concrete.
STIFFNESS = 2300 * 0.16 * (3500 * 0.16) ** 2 / 12
CONCRETE = thud.Plate(thickness=0.16, loss_factor=0.03, edges="absorption")


def frequencies_of(floor: object, highest: float) -> Array:
    """Return natural frequencies of a floor by thud, Hz."""
    case = thud.Case(floor=floor)  # type: ignore[arg-type]
    return np.asarray(ask("floor_modes", case=case_text(case), highest=highest)["frequency"])


def elements_of(edge: Edge, **parts: object) -> object:
    """Return the concrete plate by elements of 0.25 m."""
    plate = Plate(
        STIFFNESS, 0.2 * STIFFNESS, STIFFNESS, 0.4 * STIFFNESS, 2300 * 0.16, (edge,) * 4, 0.03
    )
    return assemble(get_grid(5.0, 0.25), get_grid(4.0, 0.25), [plate], **parts)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("edge", "keys"),
    [
        (SUPPORTED, {}),
        (CLAMPED, {"support": "clamped"}),
        (
            Edge(translation=3e8, rotation=2e7),
            {"support": "elastic", "support_stiffness": (3e8,), "support_rotation": (2e7,)},
        ),
    ],
)
def test_edges_have_the_frequencies_of_finite_elements(
    edge: Edge, keys: dict[str, object], oracle: Callable[..., None]
) -> None:
    expected = get_modes(elements_of(edge), 20)[0]  # type: ignore[arg-type]
    found = frequencies_of(replace(CONCRETE, **keys), 1000.0)[:20]  # type: ignore[arg-type]
    oracle(
        "20 natural frequencies of a slab by finite elements",
        "independent code",
        found / expected - 1,
        2e-3,
    )


def test_joists_have_the_frequencies_of_an_exact_solution(oracle: Callable[..., None]) -> None:
    """Discrete ribs with bending, shear, torsion, warping and slip on sheathing."""
    expected = get_frequencies(JoistFloor(shear=True), 150, maximum=400.0)[0]
    found = np.sort(frequencies_of(thud.JoistFloor(), 480.0))[:150]
    oracle(
        "150 natural frequencies of a joist floor by an exact solution",
        "independent code",
        found / expected - 1,
        1.5e-2,
    )


def joist_position(*, on_joist: bool) -> tuple[float, float]:
    """Return the position of the source, m."""
    joists = get_joists(JoistFloor())
    y = joists[5] if on_joist else (joists[4] + joists[5]) / 2
    return 1.7, float(y)


@pytest.mark.parametrize("on_joist", [True, False])
def test_joists_have_the_mobility_of_an_exact_solution(
    on_joist: bool,  # noqa: FBT001 - a parameter of the test
    oracle: Callable[..., None],
) -> None:
    point = joist_position(on_joist=on_joist)
    expected = get_conductance(JoistFloor(shear=True), point)
    floor = thud.JoistFloor(
        source_on="position", source_x=point[0] / 4.0, source_y=point[1] / 5.0, loss_factor=0.05
    )
    edges = THIRDS[:, None] * 2 ** (np.array([-1.0, 1.0]) / 6)
    found = [
        thud.mobility(floor, np.linspace(low, high, 200)).values.real.mean() for low, high in edges
    ]
    oracle(
        "Re Y of a joist floor in one-third octaves by an exact solution",
        "independent code",
        10 * np.log10(found / expected),
        1.0,
        "dB",
    )


@pytest.mark.slow
@pytest.mark.parametrize("on_joist", [True, False])
def test_joists_radiate_as_an_exact_solution(
    on_joist: bool,  # noqa: FBT001 - a parameter of the test
    oracle: Callable[..., None],
) -> None:
    point = joist_position(on_joist=on_joist)
    expected = get_octaves(get_exact_energy(JoistFloor(shear=True), point)[0])
    case = thud.Case(floor=thud.JoistFloor(), room=thud.Room(sound_speed=343.0))
    answer = ask(
        "radiation", case=case_text(case), x=np.array([point[0] / 4]), y=np.array([point[1] / 5])
    )
    # The exact solution has no losses by radiation, and those of thud are the same.
    oracle(
        "energy radiated by a joist floor in octaves by an exact solution",
        "independent code",
        10 * np.log10(get_octaves(answer["radiated"]) / expected),
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
    output, load = system.get_row(*points, 1), system.get_row(*strike).T
    result = []
    for limits in zip(*get_third(bands), strict=True):
        frequency = band_points(*limits, 8)
        velocity = get_response(system, frequency, load, output=output)[:, :, 0]
        power = [
            radiated_power(v.reshape(len(x), len(y)), *sides, f, sound_speed=343.0)
            for v, f in zip(velocity, frequency, strict=True)
        ]
        result.append(2 * np.mean(power))
    return np.array(result)


def radiated_by_thud(
    floor: thud.Plate | thud.JoistFloor, sides: tuple[float, float], strike: tuple[float, float]
) -> Array:
    """Return the power per mean-square force that a floor radiates in each band, m/(N s)."""
    case = case_text(thud.Case(floor=floor, room=thud.Room(sound_speed=343.0)))
    x, y = (np.array([point / side]) for point, side in zip(strike, sides, strict=True))
    return np.asarray(ask("radiation", case=case, x=x, y=y)["radiated"])


def test_subceiling_below_joists_has_the_modes_and_the_radiation_of_finite_elements(
    oracle: Callable[..., None],
) -> None:
    """A second plate on line springs and air, with complex stiffnesses solved directly."""
    sides, strike = (2.6, 2.1), (1.1, 0.85)
    exact = JoistFloor(length=sides[0], width=sides[1], shear=True, held=True)
    board = isotropic_plate(2.5e9 * 0.0125**3 / 12, 0.2, 9.0, loss_factor=0.02)
    below = Subceiling(board, Layer(1.2 * 343**2 / 0.25, 0.3), channel=1e6, channel_loss=0.1)
    system = to_elements(exact, 0.1, points=[strike], below=below)
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
    expected = band_radiation_factor(plate, THIRDS)
    floor = thud.Plate(loss_factor=0.03, edges="absorption")
    case = thud.Case(floor=floor, room=thud.Room(sound_speed=340.0))
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
    thick = ThickPlate(
        length=5.0, width=4.0, d11=bending[0], d12=0.0, d22=bending[1],
        d66=0.65 * 6.9e8 * 0.16**3 / 12, s1=shear[0], s2=shear[1],
        mass=470 * 0.16 + 40, rotary_inertia=470 * 0.16**3 / 12,
    )  # fmt: skip
    m, n = (grid.ravel() for grid in np.meshgrid(np.arange(1, 12), np.arange(1, 12)))
    expected = np.sort(get_supported_frequencies(thick, m, n)[:, 0])[:20]
    found = frequencies_of(floor, 500.0)[:20]
    oracle(
        "20 natural frequencies of cross-laminated timber by Mindlin's theory",
        "closed form",
        found / expected - 1,
        1e-4,
    )


def test_two_bays_have_the_mobility_of_finite_elements(oracle: Callable[..., None]) -> None:
    line = LineSpring(along="y", at=2.0, translation=1e14)
    system = elements_of(SUPPORTED, lines=[line])
    frequency = np.array([30.0, 55.0, 90.0, 140.0])
    expected = get_point_mobility(system, frequency, 0.9, 1.3, 0)  # type: ignore[arg-type]
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
    loss = 0.005 + 2300 * 0.16 / (485 * np.sqrt(natural))
    drive = np.prod(np.sin(np.pi * half_waves * ball / [4.5, 3.7]), axis=1)
    drive /= 2300 * 0.16 * 4.5 * 3.7 / 4
    velocity = get_plate_velocity(force, rate, natural, loss, drive)
    middles = [(np.arange(60) + 0.5) / 60 for _ in range(2)]
    shapes = (
        np.sin(np.pi * np.outer(half_waves[:, 0], middles[0]))[:, :, None]
        * np.sin(np.pi * np.outer(half_waves[:, 1], middles[1]))[:, None, :]
    )
    pressure = get_pressure(
        velocity, shapes, rate, found.size, microphones, 0.4, maximum=450.0,
        air_density=1.2, sound_speed=343.0,
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
        room = thud.modal_room(thud.predict_level(impact, floor, thud.Room()))
        for _name, energy in (("floor", room.floor_energy), ("room", room.room_energy)):
            oracle(
                "modal room: energy into floor and room − energy lost",
                "balance",
                energy[:, 0] / energy[:, 1] - 1,
                1e-9,
            )
