"""Print the tables of docs/finite_elements.md: convergence, or damping laws.

    .venv/bin/python tests/bench/finite_element_tables.py convergence | laws [ELEMENTS...]

For each damping law, the loss factor that gives the restitution of the flagship, by the secant
method, with so many elements through the wall.
"""

from __future__ import annotations

import sys
from typing import Any

import thud

# The law whose high octaves are the strongest, and converge last.
LAW = {"viscosity": "kelvin_voigt", "loss_factor": 0.2}
MESHES = [{"radial_elements": n, "polar_elements": 8 * n} for n in (4, 6, 8, 12, 16, 24)]
# Studies by name, each with its height of fall, m, and its runs.
STUDIES: dict[str, tuple[float, list[dict[str, Any]]]] = {
    "mesh, 0.1 m": (0.1, MESHES),
    "mesh, 1 m": (1.0, MESHES),
    "mesh, 1.6 m": (1.6, MESHES),
    "mesh, around": (1.0, [{"polar_elements": n} for n in (96, 128, 192)]),
    "bulk modulus": (1.0, [{"bulk_ratio": r} for r in (49.67, 100, 200, 499.7, 1000, 2000)]),
    "step": (1.0, [{"step_safety": s} for s in (0.95, 0.85, 0.4, 0.2, 0.1)]),
    "friction": (1.0, [{"friction": f} for f in (0, 0.1, 0.3, 0.6, 1, 100)]),
    "layer": (1.0, [{"layer_stiffness": k} for k in (2e8, 5e8, 1e9, 4e9, 1e10, 1e11)]),
    "layer, mesh": (1.0, [{"layer_stiffness": 1e9} | mesh for mesh in MESHES[1:5]]),
    "material": (
        1.0,
        [
            {"law": "mooney_rivlin"},
            {"loss_factor": 0.15},
            {"viscosity": "constant_loss"},
            {"viscosity": "constant_loss", "loss_factor": 0.13},
        ],
    ),
}
# Restitution of the flagship, close enough for the last digit of the table.
RESTITUTION, CLOSE = 0.805, 2e-5
ORDERS = (0.15, 0.2, 0.3, 0.5, 0.7, 1.0)


def drop(height: float, modulus: float, options: dict[str, Any]) -> thud.Impact:
    """Return a drop by finite elements."""
    ball = thud.Ball(youngs_modulus=modulus)
    return thud.solve(ball, thud.Drop(height), "finite_element", snapshot_interval=0, **options)


def row(impact: thud.Impact, *cells: object) -> None:
    """Print a row."""
    levels = " | ".join(f"{level:.2f}" for level in impact.levels())
    print("|", *(f"{cell} |" for cell in cells), f"{1e3 * impact.contact_time:.2f} |",
          f"{impact.restitution:.4f} | {levels} | {impact.energy_residual:.0e} |",
          flush=True)  # fmt: skip


def fitted_law(elements: int, modulus: float, order: float) -> tuple[float, thud.Impact]:
    """Return the loss factor of a fractional law that gives the restitution, and its drop."""
    mesh = {"radial_elements": elements, "polar_elements": 8 * elements}
    law = {"viscosity": "fractional", "fractional_order": order} | mesh
    last, here = 0.12, 0.14
    before, found = (drop(1.0, modulus, law | {"loss_factor": x}) for x in (last, here))
    while abs(found.restitution - RESTITUTION) > CLOSE:
        slope = (found.restitution - before.restitution) / (here - last)
        last, here = here, here + (RESTITUTION - found.restitution) / slope
        before, found = found, drop(1.0, modulus, law | {"loss_factor": here})
    return here, found


def main() -> None:
    """Print one row for each run."""
    print("| varied | value | contact, ms | e | 31.5 | 63 | 125 | 250 | 500 Hz | energy off by |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    if sys.argv[1] == "convergence":
        for study, (height, runs) in STUDIES.items():
            for options in runs:
                row(drop(height, 2.08e6, LAW | options), study, *options.values())
    else:
        for elements in map(int, sys.argv[2:] or ["8"]):
            for modulus in (2.08e6, 1.6e6):
                for order in ORDERS:
                    loss, impact = fitted_law(elements, modulus, order)
                    row(
                        impact, f"{elements}, {modulus / 1e6:g} MPa, order {order:g}", f"{loss:.4f}"
                    )


if __name__ == "__main__":
    main()
