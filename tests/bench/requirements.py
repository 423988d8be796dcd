"""What the rows of the benchmarks require, and whether each requirement was met.

Times and rates count only on an idle machine: other processes take time, caches and clock.
"""

from __future__ import annotations

import os
from dataclasses import dataclass

# Load, of which the benchmark itself is 1, up to which a machine is idle.
IDLE = 1.3


@dataclass(frozen=True)
class Limit:
    """Limit of a measured value: an upper one, or a lower one."""

    value: float
    unit: str
    lower: bool = False


# Limits by row and competitor; an empty competitor is any.
REQUIRED: dict[tuple[str, str], tuple[Limit, ...]] = {
    ("thud, whole process", ""): (Limit(50, "ms"),),
    ("thud.solve", ""): (Limit(2, "ms"),),
    ("thud.solve, modal ball", ""): (Limit(7, "ms"),),
    ("levels, exact, five octaves", "SciPy ZoomFFT, 64 lines per band"): (
        Limit(3, "times", lower=True),
    ),
    ("levels, fft, five octaves", ""): (Limit(1.5, "times", lower=True),),
    ("ensemble, trajectories", "heyoka, batch mode"): (Limit(1, "times", lower=True),),
    ("ensemble, five levels and verdict", ""): (
        Limit(80_000, "/s", lower=True),
        Limit(10, "times", lower=True),
    ),
    ("levels alone (by difference)", ""): (Limit(5, "times", lower=True),),
    ("ensemble, two threads", ""): (Limit(1.9, "times", lower=True),),
    ("streamed to disk", ""): (Limit(256, "MiB"),),
    ("free modes", ""): (Limit(5, "ms"),),
    ("flagship", ""): (Limit(250, "ms"),),
    ("impact, elastic, an element and a ms", ""): (Limit(100, "times", lower=True),),
    ("impact, an element and a ms", ""): (Limit(100, "times", lower=True),),
    ("drop and predictions, concrete", ""): (Limit(300, "ms"),),
    ("drop and predictions, floating floor", ""): (Limit(300, "ms"),),
    ("drop and predictions, laminate", ""): (Limit(300, "ms"),),
    ("drop and predictions, joists", ""): (Limit(300, "ms"),),
    ("study of floors", ""): (Limit(17, "/s", lower=True),),
}

_measured: set[tuple[str, Limit]] = set()
_missed: list[str] = []


def assess(name: str, competitor: str = "", **measured: float) -> str:
    """Return what a row requires and whether the measured values, by their units, meet it.

    The unit "/s" is the keyword `rate`.
    """
    limits = REQUIRED.get((name, competitor)) or REQUIRED.get((name, ""), ())
    texts = []
    for limit in limits:
        key = "rate" if limit.unit == "/s" else limit.unit
        if key not in measured:
            continue
        _measured.add((name, limit))
        value = measured[key]
        met = value >= limit.value if limit.lower else value < limit.value
        bound = "at least" if limit.lower else "below"
        text = f"{bound} {limit.value:,g} {limit.unit}".replace(" /s", "/s")
        texts.append(f"{text}: {'met' if met else 'missed'}")
        if not met:
            _missed.append(f"{name}: {text}, measured {value:,.4g}")
    return "required: " + ", ".join(texts) if texts else ""


def conclude() -> int:
    """Print which requirements were missed; return 1 if any was on an idle machine, else 0."""
    load = os.getloadavg()[0]
    print(f"\nLoad of the machine: {load:.1f}; idle: up to {IDLE:g}.")
    for (name, competitor), limits in REQUIRED.items():
        if not all((name, limit) in _measured for limit in limits):
            print(f"Not measured in full: {name}; {competitor or 'a competitor'} is missing.")
    if not _missed:
        print("All measured requirements are met.")
        return 0
    print("Requirements that were missed:", *_missed, sep="\n  ")
    if load > IDLE:
        print("The machine was busy: this is no failure. Repeat it on an idle machine.")
        return 0
    return 1
