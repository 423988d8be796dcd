"""Many at once: calls in threads, and every way to start processes."""

from __future__ import annotations

import json
import random
import subprocess
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING

from campaign import Finding
from injection import PATIENCE
from public_calls import fast_calls, quiet, same

if TYPE_CHECKING:
    from collections.abc import Iterable

    from campaign import Tries
    from public_calls import Calls


CROWD = 8
# Ways to start what works at the same time.
STARTS = ("threads", "fork", "spawn", "forkserver")


@cache
def expected() -> tuple[Calls, dict[str, object]]:
    """Return the calls, and what they return where nothing else is at work."""
    folder = Path(tempfile.mkdtemp(prefix="thud_faults_"))
    quiet()
    calls = fast_calls(folder)
    return calls, {name: call() for name, call in calls.items()}


def check_threads(tries: Tries, _: Path) -> Iterable[Finding]:
    """Call public functions at once in eight threads."""
    calls, results = expected()

    def attempt(name: str) -> Finding:
        return Finding(name if same(calls[name](), results[name]) else "mixed", name)

    with ThreadPoolExecutor(CROWD) as threads:
        return list(threads.map(attempt, [chance.choice(list(calls)) for _, chance in tries]))


def check_starts(tries: Tries, _: Path) -> Iterable[Finding]:
    """Use threads and ways to start processes after each other in a process of their own."""
    for _, chance in tries:
        order = chance.choices(STARTS, k=chance.randint(2, 5))
        command = [sys.executable, __file__, json.dumps(order), str(chance.getrandbits(30))]
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=5 * PATIENCE, check=False
        )
        word = done.stdout.strip() if done.returncode == 0 else "crashed"
        yield Finding(word, f"{command}: {done.returncode}, {done.stderr[-500:]}")


def _call(name: str) -> object:
    return expected()[0][name]()


def _stage(way: str, names: list[str]) -> list[object]:
    """Return the results of calls that are made in a way."""
    if way == "threads":
        with ThreadPoolExecutor(3) as pool:
            return list(pool.map(_call, names))
    with ProcessPoolExecutor(2, get_context(way)) as processes:  # type: ignore[arg-type]
        return list(processes.map(_call, names, chunksize=len(names)))


def main() -> None:
    """Carry out the ways of the arguments; write what became of it."""
    order, seed = json.loads(sys.argv[1]), int(sys.argv[2])
    chance = random.Random(seed)  # noqa: S311
    calls, results = expected()
    for way in order:
        names = chance.choices(list(calls), k=6)
        for name, found in zip(names, _stage(way, names), strict=True):
            if not same(found, results[name]):
                sys.stdout.write("mixed")
                return
    sys.stdout.write("same")


if __name__ == "__main__":
    main()
