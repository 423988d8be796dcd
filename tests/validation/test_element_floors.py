"""Floors by the modes of the independent finite elements: mobility, radiation and room."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from baffled_plate import band_points
from joists import JoistFloor
from plate_elements import (
    CLAMPED,
    FREE,
    SUPPORTED,
    Edge,
    System,
    assemble,
    get_grid,
    get_modes,
    get_point_mobility,
    isotropic_plate,
)

import thud
from thud.base.bridge import ask
from thud.case.case import case_text

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

INPUT = Path(__file__).parents[2] / "inputs/floors/modal_slab.nml"
LENGTH, WIDTH, THICKNESS, DENSITY, WAVE_SPEED, LOSS = 4.5, 3.6, 0.14, 2300.0, 3500.0, 0.03
MASS = DENSITY * THICKNESS
STIFFNESS = MASS * (WAVE_SPEED * THICKNESS) ** 2 / 12
SOURCE = (0.4, 0.35)
ROOM = thud.Room(height=2.5)


def elements(edges: tuple[Edge, Edge, Edge, Edge], size: float = 0.15) -> System:
    """Return the elements of the slab, with a complex stiffness."""
    # Poisson's ratio of the plates of thud.
    plate = isotropic_plate(STIFFNESS, 0.2, MASS, edges, LOSS)
    return assemble(get_grid(LENGTH, size), get_grid(WIDTH, size), [plate])


def write_modes(
    path: Path, system: System, highest: float, points: tuple[int, int] = (31, 25),
    plate: thud.Plate | None = None,
) -> thud.ModalFloor:  # fmt: skip
    """Write the modes of the elements up to a frequency, and return the floor.

    The losses are those of the modes of a plate, with radiation, or the loss factor.
    """
    frequency, vectors = get_modes(system, 60)
    kept = (frequency > 1) & (frequency < highest)
    assert frequency[-1] > highest
    x, y = np.linspace(0, LENGTH, points[0]), np.linspace(0, WIDTH, points[1])
    at = (axis.ravel() for axis in np.meshgrid(x, y, indexing="ij"))
    shape = (system.get_row(*at) @ vectors[:, kept]).T.reshape(-1, *points)
    loss = np.full(len(frequency), LOSS)
    if plate:
        answer = ask("floor_modes", case=case_text(thud.Case(floor=plate, room=ROOM)), highest=2e3)
        assert answer["frequency"][:40] == pytest.approx(frequency[:40], rel=2e-3)
        loss = answer["loss_factor"][: len(frequency)]
    thud.write_floor_modes(path, frequency[kept], loss[kept], x=x, y=y, shape=shape)
    return thud.ModalFloor(
        file=str(path), source_x=SOURCE[0], source_y=SOURCE[1], thickness=THICKNESS,
        density=DENSITY, wave_speed=WAVE_SPEED,
    )  # fmt: skip


def test_modes_of_elements_have_the_mobility_of_their_direct_solution(tmp_path: Path) -> None:
    # A free edge: shapes that end with a deflection.
    system = elements((CLAMPED, SUPPORTED, FREE, SUPPORTED), 0.2)
    floor = write_modes(tmp_path / "modes.csv", system, 900)
    frequency = np.geomspace(18, 450, 80)
    exact = get_point_mobility(system, frequency, SOURCE[0] * LENGTH, SOURCE[1] * WIDTH)[:, 0]
    given = thud.mobility(floor, frequency).values
    bands = thud.get_bands("third")
    for low, high in zip(bands.lower[2:-2], bands.upper[2:-2], strict=True):
        inside = (frequency >= low) & (frequency < high)
        if low < frequency[0] or high > frequency[-1]:
            continue
        # Dashpots instead of a complex stiffness, and the mean compliance of the higher modes.
        change = 10 * np.log10(given.real[inside].mean() / exact.real[inside].mean())
        assert abs(change) < 0.5, low
        error = np.linalg.norm((given - exact)[inside]) / np.linalg.norm(exact[inside])
        assert error < 0.05, low


def test_clamped_elements_radiate_like_the_clamped_plate(tmp_path: Path) -> None:
    plate = thud.Plate(
        length=LENGTH, width=WIDTH, thickness=THICKNESS, support="clamped", edges="absorption",
        loss_factor=LOSS, source_x=SOURCE[0], source_y=SOURCE[1],
    )  # fmt: skip
    floor = write_modes(tmp_path / "modes.csv", elements((CLAMPED,) * 4), 1000, plate=plate)
    given, exact = (
        ask("radiation", case=case_text(thud.Case(floor=each, room=ROOM)))
        for each in (floor, plate)
    )
    sigma = 10 * np.log10(given["radiation_factor"] / exact["radiation_factor"])
    assert np.abs(sigma).max() < 0.1
    given, exact = (thud.predict_level(floor=each, room=ROOM) for each in (floor, plate))
    modal = slice(0, exact.n_modal)
    assert given.n_modal == exact.n_modal
    assert given.level[modal] == pytest.approx(exact.level[modal], abs=0.1)


def test_input_holds_the_modes_of_the_elements(tmp_path: Path) -> None:
    system = elements((CLAMPED, SUPPORTED, CLAMPED, SUPPORTED))
    floor = write_modes(tmp_path / "modes.csv", system, 770, (21, 17))
    stated = thud.read_case(INPUT).floor
    assert isinstance(stated, thud.ModalFloor)
    frequency = np.geomspace(18, 708, 300)
    assert thud.mobility(stated, frequency).values == pytest.approx(
        thud.mobility(floor, frequency).values, rel=5e-3
    )


@pytest.mark.parametrize("edge", [SUPPORTED, CLAMPED])
def test_joist_floors_with_coupled_modes_are_as_compliant_as_elements(edge: Edge) -> None:
    """Receivers of such floors added the compliance above the last mode twice, and on joists."""
    floor = JoistFloor()
    points = np.array([(1.7, 2.3), (1.7, 2.1)])
    plate = isotropic_plate(
        floor.stiffness, 0.2, floor.mass, (edge,) * 4, loss_factor=floor.loss_factor
    )
    x = get_grid(floor.length, 0.08, [1.7])
    y = get_grid(floor.width, 0.08, [*floor.positions, 2.1])
    joist = replace(floor.joist, rotary_inertia=0.0)
    system = assemble(x, y, [plate], joist=joist, joists=floor.positions)
    frequency = np.concatenate([[0.1], band_points(100, 4), band_points(315, 4)])
    exact = get_point_mobility(system, frequency, *points.T)
    for j, (x_at, y_at) in enumerate(points):
        given = thud.mobility(
            thud.JoistFloor(
                support="simple" if edge is SUPPORTED else "clamped", source_on="position",
                source_x=x_at / floor.length, source_y=y_at / floor.width,
            ),
            frequency,
        ).values  # fmt: skip
        # Elements are up to 0.6 % too stiff at a force.
        assert given[0].imag == pytest.approx(exact[0, j].imag, rel=0.015)
        change = given.real[1:].reshape(2, -1).mean(1) / exact[1:, j].real.reshape(2, -1).mean(1)
        # Up to 1 dB: springs of the elements have losses below their resonance, dashpots hardly.
        assert np.abs(10 * np.log10(change)).max() < 1.2
        assert (given.real >= 0).all()


@pytest.mark.parametrize("side", [2.0, 4.5])
def test_clamped_plates_have_the_compliance_of_the_closed_form(side: float) -> None:
    """The compliance above the last mode was added twice: 14 % for a small plate."""
    frequency = np.array([0.1])
    floor = thud.Plate(
        length=side, width=side, thickness=THICKNESS, density=DENSITY, wave_speed=WAVE_SPEED,
        support="clamped",
    )  # fmt: skip
    # 0.00560 F side**2/B in the middle (Timoshenko and Woinowsky-Krieger); Ritz's method with up to
    # 28 x 28 symmetric polynomials, extrapolated, gives the further digits.
    static = 2 * np.pi * frequency * 0.005612 * side**2 / STIFFNESS
    assert thud.mobility(floor, frequency).values.imag == pytest.approx(static, rel=1e-3)
