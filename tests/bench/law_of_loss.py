"""Print the table of the damping laws in docs/finite_elements.md: run with .venv/bin/python.

For each law the loss factor that gives the restitution of the flagship, by the secant method.
"""

from __future__ import annotations

import sys

import thud

RESTITUTION = 0.805
# Small enough for the last digit of the table.
CLOSE = 2e-5
ORDERS = (0.15, 0.2, 0.3, 0.5, 0.7, 1.0)
MODULI = (2.08e6, 1.6e6)


def main() -> None:
    """Print one row for each law, modulus and mesh; the argument is the number of elements."""
    for radial_elements in map(int, sys.argv[1:] or ["8"]):
        for modulus in MODULI:
            for order in ORDERS:
                row(radial_elements, modulus, order)


def row(radial_elements: int, modulus: float, order: float) -> None:
    """Print the row of one law."""

    def drop(loss_factor: float) -> thud.Impact:
        return thud.solve(
            thud.Ball(youngs_modulus=modulus),
            model="finite_element",
            viscosity="fractional",
            fractional_order=order,
            loss_factor=loss_factor,
            radial_elements=radial_elements,
            polar_elements=8 * radial_elements,
            snapshot_interval=0,
        )

    last, here = 0.12, 0.14
    before, found = drop(last), drop(here)
    while abs(found.restitution - RESTITUTION) > CLOSE:
        slope = (found.restitution - before.restitution) / (here - last)
        last, here = here, here + (RESTITUTION - found.restitution) / slope
        before, found = found, drop(here)
    levels = " | ".join(f"{level:.2f}" for level in found.levels())
    print(
        f"| {radial_elements}, {8 * radial_elements} | {modulus / 1e6:g} | {order:g} | {here:.4f} "
        f"| {1e3 * found.contact_time:.2f} | {levels} |",
        flush=True,
    )


main()
