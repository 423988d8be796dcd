"""Print the convergence table of docs/finite_elements.md: run with .venv/bin/python."""

from __future__ import annotations

import thud

FLAGSHIP = thud.Ball(youngs_modulus=2.08e6)
# The law whose high octaves are the strongest, and converge last.
LAW = {"viscosity": "kelvin_voigt", "loss_factor": 0.2}
STUDIES = {
    "mesh": [{"radial_elements": n, "polar_elements": 8 * n} for n in (4, 6, 8, 12, 16, 24)],
    "mesh, around": [{"polar_elements": n} for n in (96, 128, 192)],
    "bulk modulus": [{"bulk_ratio": r} for r in (49.67, 100, 200, 499.7, 1000, 2000)],
    "step": [{"step_safety": s} for s in (0.95, 0.85, 0.4, 0.2, 0.1)],
    "contact": [
        {"treatment": "impulse"},
        *({"treatment": "penalty", "penalty_ratio": r} for r in (1, 3, 10, 30)),
    ],
    "material": [
        {"law": "mooney_rivlin"},
        {"loss_factor": 0.15},
        {"viscosity": "constant_loss"},
        {"viscosity": "constant_loss", "loss_factor": 0.13},
    ],
}


def main() -> None:
    """Print one row for each run."""
    print("| varied | value | contact, ms | e | 31.5 | 63 | 125 | 250 | 500 Hz | energy off by |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for study, runs in STUDIES.items():
        for options in runs:
            found = thud.solve(
                FLAGSHIP, model="finite_element", snapshot_interval=0, **{**LAW, **options}
            )
            value = ", ".join(f"{v}" for v in options.values())
            levels = " | ".join(f"{level:.2f}" for level in found.levels())
            print(
                f"| {study} | {value} | {1e3 * found.contact_time:.2f} | {found.restitution:.4f} "
                f"| {levels} | {found.energy_residual:.0e} |",
                flush=True,
            )


main()
