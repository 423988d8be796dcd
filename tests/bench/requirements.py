"""What the rows of the benchmarks require, and whether each requirement was met.

Times and rates count only on an idle machine: other processes take time, caches and clock.
"""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from pathlib import Path

# Share of one processor that other processes may take on an idle machine.
IDLE = 0.1


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


def _busy() -> float:
    """Return the time that all processors have worked, s."""
    fields = [int(field) for field in Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:]]
    user, nice, system, _, _, interrupt, soft, steal = fields[:8]
    return (user + nice + system + interrupt + soft + steal) / os.sysconf("SC_CLK_TCK")


class Load:
    """Load of the machine by other processes since this object was made."""

    def __init__(self) -> None:
        self._start = time.perf_counter(), _busy(), self._own()

    @staticmethod
    def _own() -> float:
        """Return the processor time of this process and of its finished children, s."""
        return sum(os.times()[:4])

    def share(self) -> float:
        """Return the share of one processor that other processes took."""
        start, busy, own = self._start
        elapsed = time.perf_counter() - start
        return max(0.0, (_busy() - busy - (self._own() - own)) / elapsed)


def conclude(load: Load) -> int:
    """Print which requirements were missed; return 1 if any was on an idle machine, else 0."""
    share = load.share()
    print(f"\nOther processes took {100 * share:.0f} % of a processor; "
          f"idle: up to {100 * IDLE:.0f} %.")  # fmt: skip
    for (name, competitor), limits in REQUIRED.items():
        if not all((name, limit) in _measured for limit in limits):
            print(f"Not measured in full: {name}; {competitor or 'a competitor'} is missing.")
    if not _missed:
        print("All measured requirements are met.")
        return 0
    print("Requirements that were missed:", *_missed, sep="\n  ")
    if share > IDLE:
        print("The machine was busy: this is no failure. Repeat it on an idle machine.")
        return 0
    return 1
