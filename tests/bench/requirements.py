"""What the rows of the benchmarks require, and whether each requirement was met.

Times and rates count only on an idle machine: other processes take time, caches and clock.
"""

from __future__ import annotations

import os

# Load, of which the benchmark itself is 1, up to which a machine is idle.
IDLE = 1.3
# Limits by row and unit, a lower one of rates and ratios, an upper one of times and memory. A row
# may be that of one competitor.
LOWER = ("times", "/s")
REQUIRED: dict[str | tuple[str, str], dict[str, float]] = {
    "thud, whole process": {"ms": 50},
    "thud.solve, shell": {"ms": 2},
    ("levels, exact, five octaves", "SciPy ZoomFFT, 64 lines per band"): {"times": 3},
    ("ensemble, trajectories", "heyoka, batch mode"): {"times": 1},
    "ensemble, five levels and verdict": {"/s": 80_000, "times": 10},
    "levels alone (by difference)": {"times": 5},
    "ensemble, two threads": {"times": 1.9},
    "streamed to disk": {"MiB": 256},
    "free modes": {"ms": 5},
    "flagship": {"ms": 250},
    "impact, elastic, an element and a ms": {"times": 100},
    "drop and predictions, concrete": {"ms": 300},
    "drop and predictions, floating floor": {"ms": 300},
    "drop and predictions, laminate": {"ms": 300},
    "drop and predictions, joists": {"ms": 300},
}

_measured: set[tuple[str | tuple[str, str], str]] = set()
_missed: list[str] = []


def assess(name: str, competitor: str = "", **measured: float) -> str:
    """Return what a row requires and whether the measured values, by their units, meet it.

    The unit "/s" is the keyword `rate`.
    """
    row = (name, competitor) if (name, competitor) in REQUIRED else name
    texts = []
    for unit, limit in REQUIRED.get(row, {}).items():
        value = measured.get("rate" if unit == "/s" else unit)
        if value is None:
            continue
        _measured.add((row, unit))
        met = value >= limit if unit in LOWER else value < limit
        text = f"{'at least' if unit in LOWER else 'below'} {limit:,g} {unit}".replace(" /s", "/s")
        texts.append(f"{text}: {'met' if met else 'missed'}")
        if not met:
            _missed.append(f"{name}: {text}, measured {value:,.4g}")
    return "required: " + ", ".join(texts) if texts else ""


def conclude() -> int:
    """Print which requirements were missed; return 1 if any was on an idle machine, else 0."""
    load = os.getloadavg()[0]
    print(f"\nLoad of the machine: {load:.1f}; idle: up to {IDLE:g}.")
    needed = {(row, unit) for row, limits in REQUIRED.items() for unit in limits}
    for row, unit in needed - _measured:
        print(f"Not measured: {row}, {unit}; a competitor is missing.")
    if not _missed:
        print("All measured requirements are met.")
        return 0
    print("Requirements that were missed:", *_missed, sep="\n  ")
    if load > IDLE:
        print("The machine was busy: this is no failure. Repeat it on an idle machine.")
    return int(load <= IDLE)
