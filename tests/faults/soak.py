"""Many calls in one process, whose memory and descriptors must not grow."""

from __future__ import annotations

import ctypes
import gc
import os
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import TYPE_CHECKING

from campaign import Finding
from public_calls import fast_calls, quiet, same, slow_calls

if TYPE_CHECKING:
    import random
    from collections.abc import Iterable

    from public_calls import Calls

# Part of the calls that take longer.
SLOW_PART = 0.04
# Rounds in which libraries fill their caches, and the growth allowed behind them.
WARM = 100
GROWTH = 0.01
PAGE = os.sysconf("SC_PAGE_SIZE")


@cache
def _calls() -> tuple[Calls, Calls, dict[str, object]]:
    folder = Path(mkdtemp(prefix="thud_faults_"))
    quiet()
    fast, slow = fast_calls(folder), slow_calls(folder)
    return fast, slow, {name: call() for name, call in {**fast, **slow}.items()}


@cache
def _sizes() -> list[float]:
    """Return the resident sizes after the rounds of this process, bytes."""
    return []


def check_soak(tries: list[tuple[int, random.Random]], _: Path) -> Iterable[Finding]:
    """Make a round of calls, then look at memory and descriptors; each try is one call."""
    fast, slow, expected = _calls()
    handles = _handles()
    found = []
    for _, chance in tries:
        calls = slow if chance.random() < SLOW_PART else fast
        name = chance.choice(list(calls))
        found.append(Finding("same" if same(calls[name](), expected[name]) else "mixed", name))
    gc.collect()
    # The pool of freed memory changes by itself.
    ctypes.CDLL(None).malloc_trim(0)
    _sizes().append(int(Path("/proc/self/statm").read_text().split()[1]) * PAGE)
    if _handles() > handles or growth() > GROWTH:
        detail = (
            f"{_handles() - handles} descriptors, {growth():.3%} of {_sizes()[-1] / 1e6:.0f} MB"
        )
        found[-1] = Finding("grown", detail)
    return found


def growth() -> float:
    """Return the growth of the resident size after the first rounds, as part of it."""
    sizes = _sizes()[WARM:]
    if len(sizes) < 2:
        return 0.0
    part = max(1, len(sizes) // 10)
    first, last = (sorted(some)[len(some) // 2] for some in (sizes[:part], sizes[-part:]))
    return last / first - 1


def _handles() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))
