"""Many calls in one process, whose memory and descriptors must not grow."""

from __future__ import annotations

import gc
import os
import statistics
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import TYPE_CHECKING

from campaign import Finding
from public_calls import changing_calls, fast_calls, quiet, same, slow_calls

if TYPE_CHECKING:
    import random
    from collections.abc import Callable, Iterable

    from public_calls import Calls

# Fraction of the calls that take longer.
SLOW_FRACTION = 0.04
# Rounds before the growth counts, and the growth allowed in their second half.
WARM = 40
GROWTH = 0.01
PAGE = os.sysconf("SC_PAGE_SIZE")


@cache
def _calls() -> tuple[Calls, Calls, dict[str, Callable[[random.Random], object]]]:
    folder = Path(mkdtemp(prefix="thud_faults_"))
    quiet()
    return fast_calls(folder), slow_calls(folder), changing_calls(folder)


@cache
def _expected() -> dict[str, object]:
    """Return the results of the calls that are always the same."""
    fast, slow, _ = _calls()
    return {name: call() for name, call in {**fast, **slow}.items()}


@cache
def _sizes() -> list[int]:
    """Return the resident sizes after the rounds of this process, bytes."""
    return []


def check_soak(tries: list[tuple[int, random.Random]], _: Path) -> Iterable[Finding]:
    """Make a round of calls, then look at memory and descriptors; each try is two calls."""
    fast, slow, changing = _calls()
    expected, handles = _expected(), _handles()
    found = []
    for _, chance in tries:
        chance.choice(list(changing.values()))(chance)
        calls = slow if chance.random() < SLOW_FRACTION else fast
        name = chance.choice(list(calls))
        found.append(Finding("same" if same(calls[name](), expected[name]) else "mixed", name))
    gc.collect()
    _sizes().append(int(Path("/proc/self/statm").read_text().split()[1]) * PAGE)
    if _handles() > handles or growth() > GROWTH:
        detail = (
            f"{_handles() - handles} descriptors, {growth():.3%} of {_sizes()[-1] / 1e6:.0f} MB"
        )
        found[-1] = Finding("grown", detail)
    return found


def growth() -> float:
    """Return the growth of the resident size in the second half of the rounds, as part of it."""
    sizes = _sizes()
    if len(sizes) < WARM:
        return 0.0
    half = sizes[len(sizes) // 2 :]
    count = len(half) // 5
    return statistics.median(half[-count:]) / statistics.median(half[:count]) - 1


def _handles() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))
