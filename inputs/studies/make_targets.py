"""Synthetic targets of the fits beside this file.

.venv/bin/python inputs/studies/make_targets.py

writes fit_force.csv and prints the levels of fit_levels.toml; the noise comes from NumPy's
default generator with the seeds below.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import thud

SEED_FORCE, SEED_LEVELS = 1, 2
NOISE = 5.0  # N
UNCERTAINTY = np.array([0.2, 0.2, 0.3, 0.4, 0.5])  # dB
TRUTH = thud.Ball(youngs_modulus=1.75e6)


def main() -> None:
    """Write the force and print the levels."""
    impact = thud.solve(TRUTH, model="modal_ball", damping_law="rising", loss_factor=0.18)
    random = np.random.default_rng(SEED_FORCE)
    # A force plate begins to record before the ball is there: first touch at 10 ms.
    start, count = 441, 2646
    force = random.normal(scale=NOISE, size=count)
    force[start : start + len(impact.time)] += impact.floor_force[: count - start]
    rows = [f"{i / impact.sample_rate:.9f},{value:.3f}\n" for i, value in enumerate(force)]
    head = (
        "# Synthetic: modal_ball with rising loss factor 0.18 at 74 Hz, E = 1.75 MPa, first touch\n"
        f"# at 10 ms, noise of {NOISE:g} N, seed {SEED_FORCE}; made by make_targets.py.\n"
        "time_s,force_N\n"
    )
    path = Path(__file__).with_name("fit_force.csv")
    path.write_text(head + "".join(rows), encoding="utf-8")
    random = np.random.default_rng(SEED_LEVELS)
    levels = impact.levels(force="floor") + random.normal(scale=UNCERTAINTY)
    contact_time = 1e3 * impact.contact_time + random.normal(scale=0.1)
    restitution = impact.restitution + random.normal(scale=0.01)
    print("levels =", levels.round(2).tolist())
    print(f"contact_time = {contact_time:.2f} ms, restitution = {restitution:.3f}")


if __name__ == "__main__":
    main()
