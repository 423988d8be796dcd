"""The surrogate of inputs/studies/flagship.toml against drops of the model itself.

    .venv/bin/python tests/bench/surrogate.py [DROPS]    # 1000 by default, 0.3 s each on a core

It trains the surrogate in outputs/flagship unless that is done.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

import thud

STUDY = Path(__file__).parents[2] / "inputs/studies/flagship.toml"
# Sets whose time is measured.
MANY = 1_000_000


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    before = time.process_time()
    trained = thud.surrogate(STUDY, "outputs/flagship", progress=True)
    print(f"training: {time.process_time() - before:.1f} s of processor time")
    print(trained.table())

    low, high = trained.region.T
    draw = np.random.default_rng(12345)
    columns = dict(
        zip(trained.keys, (low + draw.random((count, len(low))) * (high - low)).T, strict=True)
    )
    direct = thud.solve_many(columns, trained.case, progress=True)
    found = trained.predict(trained.case, columns)
    errors = np.column_stack([
        found["floor_octave"] - direct.floor_octave,
        *(20 * np.log10(found[n] / getattr(direct, n)) for n in ("contact_time", "restitution")),
    ])  # fmt: skip
    print("levels, contact time, restitution; 95 % of drops within, dB:")
    print(np.quantile(np.abs(errors), 0.95, axis=0).round(4))
    print("share of drops within 0.1 dB:", (np.abs(errors) <= 0.1).mean(axis=0).round(4))
    wrong = found["conforms"] != direct.conforms
    print(f"verdicts that differ: {wrong.sum()} of {count}, undecided {found['undecided'].sum()}")

    sets = dict(
        zip(trained.keys, (low + draw.random((MANY, len(low))) * (high - low)).T, strict=True)
    )
    before = time.process_time()
    trained.predict(trained.case, sets)
    print(f"{MANY} sets: {time.process_time() - before:.1f} s of processor time")


if __name__ == "__main__":
    main()
