"""The undamped rubber ball by CalculiX: an impact on a rigid floor, and a slow press.

    .venv/bin/python tests/bench/calculix.py    # both, the press against thud, some minutes

The half cross-section of the ball has 5 x 64 quadratic elements of a nearly incompressible
neo-Hookean material and touches a fixed slab; the press moves the equator of its lower half down by
half the approach of two plates. There is neither gravity nor gas. CalculiX has no viscoelasticity
at large strain: of the default law of thud's finite elements, it has the elastic part.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import warnings
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import thud

RADIUS, WALL, MASS = 0.089, 0.032, 2.5
MODULUS, POISSON = 1.6e6, 0.49
DENSITY = MASS / (4 / 3 * np.pi * (RADIUS**3 - (RADIUS - WALL) ** 3))
VELOCITY = np.sqrt(2 * 9.81 * 1.0)
THROUGH, ALONG = 5, 64
SLAB_HOLE, SLAB_RADIUS, SLAB_THICKNESS = 1e-3, 0.1, 0.01
# CalculiX expands axisymmetric elements to a wedge of two degrees and prints its sums.
WEDGES = 180
# It gives no initial velocity to the nodes of that wedge; a short gravity launches the ball.
LAUNCH = 1e-5
GAP = VELOCITY * LAUNCH / 2
# Approach of the plates of the press, m, its increments and the penalties of the contact, Pa/m.
DEFLECTION, INCREMENTS, PENALTIES = 0.04, 80, (1e9, 1e10, 1e11)


class CompetitorMissingError(RuntimeError):
    """CalculiX is not installed."""


def ball_lines(along: int) -> list[str]:
    """Return nodes, elements, sets and the outer face of the ball, that many elements upwards."""
    points = [(i, j) for i in range(2 * along + 1) for j in range(2 * THROUGH + 1)]
    numbers = {p: k for k, p in enumerate((p for p in points if p[0] * p[1] % 2 == 0), 1)}
    places = {}
    for (i, j), number in numbers.items():
        angle, radius = np.pi * i / (2 * ALONG), RADIUS - WALL + WALL * j / (2 * THROUGH)
        across = radius * np.sin(angle) if 0 < i < 2 * ALONG else 0.0
        places[number] = across, -radius * np.cos(angle)
    # The eight nodes in steps of angle and radius: counterclockwise, corners first.
    steps = ((0, 0), (0, 2), (2, 2), (2, 0), (0, 1), (1, 2), (2, 1), (1, 0))
    corners = [(i, j) for i in range(0, 2 * along, 2) for j in range(0, 2 * THROUGH, 2)]
    elements = [[numbers[i + a, j + b] for a, b in steps] for i, j in corners]
    return [
        "*NODE, NSET=BALL",
        *(f"{i}, {x:.12g}, {y:.12g}" for i, (x, y) in places.items()),
        "*ELEMENT, TYPE=CAX8R, ELSET=BALL",
        *(f"{i}, " + ", ".join(map(str, e)) for i, e in enumerate(elements, 1)),
        "*NSET, NSET=AXIS", *(f"{i}," for i, place in places.items() if place[0] == 0),
        "*NSET, NSET=EQUATOR", *(f"{i}," for i, (_, y) in places.items() if abs(y) < RADIUS / 1e6),
        "*SURFACE, NAME=OUTSIDE",
        *(f"{i}, S2" for i in range(THROUGH, THROUGH * ALONG // 2 + 1, THROUGH)),
    ]  # fmt: skip


def floor_lines() -> list[str]:
    """Return nodes, elements and the upper face of the floor.

    The innermost element is small because ccx finds no contact on its collapsed side.
    """
    nodes = 9001
    elements = THROUGH * ALONG + 1
    radii = (0, SLAB_HOLE / 2, SLAB_HOLE, (SLAB_HOLE + SLAB_RADIUS) / 2, SLAB_RADIUS)
    top = -RADIUS - GAP
    rows = ((radii, SLAB_THICKNESS), (radii, 0), (radii[::2], SLAB_THICKNESS / 2))
    places = [(r, top - depth) for row, depth in rows for r in row]
    corners = ((0, 2, 7, 5, 1, 11, 6, 10), (2, 4, 9, 7, 3, 12, 8, 11))
    return [
        "*NODE, NSET=FLOOR",
        *(f"{i}, {x:.12g}, {y:.12g}" for i, (x, y) in enumerate(places, nodes)),
        "*ELEMENT, TYPE=CAX8R, ELSET=FLOOR",
        *(f"{i}, " + ", ".join(str(nodes + k) for k in e) for i, e in enumerate(corners, elements)),
        "*SURFACE, NAME=TOP",
        *(f"{elements + i}, S3" for i in range(2)),
    ]


def run_calculix(directory: Path, along: int, penalty: float, *steps: str) -> str:
    """Run CalculiX in a directory; return what it prints of the ball, elements upwards, and floor.

    `penalty` is the pressure over the penetration of the floor, Pa/m: a layer of that stiffness.
    Raise CompetitorMissingError if ccx is not installed.
    """
    executable = shutil.which("ccx")
    if executable is None:
        message = "ccx is not installed"
        raise CompetitorMissingError(message)
    shear, bulk = MODULUS / (2 * (1 + POISSON)), MODULUS / (3 * (1 - 2 * POISSON))
    deck = "\n".join([
        *ball_lines(along), *floor_lines(),
        "*BOUNDARY", "AXIS, 1, 1", "FLOOR, 1, 2",
        "*MATERIAL, NAME=RUBBER",
        "*HYPERELASTIC, NEO HOOKE", f"{shear / 2:.12g}, {2 / bulk:.12g}",
        "*DENSITY", f"{DENSITY:.12g}",
        "*SOLID SECTION, ELSET=BALL, MATERIAL=RUBBER",
        "*MATERIAL, NAME=STEEL", "*ELASTIC", "2.1e11, 0.3", "*DENSITY", "7850",
        "*SOLID SECTION, ELSET=FLOOR, MATERIAL=STEEL",
        "*SURFACE INTERACTION, NAME=HARD",
        "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{penalty:g}",
        "*CONTACT PAIR, INTERACTION=HARD, TYPE=SURFACE TO SURFACE", "OUTSIDE, TOP",
        *steps, "*NODE PRINT, NSET=FLOOR, TOTALS=ONLY", "RF",
        "*END STEP", "",
    ])  # fmt: skip
    (directory / "ball.inp").write_text(deck, encoding="ascii")
    subprocess.run(
        [executable, "ball"], cwd=directory, check=False, stdout=subprocess.DEVNULL,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
    )  # fmt: skip
    return (directory / "ball.dat").read_text(encoding="ascii")


def read_totals(text: str) -> tuple[np.ndarray, np.ndarray]:
    """Return times, s, and the force of the floor on the whole ball, N."""
    blocks = re.findall(r"total force.* and time +(\S+)\s+\S+ +(\S+)", text)
    time, force = np.array(blocks, dtype=float).T
    return time, WEDGES * force


def calculix_impact(
    directory: Path, increment: float = 1e-4, duration: float = 0.03, penalty: float = 1e9
) -> tuple[np.ndarray, np.ndarray]:
    """Return time since touch, s, and force on the floor, N, of an impact by CalculiX.

    The time increment is fixed, s; the implicit method (Hilber, Hughes and Taylor) damps with
    alpha = -0.05. Raise RuntimeError if ccx stops before the end, which its exit status does not
    always tell.
    """
    count = round(duration / increment) + 1
    text = run_calculix(
        directory, ALONG, penalty,
        "*STEP, NLGEOM", "*DYNAMIC, DIRECT, ALPHA=0", f"{LAUNCH:g}, {LAUNCH:g}",
        "*DLOAD", f"BALL, GRAV, {VELOCITY / LAUNCH:.12g}, 0, -1, 0",
        "*END STEP",
        f"*STEP, NLGEOM, INC={count}",
        "*DYNAMIC, DIRECT, ALPHA=-0.05", f"{increment:g}, {duration:g}", "*DLOAD, OP=NEW",
    )  # fmt: skip
    time, force = (np.append(0.0, column) for column in read_totals(text))
    if len(time) != count:
        message = f"ccx stopped after {time[-1]:.3g} s"
        raise RuntimeError(message)
    time[1:] -= LAUNCH
    return time, force


def elastic_impact(penalty: float = 1e9) -> thud.Impact:
    """Return the same impact by thud's finite elements, 8 x 64, on a layer of that stiffness."""
    gravity = 1e-3
    drop = thud.Drop(VELOCITY**2 / (2 * gravity), gravity)
    ball = thud.Ball(youngs_modulus=MODULUS, poisson_ratio=POISSON, ambient_pressure=0)
    with warnings.catch_warnings():
        # The modulus is that of the paper's shell model, as for CalculiX.
        warnings.simplefilter("ignore", thud.PlausibilityWarning)
        return thud.solve(
            ball, drop, "finite_element", viscosity="none", snapshot_interval=0,
            layer_stiffness=penalty,
        )  # fmt: skip


def calculix_press(directory: Path, penalty: float) -> tuple[np.ndarray, np.ndarray]:
    """Return approach of the plates, m, and force, N."""
    text = run_calculix(
        directory, ALONG // 2, penalty,
        f"*STEP, NLGEOM, INC={INCREMENTS + 1}", "*STATIC, DIRECT", f"{1 / INCREMENTS:.12g}, 1",
        "*BOUNDARY", f"EQUATOR, 2, 2, {-(DEFLECTION / 2 + GAP):.12g}",
    )  # fmt: skip
    time, force = read_totals(text)
    return 2 * (time * (DEFLECTION / 2 + GAP) - GAP), np.abs(force)


def main() -> None:
    """Print contact time, restitution and levels of the impact, and the press at eight points."""
    with TemporaryDirectory() as name:
        time, force = calculix_impact(Path(name), 2e-5)
    contact = 1e3 * time[np.flatnonzero(force > 0)[-1]]
    restitution = np.trapezoid(force, time) / MASS / VELOCITY - 1
    levels = thud.force_exposure_levels(force, 1 / time[1])
    print(
        f"contact {contact:.2f} ms, e {restitution:.4f}", *(f"{level:.2f} dB" for level in levels)
    )
    points = DEFLECTION * np.arange(1, 9) / 8
    ball = thud.Ball(
        outer_radius=RADIUS, wall_thickness=WALL, youngs_modulus=MODULUS, poisson_ratio=POISSON
    )
    elastic = thud.FiniteElement(viscosity="none")
    curve = thud.compress(ball, elastic, max_deflection=DEFLECTION, points=9)
    print("mm      ", *(f"{1e3 * d:8.1f}" for d in points))
    print("thud, N ", *(f"{f:8.2f}" for f in curve.force[1:]))
    for penalty in PENALTIES:
        with TemporaryDirectory() as name:
            found = calculix_press(Path(name), penalty)
        print(f"{penalty:8.0e}", *(f"{f:8.2f}" for f in np.interp(points, *found)))


if __name__ == "__main__":
    main()
