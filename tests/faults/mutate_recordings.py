"""Damage recordings of every format at random and count what reading makes of them.

Each file must be read or refused with one sentence, in bounded time and memory, and leave nothing
behind. Run `python tests/faults/mutate_recordings.py --files 100000`; exit code 1 where one is not.
"""

from __future__ import annotations

import argparse
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "driver"))
from recording_files import WRITERS, half_sine

from thud.errors import InputError
from thud.recordings.reading import open_signals

if TYPE_CHECKING:
    import random

    from numpy.typing import NDArray

# Seconds that a file may take, and bytes by which memory may grow.
PATIENCE = 20
GROWTH = 300 * 2**20
# Address space of a worker, bytes: what a header claims must not be taken.
SPACE = 4 * 2**30
# Files of a worker.
SHARE = 1000
NUMBERS = [0, 1, 7, 127, 128, 255, 256, 2**15, 2**16 - 1, 2**20, 2**31 - 1, 2**31, 2**32 - 1,
           2**32, 2**40, 2**62, 2**63 - 1, 2**63, 2**64 - 1]  # fmt: skip
WORDS = ["nan", "inf", "-inf", "1e999", "1e-999", ",", ";", "\t", "\n", "\r", "\0", '"', "#", "-",
         "1e308", "99999999999999999999", "0x10", "1_0", "µ", "\ufeff", "--", "e", "    -1\n",
         "    58\n", "fs=0\n", "dt=-1\n", "unit=kN\n", "12" * 200]  # fmt: skip
OUTCOMES = ("read", "refused", "crashed", "hung", "memory above bound", "left something behind")


def _number(rng: np.random.Generator) -> bytes:
    """Return an awkward integer of some width and byte order."""
    width = int(rng.choice([1, 2, 4, 8]))
    value = NUMBERS[int(rng.integers(len(NUMBERS)))] % 2 ** (8 * width)
    return value.to_bytes(width, "little" if rng.random() < 0.5 else "big")


def _flipped(part: bytes, rng: np.random.Generator) -> bytes:
    """Return bytes of which some bits are flipped."""
    bits = np.unpackbits(np.frombuffer(part, np.uint8))
    bits[rng.integers(bits.size, size=int(rng.integers(1, 9)))] ^= 1
    return np.packbits(bits).tobytes()


def mutate(data: bytes, rng: np.random.Generator) -> bytes:
    """Return damaged bytes."""
    for _ in range(int(rng.geometric(0.4))):
        size = len(data)
        if not size:
            break
        # What matters most stands at the begin.
        at = int(rng.integers(min(size, 2048) if rng.random() < 0.6 else size))
        longest = 4096 if rng.random() < 0.5 else 16
        part = data[at : at + int(rng.integers(1, longest + 1))]
        other = int(rng.integers(size))
        number = _number(rng)
        word = WORDS[int(rng.integers(len(WORDS)))].encode()
        replaced, by = [
            (part, _flipped(part, rng)),
            (part, rng.bytes(len(part))),
            (data[at:], b""),
            (part, b""),
            (part, bytes(len(part))),
            (part, b"\xff" * len(part)),
            (part, part + part),
            (data[at : at + len(number)], number),
            (b"", word),
            (part, data[other : other + len(part)]),
        ][int(rng.integers(10))]
        data = data[:at] + by + data[at + len(replaced) :]
    return data


def mutated_text(text: str, chance: random.Random) -> str:
    """Return a text of which some words or lines are replaced, removed, doubled or exchanged."""
    for _ in range(chance.choice([1, 1, 2, 4])):
        parts = re.split(r"(\n)" if chance.random() < 0.4 else r"([\s,;=\[\]{}]+)", text)
        at, other = chance.randrange(len(parts)), chance.randrange(len(parts))
        word = chance.choice(
            [*WORDS, "-1", "0", "1e-300", "1e300", "\udcff", "x", "1,5", "2.5 3.5"]
        )
        parts[at] = chance.choice([word, word, "", parts[at] * 2, parts[other]])
        text = "".join(parts)
    return text


def count_handles() -> int:
    """Return the number of open files."""
    return len(list(Path("/proc/self/fd").iterdir()))


def attempt(path: Path) -> str:
    """Return what reading makes of a file: an outcome and a reason."""
    try:
        signals = open_signals(path, calibration=5000.0 if path.name.startswith("pcm") else None)
        for one in signals[:4]:
            for start in range(0, one.n_sample, 2**20):
                one.read(start, min(one.n_sample, start + 2**20))
            assert len(one.checksum) == 64
    except InputError as error:
        text = str(error)
        if "\n" in text or "; allowed: " not in text or len(text) > 1200 or not text.isprintable():
            return f"crashed\t{path.name}: message {text!r}"
        return "refused\t"
    except Exception as error:  # noqa: BLE001 - what a campaign is for
        return f"crashed\t{path.name}: {type(error).__name__}: {error!r:.200}"
    return "read\t"


def write_originals(folder: Path) -> None:
    """Write the files that are damaged."""
    force: NDArray[np.float64] = half_sine(8000.0, 0.02, 0.02)
    force += np.random.default_rng(1).normal(0, 3, force.size)
    for name, write in WRITERS.items():
        sound = name.startswith("pcm")
        write(folder / name, force / 5000 if sound else force, 8000.0, "N")


def work(originals: Path, first: int, last: int, seed: int) -> None:
    """Damage and read files, a line of output each."""
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    names = sorted(one.name for one in originals.iterdir())
    contents = {name: (originals / name).read_bytes() for name in names}
    folder = Path(tempfile.mkdtemp(prefix="thud_faults_"))
    # Imports and the first read of each format take memory once.
    for name in names:
        (folder / name).write_bytes(contents[name])
        attempt(folder / name)
        (folder / name).unlink()
    resource.setrlimit(resource.RLIMIT_AS, (SPACE, SPACE))
    usual = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    handles = count_handles()
    for number in range(first, last):
        rng = np.random.default_rng([seed, number])
        path = folder / names[number % len(names)]
        path.write_bytes(mutate(contents[path.name], rng))
        signal.alarm(PATIENCE)
        outcome = attempt(path)
        signal.alarm(0)
        most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
        path.unlink()
        if most > usual + GROWTH:
            outcome, usual = f"memory above bound\t{path.name}: {most / 2**20:.0f} MiB", most
        if list(folder.iterdir()) or count_handles() > handles:
            outcome = f"left something behind\t{path.name}"
            handles = count_handles()
        sys.stdout.write(f"{number}\t{outcome}\n")
        sys.stdout.flush()
    shutil.rmtree(folder)


def campaign(originals: Path, first: int, last: int, seed: int) -> list[str]:
    """Return the lines of a range of files; a worker that dies is started again after its file."""
    lines: list[str] = []
    while first < last:
        command = [sys.executable, __file__, "--work", str(originals), str(first), str(last)]
        done = subprocess.run(
            [*command, "--seed", str(seed)], capture_output=True, text=True, check=False
        )
        found = done.stdout.splitlines()
        lines += found
        first += len(found)
        if first < last and done.returncode:
            hung = done.returncode == -signal.SIGALRM
            reason = f"signal {-done.returncode}: {done.stderr[-200:]!r}"
            lines.append(f"{first}\t{'hung' if hung else 'crashed'}\t{reason}")
            first += 1
    return lines


def main() -> int:
    """Run the campaign; print the counts and what is not as it should be."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--files", type=int, default=3000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    parser.add_argument("--work", nargs=3, metavar=("FOLDER", "FIRST", "LAST"))
    chosen = parser.parse_args()
    if chosen.work:
        folder, first, last = chosen.work
        work(Path(folder), int(first), int(last), chosen.seed)
        return 0
    with tempfile.TemporaryDirectory(prefix="thud_originals_") as originals:
        write_originals(Path(originals))
        names = sorted(one.name for one in Path(originals).iterdir())
        starts = range(0, chosen.files, SHARE)
        with ThreadPoolExecutor(chosen.workers) as pool:
            shares = pool.map(
                lambda at: campaign(
                    Path(originals), at, min(at + SHARE, chosen.files), chosen.seed
                ),
                starts,
            )
            lines = [line.split("\t", 2) for share in shares for line in share]
    counts = Counter(outcome for _, outcome, _ in lines)
    sys.stdout.write("".join(f"{outcome}: {counts[outcome]}\n" for outcome in OUTCOMES))
    bad = [line for line in lines if line[1] not in {"read", "refused"}]
    for number, outcome, reason in bad[:50]:
        name = names[int(number) % len(names)]
        sys.stdout.write(f"file {number} ({name}): {outcome}: {reason}\n")
    return int(bool(bad) or len(lines) != chosen.files)


if __name__ == "__main__":
    sys.exit(main())
