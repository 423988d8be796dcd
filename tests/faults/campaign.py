"""The campaign of faults: whatever is given, a right result or one sentence; nothing is left.

    python tests/faults/campaign.py [--part NAME] [--tries N] [--seed N]

Attempts are made in processes of their own, which may crash, hang, grow or leave something behind.
What is found has a seed; `--part NAME --tries 1 --seed N` makes it again. Exit code 1 where a fault
was found.
"""

from __future__ import annotations

import argparse
import faulthandler
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import traceback
import warnings
from collections import Counter
from contextlib import suppress
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    Finding = tuple[int, str, str]

# What must never happen; every other word is fine.
FAULTS = ("crashed", "NaN", "mixed", "raw", "grown", "left", "wrong")
# Seconds for imports, and for the end of an attempt that was interrupted.
PATIENCE = 60
# Address space, bytes, and bytes by which memory may grow: what a header claims must not be taken.
SPACE, GROWTH = 4 * 2**30, 400 * 2**20
SANITIZED = "libasan" in os.environ.get("LD_PRELOAD", "")


class Part(NamedTuple):
    """A part of the campaign."""

    # Makes an attempt in the current directory; returns a word, such as "refused" or one of
    # `FAULTS`, and how to see it.
    attempt: Callable[[random.Random], tuple[str, str]]
    tries: int  # attempts of the campaign
    small: int  # of the slow tests
    limit: int = 60  # seconds that an attempt may take
    may_stop: bool = False  # whether one that takes longer is interrupted, since it computes


def parts() -> dict[str, Part]:
    """Return the parts of the campaign by name."""
    import cases
    import edges
    import namelists
    import readers
    import servers

    return {
        "namelists": Part(namelists.attempt, 1500, 300, 10, may_stop=True),
        "recordings": Part(readers.read_recordings, 4000, 500),
        "tables": Part(readers.read_tables, 800, 60, 20, may_stop=True),
        "studies": Part(readers.read_studies, 300, 60, 20, may_stop=True),
        "lumped": Part(partial(edges.attempt, cases.LUMPED), 1500, 60, 60, may_stop=True),
        "modal": Part(partial(edges.attempt, {"modal_ball": 1}), 100, 8, 20, may_stop=True),
        "elements": Part(partial(edges.attempt, {"finite_element": 1}), 40, 4, 15, may_stop=True),
        "explorer": Part(servers.attempt, 60, 8),
    }


def find(name: str, seeds: Iterable[int], script: str = __file__) -> Iterator[Finding]:
    """Yield seed, word and detail of attempts; a process that ends is replaced."""
    left = list(seeds)
    while left:
        with (
            tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder,
            tempfile.TemporaryFile() as said,
            subprocess.Popen(
                [sys.executable, script, "--part", name, "--work", json.dumps(left)],
                cwd=folder, stdout=subprocess.PIPE, stderr=said, text=True, start_new_session=True,
            ) as worker,
        ):  # fmt: skip
            assert worker.stdout
            try:
                for line in worker.stdout:
                    yield (left.pop(0), *json.loads(line))
                code = worker.wait(PATIENCE)
            finally:
                # What an attempt has started must not stay.
                with suppress(ProcessLookupError):
                    os.killpg(worker.pid, signal.SIGKILL)
            if left:
                said.seek(0)
                last = said.read()[-2000:].decode(errors="replace")
                yield left.pop(0), "crashed", f"exit code {code}: {last}"


def work(name: str, part: Part, seeds: list[int]) -> None:
    """Make attempts in this process; print word and detail of each."""
    answers = os.fdopen(os.dup(1), "w")
    # Whatever else is printed goes to the same file as errors, which must not grow.
    os.dup2(2, 1)
    warnings.simplefilter("ignore")
    if SANITIZED:
        core = import_module("thud._core").__file__ or ""
        assert b"__asan_init" in Path(core).read_bytes(), f"{core} has no sanitizer"
    else:
        resource.setrlimit(resource.RLIMIT_AS, (SPACE, SPACE))
    for folder in ("here", "temporary"):
        Path(folder).mkdir()
    temporary = Path("temporary").absolute()
    tempfile.tempdir = os.environ["TMPDIR"] = str(temporary)
    os.chdir("here")
    handles, usual, printed = None, None, 0
    for seed in seeds:
        word, detail = attempt(part, random.Random(f"{name}/{seed}"))  # noqa: S311
        open_now, memory, length = _handles(), _memory(), os.fstat(2).st_size
        left = {*map(str, temporary.iterdir()), *map(str, Path().glob(".*"))}
        # The first attempt imports what it needs.
        left |= open_now - (open_now if handles is None else handles)
        if length > printed:
            word, detail = "raw", f"prints {os.pread(2, 500, printed)!r}; {word}: {detail}"
        elif left:
            word, detail = "left", f"{left}; {word}: {detail}"
        elif not SANITIZED and word != "stopped" and usual and memory > usual + GROWTH:
            word, detail = "grown", f"{(memory - usual) / 2**20:.0f} MiB; {word}: {detail}"
        handles, usual, printed = open_now, max(memory, usual or 0), length
        for path in temporary.iterdir():
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        answers.write(json.dumps([word, detail]) + "\n")
        answers.flush()


def attempt(part: Part, chance: random.Random) -> tuple[str, str]:
    """Return what becomes of an attempt; the process ends if it hangs."""
    interrupt = threading.Timer(part.limit, os.kill, (os.getpid(), signal.SIGINT))
    faulthandler.dump_traceback_later(part.limit + PATIENCE, exit=True)
    try:
        if part.may_stop:
            interrupt.start()
        return part.attempt(chance)
    except KeyboardInterrupt:
        return "stopped", ""
    except Exception:  # noqa: BLE001 - that is the question
        return "crashed", traceback.format_exc()
    finally:
        interrupt.cancel()
        faulthandler.cancel_dump_traceback_later()


def _handles() -> set[str]:
    """Return the open files."""
    found = set()
    for handle in Path("/proc/self/fd").iterdir():
        with suppress(OSError):
            found.add(str(handle.readlink()))
    return {target for target in found if target.startswith("/") and "/proc/" not in target}


def _memory() -> int:
    # Unlike `getrusage`, this does not begin with the peak of the parent process.
    status = Path("/proc/self/status").read_text()
    return int(status.partition("VmHWM:")[2].split()[0]) * 1024


def main() -> int:
    """Run the campaign, or some attempts of a part; return the exit code."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--part", action="append", choices=parts(), help="default: all")
    parser.add_argument("--tries", type=int, help="attempts of each part")
    parser.add_argument("--seed", type=int, default=0, help="of the first attempt")
    parser.add_argument("--work", type=json.loads, help=argparse.SUPPRESS)
    options = parser.parse_args()
    wrong = 0
    for name in options.part or parts():
        part = parts()[name]
        if options.work:
            work(name, part, options.work)
            return 0
        start, counts = time.monotonic(), Counter[str]()
        first = options.seed
        for seed, word, detail in find(name, range(first, first + (options.tries or part.tries))):
            counts[word] += 1
            if word in FAULTS:
                wrong += 1
                print(f"{name} --seed {seed}: {word}: {detail}", flush=True)
        rest = ", ".join(f"{count} {word}" for word, count in counts.most_common())
        print(f"{name}: {rest}; {time.monotonic() - start:.0f} s", flush=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
