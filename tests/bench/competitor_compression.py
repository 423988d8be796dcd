"""Slow compression of the rubber ball between two plates by CalculiX, against thud.

The lower half of the ball of `competitor_impact` (quadratic elements, nearly incompressible,
neo-Hookean, no gas) is pressed on the same fixed slab by its equator, which moves down by half the
approach of the plates. Run it with the project's Python; it takes some minutes.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from competitor_impact import (
    ALONG,
    GAP,
    MODULUS,
    POISSON,
    RADIUS,
    THROUGH,
    WALL,
    WEDGES,
    ball_lines,
    floor_lines,
)

import thud

DEFLECTION = 0.04
INCREMENTS = 80
PENALTIES = (1e9, 1e10, 1e11)


def lower_half() -> list[str]:
    """Return the lines of the ball below its equator, and the equator as a set of nodes."""
    lines = ball_lines()
    head = next(i for i, line in enumerate(lines) if line.startswith("*ELEMENT"))
    tail = next(i for i, line in enumerate(lines) if line.startswith("*NSET"))
    elements = lines[head + 1 : tail][: THROUGH * ALONG // 2]
    used = {int(number) for line in elements for number in line.split(",")[1:]}
    nodes = [line for line in lines[1:head] if int(line.split(",")[0]) in used]
    places = {int(n): (float(x), float(y)) for n, x, y in (line.split(",") for line in nodes)}
    return [
        lines[0], *nodes, lines[head], *elements,
        "*NSET, NSET=AXIS", *(f"{n}," for n, (x, _) in places.items() if x == 0),
        "*NSET, NSET=EQUATOR", *(f"{n}," for n, (_, y) in places.items() if abs(y) < RADIUS / 1e6),
        "*SURFACE, NAME=OUTSIDE", *(f"{i}, S2" for i in range(THROUGH, len(elements) + 1, THROUGH)),
    ]  # fmt: skip


def deck(penalty: float) -> str:
    """Return the input of CalculiX."""
    shear, bulk = MODULUS / (2 * (1 + POISSON)), MODULUS / (3 * (1 - 2 * POISSON))
    return "\n".join([
        *lower_half(),
        *floor_lines(),
        "*BOUNDARY", "AXIS, 1, 1", "FLOOR, 1, 2",
        "*MATERIAL, NAME=RUBBER",
        "*HYPERELASTIC, NEO HOOKE", f"{shear / 2:.12g}, {2 / bulk:.12g}",
        "*SOLID SECTION, ELSET=BALL, MATERIAL=RUBBER",
        "*MATERIAL, NAME=STEEL",
        "*ELASTIC", "2.1e11, 0.3",
        "*SOLID SECTION, ELSET=FLOOR, MATERIAL=STEEL",
        "*SURFACE INTERACTION, NAME=HARD",
        "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{penalty:g}",
        "*CONTACT PAIR, INTERACTION=HARD, TYPE=SURFACE TO SURFACE", "OUTSIDE, TOP",
        f"*STEP, NLGEOM, INC={INCREMENTS + 1}",
        "*STATIC, DIRECT", f"{1 / INCREMENTS:.12g}, 1",
        "*BOUNDARY", f"EQUATOR, 2, 2, {-(DEFLECTION / 2 + GAP):.12g}",
        "*NODE PRINT, NSET=FLOOR, TOTALS=ONLY", "RF",
        "*END STEP", "",
    ])  # fmt: skip


def calculix_curve(folder: Path, penalty: float) -> tuple[np.ndarray, np.ndarray]:
    """Return approach of the plates, m, and force, N."""
    (folder / "press.inp").write_text(deck(penalty), encoding="ascii")
    executable = shutil.which("ccx")
    if executable is None:
        sys.exit("ccx is not installed")
    subprocess.run([executable, "press"], cwd=folder, check=False, stdout=subprocess.DEVNULL)
    rows = (folder / "press.dat").read_text(encoding="ascii").split("total force")[1:]
    times = np.array([float(row.split("time")[1].split()[0]) for row in rows])
    forces = np.array([float(row.split()[-2]) for row in rows])
    return 2 * (times * (DEFLECTION / 2 + GAP) - GAP), np.abs(WEDGES * forces)


def main() -> None:
    """Print both curves at eight points."""
    points = DEFLECTION * np.arange(1, 9) / 8
    ball = thud.Ball(outer_radius=RADIUS, wall_thickness=WALL, poisson_ratio=POISSON)
    # Its long-term modulus is that of the ball.
    model = thud.FiniteElement(viscosity="kelvin_voigt")
    curve = thud.compress(ball, model, max_deflection=DEFLECTION, points=9)
    print("mm      ", *(f"{1e3 * d:8.1f}" for d in points))
    print("thud, N ", *(f"{f:8.2f}" for f in curve.force[1:]))
    for penalty in PENALTIES:
        with TemporaryDirectory() as name:
            found = calculix_curve(Path(name), penalty)
        print(f"{penalty:8.0e}", *(f"{f:8.2f}" for f in np.interp(points, *found)))


if __name__ == "__main__":
    main()
