"""Many calls in one process, whose memory and descriptors must not grow."""

from __future__ import annotations

import gc
import statistics
from contextlib import suppress
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import TYPE_CHECKING

from campaign import Finding
from public_calls import changing_calls, fast_calls, quiet, same, slow_calls

import thud

if TYPE_CHECKING:
    import random
    from collections.abc import Callable, Iterable

    from campaign import Tries
    from public_calls import Calls

# Fraction of the calls that take longer.
SLOW_FRACTION = 0.04
# Rounds before the growth counts, and the growth allowed in their second half.
WARM = 40
GROWTH = 0.01


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
    """Return the memory after the rounds of this process, bytes."""
    return []


def check_soak(tries: Tries, _: Path) -> Iterable[Finding]:
    """Make a round of calls, then look at memory and descriptors; each try is two calls."""
    fast, slow, changing = _calls()
    expected, handles = _expected(), _handles()
    for place, (_, chance) in enumerate(tries, 1):
        # Some of what is drawn is refused.
        with suppress(thud.ThudError):
            chance.choice(list(changing.values()))(chance)
        calls = slow if chance.random() < SLOW_FRACTION else fast
        name = chance.choice(list(calls))
        found = Finding("same" if same(calls[name](), expected[name]) else "mixed", name)
        if place == len(tries):
            gc.collect()
            _sizes().append(_memory())
            if _handles() > handles or growth() > GROWTH:
                more = f"{_handles() - handles} descriptors, {growth():.3%}"
                found = Finding("grown", f"{more} of {_sizes()[-1] / 1e6:.0f} MB")
        yield found


def growth() -> float:
    """Return the growth of the memory in the second half of the rounds, as part of it."""
    sizes = _sizes()
    if len(sizes) < WARM:
        return 0.0
    half = sizes[len(sizes) // 2 :]
    count = len(half) // 3
    return statistics.median(half[-count:]) / statistics.median(half[:count]) - 1


def _memory() -> int:
    """Return the resident memory, bytes, but for pages of files, which the system drops."""
    status = Path("/proc/self/status").read_text()
    return 1024 * int(status.partition("RssAnon:")[2].split()[0])


def _handles() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))
