"""Floors by the modes of the independent finite elements: mobility, radiation and room."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
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
    system = elements((CLAMPED, SUPPORTED, FREE, SUPPORTED))
    floor = write_modes(tmp_path / "modes.csv", system, 900)
    frequency = np.geomspace(18, 450, 160)
    at = np.array([SOURCE[0] * LENGTH]), np.array([SOURCE[1] * WIDTH])
    exact = get_point_mobility(system, frequency, *at)[:, 0]
    given = thud.mobility(floor, frequency)
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
    assert given.modal_level[modal] == pytest.approx(exact.modal_level[modal], abs=0.1)


def test_input_holds_the_modes_of_the_elements(tmp_path: Path) -> None:
    system = elements((CLAMPED, SUPPORTED, CLAMPED, SUPPORTED))
    floor = write_modes(tmp_path / "modes.csv", system, 770, (21, 17))
    stated = thud.read_case(INPUT).floor
    assert isinstance(stated, thud.ModalFloor)
    frequency = np.geomspace(18, 708, 300)
    assert thud.mobility(stated, frequency) == pytest.approx(
        thud.mobility(floor, frequency), rel=5e-3
    )
