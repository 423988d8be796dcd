"""The finite elements of plates against closed forms and published frequencies."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import mindlin_plate
import numpy as np
import pytest
from mindlin_plate import ThickPlate, assemble_thick, get_thick_modes
from plate_elements import (
    CLAMPED,
    FREE,
    SUPPORTED,
    Edge,
    Layer,
    LineSpring,
    Plate,
    Rib,
    assemble,
    get_grid,
    get_modal_loss,
    get_modes,
    get_point_mobility,
    get_response,
    isotropic_plate,
)
from scipy.optimize import brentq

if TYPE_CHECKING:
    from numpy.typing import NDArray

LENGTH, WIDTH = 3.0, 2.0
ORTHOTROPIC = Plate(d11=6e7, d12=4e6, d22=1.5e7, d66=7e6, mass=2000.0, loss_factor=0.03)
# Omega a**2 sqrt(m''/D) of square plates with a Poisson ratio of 0.3 (Leissa 1973, J. Sound Vib.
# 31, 257-293, by a Ritz method: upper bounds).
LEISSA_CLAMPED = (35.992, 73.413, 73.413, 108.27, 131.64, 132.24)
LEISSA_FREE = (13.489, 19.789, 24.432, 35.024, 35.024, 61.526)


def navier(count: int = 60) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return squared angular frequencies of the supported orthotropic plate, and half-waves."""
    m, n = np.meshgrid(np.arange(1, count), np.arange(1, count), indexing="ij")
    p, q = m * np.pi / LENGTH, n * np.pi / WIDTH
    plate = ORTHOTROPIC
    twist = plate.d12 + 2 * plate.d66
    square = plate.d11 * p**4 + 2 * twist * p**2 * q**2 + plate.d22 * q**4
    return square / plate.mass, np.stack([p, q])


def grid(size: float, *at: tuple[float, float]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the nodes of the orthotropic plate."""
    x, y = zip(*at, strict=True) if at else ((), ())
    return get_grid(LENGTH, size, x), get_grid(WIDTH, size, y)


def test_supported_orthotropic_plate_has_the_closed_form_to_the_fourth_order() -> None:
    exact = np.sqrt(np.sort(navier()[0].ravel())[:15]) / (2 * np.pi)
    errors = [
        get_modes(assemble(*grid(size), [ORTHOTROPIC]), 15)[0] / exact - 1 for size in (0.2, 0.1)
    ]
    assert (errors[0] > 0).all()
    # Of a beam, (k h)**4/1440, with five half-waves along the width at most.
    assert errors[1].max() < (5 * np.pi / WIDTH * 0.1) ** 4 / 1440
    assert np.log2(errors[0][-1] / errors[1][-1]) == pytest.approx(4, abs=0.1)


def test_clamped_and_free_plates_have_published_frequencies() -> None:
    nodes = get_grid(1.0, 1 / 14)
    found = {}
    for edge in (CLAMPED, FREE):
        plate = isotropic_plate(1, 0.3, 1, (edge,) * 4)
        found[edge] = 2 * np.pi * get_modes(assemble(nodes, nodes, [plate]), 9)[0]
    assert found[CLAMPED][:6] == pytest.approx(LEISSA_CLAMPED, rel=6e-4)
    assert found[FREE][:3] == pytest.approx(0, abs=0.01)
    # His products of beam functions of free plates converge slowly.
    ratio = found[FREE][3:] / LEISSA_FREE
    assert (ratio < 1).all()
    assert (ratio > 0.99).all()


@pytest.mark.parametrize(
    ("low", "high"),
    [
        (Edge(300.0, 20.0), Edge(50.0, 3.0)),
        (Edge(np.inf, 5.0), FREE),
        (CLAMPED, Edge(0.0, 4.0)),
        (CLAMPED, CLAMPED),
    ],
)
def test_elastic_edges_are_those_of_a_beam_on_springs(low: Edge, high: Edge) -> None:
    """Without Poisson's ratio, a plate with two free edges has the modes of a beam."""
    plate = isotropic_plate(1.0, 0.0, 1.0, (low, high, FREE, FREE))
    # So narrow that modes across are far above.
    system = assemble(get_grid(1.0, 0.025), get_grid(0.1, 0.1), [plate])
    found, vectors = get_modes(system, 12)
    ends = system.get_row([0.0, 0.3, 0.7, 1.0], np.zeros(4)) - system.get_row(
        [0.0, 0.3, 0.7, 1.0], np.full(4, 0.1)
    )
    bending = abs(ends @ vectors).max(axis=0) < 1e-6
    wave = np.sqrt(2 * np.pi * found[bending][:4])

    def determinant(k: float) -> float:
        rows = []
        for edge, x, sign in ((low, 0.0, 1), (high, 1.0, -1)):
            # cos, sin, and exponentials that decay from both ends.
            near, far = np.exp(-k * x), np.exp(k * (x - 1))
            c, s = np.cos(k * x), np.sin(k * x)
            w = np.array([c, s, near, far])
            slope = k * np.array([-s, c, -near, far])
            second = k**2 * np.array([-c, -s, near, far])
            third = k**3 * np.array([s, -c, -near, far])
            held = [np.isinf(edge.translation), np.isinf(edge.rotation)]
            rows.append(w if held[0] else edge.translation * w + sign * third)
            rows.append(slope if held[1] else edge.rotation * slope - sign * second)
        rows = [row / np.linalg.norm(row) for row in rows]
        return float(np.linalg.det(rows))

    for k in wave:
        assert determinant(k * (1 - 1e-5)) * determinant(k * (1 + 1e-5)) < 0


@pytest.mark.parametrize("shear_stiffness", [np.inf, 4e5])
def test_rib_on_a_weak_strip_is_a_beam_in_bending_and_torsion(shear_stiffness: float) -> None:
    """A supported Timoshenko beam: (E I k2 + S - J w2)(S k2 - m w2) = S2 k2, with k = n pi/l."""
    rib = Rib(
        along="x", at=0.02, bending=3e4, torsion=500.0, mass=6.0, torsional_inertia=0.02,
        shear_stiffness=shear_stiffness, rotary_inertia=0.1,
    )  # fmt: skip
    weak = isotropic_plate(1e-2, 0.3, 1e-4, (SUPPORTED, SUPPORTED, FREE, FREE))
    system = assemble(get_grid(2.0, 0.1), get_grid(0.04, 0.02), [weak], ribs=[rib])
    found, vectors = get_modes(system, 14)
    line = np.linspace(0.1, 1.9, 19)
    twist = system.get_row(line, np.full(19, 0.02), y_order=1) @ vectors * 0.02
    bend = system.get_row(line, np.full(19, 0.02)) @ vectors
    twisted = abs(twist).max(axis=0) > abs(bend).max(axis=0)
    k = np.arange(1, 4) * np.pi / 2.0
    assert found[twisted][:2] == pytest.approx(np.sqrt(500 / 0.02) * k[:2] / (2 * np.pi), rel=1e-3)
    if np.isinf(shear_stiffness):
        square = 3e4 * k**4 / 6.0
    else:
        s, i = shear_stiffness, 0.1
        middle = 6.0 * (3e4 * k**2 + s) + i * s * k**2
        square = middle - np.sqrt(middle**2 - 4 * i * 6.0 * 3e4 * s * k**4)
        square /= 2 * i * 6.0
    assert found[~twisted][:3] == pytest.approx(np.sqrt(square) / (2 * np.pi), rel=1e-4)


def test_clamped_rib_with_shear_is_a_strip_of_mindlins_plate() -> None:
    width, shear, inertia = 0.04, 4e5, 0.1
    rib = Rib(
        along="y", at=width / 2, bending=3e4, torsion=1e7, mass=6.0, torsional_inertia=0.02,
        shear_stiffness=shear, rotary_inertia=inertia,
    )  # fmt: skip
    weak = isotropic_plate(1e-2, 0.3, 1e-4, (FREE, FREE, CLAMPED, FREE))
    # The plate has no slope at the edge, a clamped beam with shear has one: a layer of the edge.
    nodes = np.r_[0.0, 0.1 * 4.0 ** np.arange(-5, 0), np.linspace(0.1, 2.0, 20)]
    found, _ = get_modes(assemble(get_grid(width, 0.02), nodes, [weak], ribs=[rib]), 3)
    # Rigid across; modes of twist are left out.
    strip = ThickPlate(
        2.0, width, 3e4 / width, 0.0, 1e9, 1e9, shear / width, 1e9, 6.0 / width, inertia / width
    )
    edges = mindlin_plate.CLAMPED, *(mindlin_plate.FREE,) * 3
    expected, shapes = get_thick_modes(assemble_thick(strip, edges, 12), 20)
    even = np.ptp(shapes, axis=2).max(axis=1) < 1e-3 * abs(shapes).max((1, 2))
    assert found == pytest.approx(expected[even][:3], rel=1e-4)


def test_losses_of_edges_are_those_of_their_energy() -> None:
    """The loss factor of a mode is that of the edge times d ln(w**2)/d ln(k)."""
    edge, step = Edge(3e7, 2e7, 0.4), 1e-3
    systems = [
        assemble(*grid(0.25), [replace(ORTHOTROPIC, loss_factor=0.0, edges=(spring,) * 4)])
        for spring in (
            edge, *(Edge(3e7 * scale, 2e7 * scale) for scale in (1 - step, 1 + step)),
        )
    ]  # fmt: skip
    modes = [get_modes(system, 6) for system in systems]
    slope = np.log(modes[2][0] / modes[1][0]) / step
    assert slope.max() > 0.5
    assert get_modal_loss(systems[0], modes[0][1]) == pytest.approx(0.4 * slope, rel=1e-4)


def test_equal_plates_on_a_layer_move_together_or_against_each_other() -> None:
    stiffness, plates = 3e8, [ORTHOTROPIC, ORTHOTROPIC]
    system = assemble(*grid(0.2), plates, layer=Layer(stiffness, 0.2))
    found, vectors = get_modes(system, 12)
    square = np.sort(navier()[0].ravel())[:12]
    together, against = square, square + 2 * stiffness / ORTHOTROPIC.mass
    expected = np.sort(np.r_[together, against])[:12]
    assert found == pytest.approx(np.sqrt(expected) / (2 * np.pi), rel=1e-3)
    loss = get_modal_loss(system, vectors)
    share = 2 * stiffness / ORTHOTROPIC.mass / expected * np.isin(expected, against)
    assert share.max() > 0.5
    assert loss == pytest.approx(0.03 * (1 - share) + 0.2 * share, rel=2e-3)


@pytest.mark.parametrize("kind", ["translation", "rotation"])
def test_line_springs_shift_frequencies_as_the_modal_sum_says(kind: str) -> None:
    """Along y at x0, half-waves along y stay apart: 1/k + sum over m as for a point."""
    at, stiffness = 0.8, 3e8
    square, (p, _) = navier(2000 if kind == "rotation" else 300)
    own, p = square[:, 0], p[:, 0]
    shape = np.sin(p * at) if kind == "translation" else p * np.cos(p * at)
    weight = shape**2 / (ORTHOTROPIC.mass * LENGTH / 2)
    expected = brentq(
        lambda value: 1 / stiffness + (weight / (own - value)).sum(),
        own[0] * (1 + 1e-9), own[1] * (1 - 1e-9),
    )  # fmt: skip
    line = LineSpring("y", at, **{kind: stiffness})
    found, _ = get_modes(assemble(*grid(0.1, (at, 1.0)), [ORTHOTROPIC], lines=[line]), 6)
    assert expected > 1.2 * own[0]
    # The sum for rotations converges with 1/count.
    assert found[0] == pytest.approx(np.sqrt(expected) / (2 * np.pi), rel=3e-4)


def test_mobility_is_the_modal_sum_with_losses() -> None:
    point, other = (1.1, 0.7), (2.0, 1.5)
    frequency = np.array([20.0, 60.0, 111.0, 250.0])
    square, (p, q) = navier(400)
    shapes = [np.sin(p * x) * np.sin(q * y) for x, y in (point, other)]
    omega = 2 * np.pi * frequency[:, None, None]
    dynamic = ORTHOTROPIC.mass * LENGTH * WIDTH / 4 * (square * (1 + 0.03j) - omega**2)
    system = assemble(*grid(0.1, point, other), [ORTHOTROPIC])
    found = get_point_mobility(system, frequency, *point)[:, 0]
    expected = (1j * omega * shapes[0] ** 2 / dynamic).sum((1, 2))
    # Statically, the deflection below the force is 0.5 % too small.
    assert found.real == pytest.approx(expected.real, rel=2e-3)
    assert abs(found / expected - 1).max() < 6e-3
    rows = [system.get_row(*at) for at in (point, other)]
    transfer = get_response(system, frequency, rows[0].T, output=rows[1])[:, 0, 0]
    expected = (1j * omega * shapes[0] * shapes[1] / dynamic).sum((1, 2))
    assert abs(transfer / expected - 1).max() < 1e-3
