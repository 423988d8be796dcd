"""Attempts in a process of their own, which may crash, hang, grow or leave something behind.

`python tests/faults/attempts.py <part> <seed>` makes one again, with what it says in full.
"""

from __future__ import annotations

import json
import os
import queue
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import traceback
import warnings
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from typing import IO, TYPE_CHECKING

from campaign import Finding, draw

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from campaign import Part

# Seconds for imports, and for the end of an attempt that was interrupted.
PATIENCE = 60
# Address space, bytes, and bytes by which memory may grow: what a header claims must not be taken.
SPACE, GROWTH = 4 * 2**30, 400 * 2**20
SANITIZED = "libasan" in os.environ.get("LD_PRELOAD", "")
# Names of what parts keep in the directory of temporary files.
KEPT = "thud_faults_"
SEEDS = "seeds"


def find(name: str, part: Part, seeds: list[int]) -> Iterator[Finding]:
    """Yield what becomes of the attempts of a part, in other processes."""
    while seeds:
        with tempfile.TemporaryDirectory(prefix=KEPT, ignore_cleanup_errors=True) as folder:
            found = 0
            for one in _watch(name, part, seeds, Path(folder)):
                found += 1
                yield one
            seeds = seeds[found:]


def _watch(name: str, part: Part, seeds: list[int], folder: Path) -> Iterator[Finding]:
    """Yield the findings of a process, the last one of the attempt that it ended with."""
    (folder / SEEDS).write_text(json.dumps(seeds))
    with tempfile.TemporaryFile() as said, _process(name, folder, said) as (worker, lines):
        for place in range(len(seeds)):
            line = _next_line(worker, lines, part.limit if place else part.limit + PATIENCE)
            if line:
                found = Finding(*json.loads(line))
            else:
                said.seek(0)
                last = " ".join(said.read()[-2000:].decode(errors="replace").split())
                word = "hung" if line is None else "crashed"
                found = Finding(word, f"{worker.poll()}: {last}")
            yield found
            # What a hung attempt has started must not stay.
            if not line or found.word == "hung":
                return


@contextmanager
def _process(
    name: str, folder: Path, said: IO[bytes]
) -> Iterator[tuple[subprocess.Popen[str], queue.Queue[str]]]:
    """Start a process that attempts, and end it with all that it has started."""
    command = [sys.executable, __file__, name, "--work", str(folder)]
    lines: queue.Queue[str] = queue.Queue()
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=said, text=True, start_new_session=True
    ) as worker:
        thread = threading.Thread(target=_forward, args=(worker.stdout, lines))
        thread.start()
        try:
            yield worker, lines
        finally:
            with suppress(ProcessLookupError):
                os.killpg(worker.pid, signal.SIGKILL)
            thread.join()


def _forward(source: Iterable[str], lines: queue.Queue[str]) -> None:
    for line in source:
        lines.put(line)
    lines.put("")


def _next_line(worker: subprocess.Popen[str], lines: queue.Queue[str], patience: int) -> str | None:
    """Return a line, empty where the process has ended, None where it hangs."""
    for seconds in (patience, PATIENCE):
        with suppress(queue.Empty):
            return lines.get(timeout=seconds)
        worker.send_signal(signal.SIGINT)
    return None


def _observe(name: str, part: Part, seeds: list[int], folder: Path) -> Iterator[Finding]:
    """Make attempts in this process; yield a finding of each and of what it leaves."""
    for path in ("here", "work", "temporary"):
        (folder / path).mkdir()
    os.chdir(folder / "here")
    tempfile.tempdir = os.environ["TMPDIR"] = str(folder / "temporary")
    warnings.simplefilter("ignore")
    handles = usual = None
    silent = os.fstat(2).st_size
    for word, detail in _make(name, part, seeds, folder / "work"):
        found = Finding(word, detail)
        if os.fstat(2).st_size > silent:
            found = Finding("raw", f"prints {os.pread(2, 500, silent)!r}; {word}: {detail}")
        serves = _has_children()
        left = [path.name for path in Path().iterdir()]
        if not serves:
            left += [
                path.name for path in Path(tempfile.tempdir).iterdir() if KEPT not in path.name
            ]
        open_now, memory = _handles(files_only=serves), _memory()
        # The first attempt imports what it needs.
        left += open_now - handles if handles is not None else ()
        if left:
            found = Finding("left behind", f"{left}; {word}: {detail}")
        # What was stopped may have been a large case.
        may_grow = SANITIZED or found.word == "stopped"
        if usual is not None and memory > usual + GROWTH and not may_grow:
            found = Finding("grown", f"{(memory - usual) / 2**20:.0f} MiB; {word}: {detail}")
        handles, usual, silent = open_now, max(memory, usual or memory), os.fstat(2).st_size
        yield found


def _make(name: str, part: Part, seeds: list[int], folder: Path) -> Iterator[Finding]:
    """Yield a finding of each attempt; one that does not end well is the last of its share."""
    while seeds:
        share, made = seeds[: part.share], 0
        try:
            signal.signal(signal.SIGINT, signal.default_int_handler)
            for found in part.check([draw(name, seed) for seed in share], folder):
                signal.signal(signal.SIGINT, signal.SIG_IGN)
                made += 1
                yield found
                signal.signal(signal.SIGINT, signal.default_int_handler)
            assert made == len(share), f"{made} findings of {len(share)} tries"
        except (KeyboardInterrupt, subprocess.TimeoutExpired) as late:
            signal.signal(signal.SIGINT, signal.SIG_IGN)
            may_stop = part.may_stop and isinstance(late, KeyboardInterrupt)
            made += 1
            # Its own end may have been what was interrupted.
            for path in Path().iterdir():
                shutil.rmtree(path) if path.is_dir() else path.unlink()
            yield Finding("stopped" if may_stop else "hung", traceback.format_exc())
        except Exception:  # noqa: BLE001 - that is the question
            signal.signal(signal.SIGINT, signal.SIG_IGN)
            made += 1
            yield Finding("crashed", traceback.format_exc())
        seeds = seeds[made:]


def _has_children() -> bool:
    """Return whether processes run that a part keeps: pipes and temporary files may be theirs."""
    return any(path.read_text() for path in Path("/proc/self/task").glob("*/children"))


def _handles(*, files_only: bool) -> set[str]:
    """Return the open files, and all other descriptors."""
    found = set()
    for handle in Path("/proc/self/fd").iterdir():
        with suppress(OSError):
            target = str(handle.readlink())
            if "/proc/" not in target and (target.startswith("/") or not files_only):
                found.add(f"{handle.name} {target}")
    return found


def _memory() -> int:
    # Unlike `getrusage`, this does not begin with the peak of the parent process.
    status = Path("/proc/self/status").read_text()
    return int(status.partition("VmHWM:")[2].split()[0]) * 1024


def _work(name: str, part: Part, folder: Path) -> None:
    """Make the attempts of the seeds in a directory; print word and detail of each."""
    answers = os.fdopen(os.dup(1), "w")
    # Whatever else is printed goes to the same file as errors, which must not grow.
    os.dup2(2, 1)
    if SANITIZED:
        core = Path(import_module("thud._core").__file__ or "")
        assert b"__asan_init" in core.read_bytes(), f"{core} has no sanitizer"
    else:
        resource.setrlimit(resource.RLIMIT_AS, (SPACE, SPACE))
    for found in _observe(name, part, json.loads((folder / SEEDS).read_text()), folder):
        answers.write(json.dumps(found) + "\n")
        answers.flush()


def main() -> None:
    """Work, or make one attempt again."""
    from run import parts

    name, *rest = sys.argv[1:]
    part = parts()[name]
    if rest[0] == "--work":
        _work(name, part, Path(rest[1]))
        return
    # Twice, as the first attempt imports what it needs.
    for found in find(name, part, [int(rest[0])] * 2):
        sys.stdout.write("{}: {}\n".format(*found))


if __name__ == "__main__":
    main()
