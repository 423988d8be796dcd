"""Why the modal ball has no quadratic term: its first mode at the amplitude of the standard drop.

The mode is computed here anew, in NumPy, for incompressible material; then the strain energy of its
linear shape is integrated at finite strain. The numbers are those of docs/modal_ball.md.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial import legendre
from scipy.linalg import eigh

import thud

BALL = thud.Ball(youngs_modulus=1.6e6, poisson_ratio=0.5)
OUTER, INNER = BALL.outer_radius, BALL.outer_radius - BALL.wall_thickness
DENSITY = BALL.mass / (4 / 3 * np.pi * (OUTER**3 - INNER**3))
SHEAR = 1.6e6 / 3
N = 2
L = N * (N + 1)
DEGREE = 16


def first_mode() -> tuple[np.ndarray, ...]:
    """Return radii, weights, squared frequency, U, U', V, V' of the first mode of unit mass."""
    x, w = legendre.leggauss(40)
    half = (OUTER - INNER) / 2
    r = ((OUTER + INNER) / 2 + half * x)[:, None]
    w = w * half

    def derivative(order: int) -> np.ndarray:
        units = np.eye(DEGREE + 1)
        values = [legendre.legval(x, legendre.legder(unit, order)) for unit in units]
        return np.transpose(values) / half**order

    u, du, ddu = (derivative(order) for order in range(3))
    # Incompressible: V follows from U.
    v = (r * du + 2 * u) / L
    dv = (3 * du + r * ddu) / L

    def gram(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return (a.T * w) @ b

    area = 4 * np.pi / (2 * N + 1)
    shear = u + r * dv - v
    stiffness = area * 2 * SHEAR * (
        gram(r * du, r * du) + 2 * gram(u, u) - L * (gram(u, v) + gram(v, u))
        + L * (L - 1) * gram(v, v) + L / 2 * gram(shear, shear)
    )  # fmt: skip
    mass = area * DENSITY * (gram(r * u, r * u) + L * gram(r * v, r * v))
    squares, vectors = eigh((stiffness + stiffness.T) / 2, (mass + mass.T) / 2)
    return r, w, squares[0], *(shape @ vectors[:, 0] for shape in (u, du, v, dv))


@pytest.mark.parametrize("outwards", [1, -1])
def test_linear_shapes_do_not_keep_the_volume(outwards: int) -> None:
    r, w, square, u, du, v, dv = first_mode()
    # The same frequency as the library's, by another code.
    assert np.sqrt(square) / (2 * np.pi) == pytest.approx(65.2040, abs=1e-4)

    law = {"damping_law": "constant", "loss_factor": 0.1}
    impact = thud.solve(BALL, model="modal_ball", **law)  # type: ignore[call-overload]
    linear = impact.model_histories["energy_n2_J"].max()
    assert linear == pytest.approx(17, abs=0.1)
    # The poles move outwards where U is positive.
    q = outwards * np.sign(u[-1]) * np.sqrt(2 * linear / square)
    c, wc = legendre.leggauss(60)
    s = np.sqrt(1 - c**2)
    p = legendre.legval(c, np.eye(N + 1)[N])
    dp = -s * legendre.legval(c, legendre.legder(np.eye(N + 1)[N]))
    ddp = -c / s * dp - L * p

    u_r, u_t = q * np.outer(u, p), q * np.outer(v, dp)
    f_rr = 1 + q * np.outer(du, p)
    f_rt = (q * np.outer(u, dp) - u_t) / r
    f_tr = q * np.outer(dv, dp)
    f_tt = 1 + (q * np.outer(v, ddp) + u_r) / r
    f_pp = 1 + (u_r + u_t * c / s) / r
    volume = f_pp * (f_rr * f_tt - f_rt * f_tr)
    assert volume.min() == pytest.approx(0.96, abs=0.01)
    assert volume.max() == pytest.approx(1.055, abs=0.01)

    element = 2 * np.pi * np.outer(w * r[:, 0] ** 2, wc)
    invariant = f_rr**2 + f_rt**2 + f_tr**2 + f_tt**2 + f_pp**2
    shape_energy = np.sum(SHEAR / 2 * (volume ** (-2 / 3) * invariant - 3) * element)
    assert shape_energy / linear == pytest.approx(1.086 if outwards > 0 else 0.918, abs=0.005)
    bulk_modulus = BALL.youngs_modulus / (3 * (1 - 2 * 0.4999))
    volume_energy = np.sum(bulk_modulus / 2 * (volume - 1) ** 2 * element)
    assert 1500 < volume_energy < 2000
