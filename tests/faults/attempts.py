"""Attempts in a process of their own, which may crash, hang, grow or leave something behind.

`python tests/faults/attempts.py <part> <seed>` makes one again, with what it says in full.
"""

from __future__ import annotations

import json
import os
import queue
import random
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import traceback
import warnings
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from campaign import Finding

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

# Seconds that an attempt may take; then it is interrupted, and hangs if it then goes on.
PATIENCE = 20
# Address space, bytes, and bytes by which memory may grow: what a header claims must not be taken.
SPACE, GROWTH = 4 * 2**30, 400 * 2**20
SANITIZED = "libasan" in os.environ.get("LD_PRELOAD", "")


def attempts(part: str) -> Callable[[list[tuple[int, random.Random]], Path], Iterable[Finding]]:
    """Return the check that lets the module of a part make its attempts in another process."""

    def check(tries: list[tuple[int, random.Random]], _: Path) -> Iterator[Finding]:
        seeds = [chance.getrandbits(63) for _, chance in tries]
        while seeds:
            found = list(_watch(part, seeds))
            yield from found
            seeds = seeds[len(found) :]

    return check


def _watch(part: str, seeds: list[int]) -> Iterator[Finding]:
    """Yield the findings of a process, with a last one of the attempt that it ended with."""
    with tempfile.TemporaryFile() as said, _process(part, said.fileno()) as worker:
        assert worker.stdin
        assert worker.stdout
        lines: queue.Queue[str] = queue.Queue()
        threading.Thread(target=_forward, args=(worker.stdout, lines), daemon=True).start()
        worker.stdin.write(json.dumps(seeds))
        worker.stdin.close()
        # Before the first come the imports.
        for seed, patience in zip(seeds, (3 * PATIENCE, *[PATIENCE] * len(seeds)), strict=False):
            line = _next_line(worker, lines, patience)
            if line is None or not line:
                worker.kill()
                said.seek(0)
                last = " ".join(said.read()[-2000:].decode(errors="replace").split())
                word = "hung" if line is None else "crashed"
                yield Finding(word, f"seed {seed}: {worker.wait()}: {last}")
                return
            word, detail = json.loads(line)
            yield Finding(word, f"seed {seed}: {detail}")


def _process(part: str, errors: int) -> subprocess.Popen[str]:
    command = [sys.executable, __file__, part]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=errors, text=True)


def _forward(source: Iterable[str], lines: queue.Queue[str]) -> None:
    for line in source:
        lines.put(line)
    lines.put("")


def _next_line(worker: subprocess.Popen[str], lines: queue.Queue[str], patience: int) -> str | None:
    """Return a line, empty where the process has ended, None where it hangs."""
    for seconds in (patience, 3 * PATIENCE):
        with suppress(queue.Empty):
            return lines.get(timeout=seconds)
        worker.send_signal(signal.SIGINT)
    return None


def _handles() -> set[str]:
    """Return the open files."""
    found = set()
    for one in Path("/proc/self/fd").iterdir():
        with suppress(OSError):
            found.add(f"{one.name} {one.readlink()}")
    return {one for one in found if "/proc/" not in one}


def _memory() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def _work(part: str) -> None:
    """Make the attempts whose seeds the standard input gives; print word and detail of each."""
    warnings.simplefilter("ignore")
    answers = os.fdopen(os.dup(1), "w")
    # Whatever else is printed goes to the same file as errors, which must not grow.
    os.dup2(2, 1)
    attempt = import_module(part).attempt
    if SANITIZED:
        core = Path(import_module("thud._core").__file__ or "")
        assert b"__asan_init" in core.read_bytes(), f"{core} has no sanitizer"
    else:
        resource.setrlimit(resource.RLIMIT_AS, (SPACE, SPACE))
    handles = usual = None
    for seed in json.loads(sys.stdin.read()):
        silent = os.fstat(2).st_size
        word, detail = _made(attempt, seed)
        if os.fstat(2).st_size > silent:
            word, detail = "raw", f"prints {os.pread(2, 500, silent)!r}; {word}: {detail}"
        left = [path.name for path in Path().iterdir()]
        if left:
            word, detail = "left behind", f"{left}"
        open_now, memory = _handles(), _memory()
        # The first attempt imports what it needs.
        if handles is not None and (more := open_now - handles):
            word, detail = "left behind", f"{more}"
        if usual is not None and memory > usual + GROWTH and not SANITIZED:
            word, detail = "grown", f"{(memory - usual) / 2**20:.0f} MiB; {word}: {detail}"
        handles, usual = open_now, max(memory, usual or memory)
        answers.write(json.dumps([word, detail]) + "\n")
        answers.flush()


def _made(attempt: Callable[[random.Random], tuple[str, str]], seed: int) -> tuple[str, str]:
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        return attempt(random.Random(seed))  # noqa: S311
    except KeyboardInterrupt:
        return "stopped", ""
    except Exception:  # noqa: BLE001 - that is the question
        return "crashed", traceback.format_exc()
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)


def main() -> None:
    """Work, or make one attempt again."""
    with tempfile.TemporaryDirectory(prefix="thud_faults_", dir="/dev/shm") as place:
        os.chdir(place)
        if len(sys.argv) > 2:
            sys.stdout.write(
                "{}: {}\n".format(*_made(import_module(sys.argv[1]).attempt, int(sys.argv[2])))
            )
        else:
            _work(sys.argv[1])
        os.chdir("/")


if __name__ == "__main__":
    main()
