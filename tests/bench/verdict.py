"""The verdict over what is not known of the standard ball against drops of the model itself.

.venv/bin/python tests/bench/verdict.py [DROPS]    # 2000 by default, 0.2 s each on a core
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import thud
from thud.level.levels import peak_count

CASE = Path(__file__).parents[2] / "inputs/rubber_ball_fe.nml"
SEED = 12345


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    case = thud.read_case(CASE)
    verdict = thud.assess(case)
    low = np.array([unknown.low for unknown in verdict.unknowns])
    high = np.array([unknown.high for unknown in verdict.unknowns])
    points = low + np.random.default_rng(SEED).random((count, len(low))) * (high - low)
    keys = [unknown.key for unknown in verdict.unknowns]
    drops = thud.solve_many(
        dict(zip(keys, points.T, strict=True)), case, forces=True, progress=True
    )
    assert drops.floor_force is not None
    peaks = [peak_count(force, drops.sample_rate) for force in drops.floor_force]
    values = [*drops.floor_octaves.T, drops.contact_time, drops.restitution, peaks]
    inside = np.ones(count, dtype=bool)
    for criterion, column in zip(verdict.criteria, values, strict=False):
        value = np.asarray(column)
        meets = (value >= criterion.criterion.lower) & (value <= criterion.criterion.upper)
        inside &= meets
        within = np.mean((value >= criterion.low) & (value <= criterion.high))
        print(
            f"{criterion.name}: {meets.mean():.3f} meet it, stated "
            f"{shown(criterion.probability_range)}; {within:.3f} within {criterion.low:.5g} to "
            f"{criterion.high:.5g}"
        )
    print(f"all: {inside.mean():.3f} of {count} conform, stated {shown(verdict.probability_range)}")


def shown(ends: tuple[float, float]) -> str:
    return " to ".join(f"{end:.3f}" for end in ends)


if __name__ == "__main__":
    main()
