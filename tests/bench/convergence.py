"""Print the tables of docs/finite_elements.md: run with .venv/bin/python."""

from __future__ import annotations

import thud

FLAGSHIP = thud.Ball(youngs_modulus=2.08e6)
# The law whose high octaves are the strongest, and converge last.
LAW = {"viscosity": "kelvin_voigt", "loss_factor": 0.2}
MESHES = [{"radial_elements": n, "polar_elements": 8 * n} for n in (4, 6, 8, 12, 16, 24)]
# Studies by name, each with its height of fall, m, and its runs.
STUDIES = {
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


def main() -> None:
    """Print one row for each run."""
    print("| varied | value | contact, ms | e | 31.5 | 63 | 125 | 250 | 500 Hz | energy off by |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for study, (height, runs) in STUDIES.items():
        for options in runs:
            found = thud.solve(
                FLAGSHIP,
                thud.Drop(height),
                "finite_element",
                snapshot_interval=0,
                **{**LAW, **options},
            )
            value = ", ".join(f"{v}" for v in options.values())
            levels = " | ".join(f"{level:.2f}" for level in found.levels())
            print(
                f"| {study} | {value} | {1e3 * found.contact_time:.2f} | {found.restitution:.4f} "
                f"| {levels} | {found.energy_residual:.0e} |",
                flush=True,
            )


main()
