"""Damaged recordings of formats whose library survives them: read, or refused in one sentence."""

from __future__ import annotations

import re
import sys
import tempfile
from datetime import UTC, datetime, timedelta
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "driver"))
from recording_files import WRITERS, half_sine

from thud.base.errors import InputError
from thud.recordings.config import Config
from thud.recordings.signal import open_signals

if TYPE_CHECKING:
    import random

    from numpy.typing import NDArray

NUMBERS = [0, 1, 7, 127, 128, 255, 256, 2**15, 2**16 - 1, 2**20, 2**31 - 1, 2**31, 2**32 - 1,
           2**32, 2**40, 2**62, 2**63 - 1, 2**63, 2**64 - 1]  # fmt: skip
WORDS = ["nan", "inf", "-inf", "1e999", "1e-999", ",", ";", "\t", "\n", "\r", "\0", '"', "#", "-",
         "1e308", "99999999999999999999", "0x10", "1_0", "µ", "\ufeff", "--", "e", "    -1\n",
         "    58\n", "fs=0\n", "dt=-1\n", "unit=kN\n", "12" * 200]  # fmt: skip

# Formats whose library may hang or crash on damaged files.
FRAGILE = {".h5", ".nc", ".mat"}


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


@cache
def _originals() -> dict[str, bytes]:
    """Return the files that are damaged, by name."""
    force: NDArray[np.float64] = half_sine(8000.0, 0.02, 0.02)
    force += np.random.default_rng(1).normal(0, 3, force.size)
    with tempfile.TemporaryDirectory(prefix="thud_faults_") as folder:
        for name, write in WRITERS.items():
            sound = name.startswith("pcm")
            write(Path(folder, name), force / 5000 if sound else force, 8000.0, "N")
        _write_others(Path(folder), force)
        paths = sorted(path for path in Path(folder).iterdir() if path.suffix not in FRAGILE)
        return {path.name: path.read_bytes() for path in paths}


def _write_others(folder: Path, force: NDArray[np.float64]) -> None:
    """Write load cells, and columns of date and time."""
    cells = np.column_stack([0.3 * force, 0.7 * force])
    np.savetxt(folder / "cells.csv", cells, "%.3f", ";", header="fs = 8000\nF1 [N];F2 [N]")
    begin = datetime(2026, 11, 23, 10, tzinfo=UTC)
    times = [begin + timedelta(seconds=i / 8000) for i in range(force.size)]
    rows = [
        f"{time:%d.%m.%Y %H:%M:%S.%f};{value:.2f}" for time, value in zip(times, force, strict=True)
    ]
    (folder / "clock.csv").write_text("Datum;Kraft [N]\n" + "\n".join(rows))
    days = 46349.5 + np.arange(force.size) / 8000 / 86400
    np.savetxt(folder / "days.csv", np.column_stack([days, force]), "%.11f", ",")


def attempt(chance: random.Random) -> tuple[str, str]:
    """Return what becomes of a damaged recording: it is read, or refused in one sentence."""
    path = Path(chance.choice(list(_originals())))
    rng = np.random.default_rng(chance.getrandbits(63))
    path.write_bytes(mutate(_originals()[path.name], rng))
    try:
        config = Config(
            calibration=5000.0 if path.name.startswith("pcm") else None,
            channels="sum" if path.name.startswith("cells") else None,
        )
        signals = open_signals(path, config)
        for signal in signals[:4]:
            for start in range(0, signal.n_sample, 2**20):
                signal.read(start, min(signal.n_sample, start + 2**20))
            assert len(signal.checksum) == 64
    except InputError as error:
        text = str(error)
        if "\n" in text or "; allowed: " not in text or len(text) > 1200 or not text.isprintable():
            return "raw", f"{path.name}: {text!r}"
        return "refused", ""
    finally:
        path.unlink()
    return "read", ""
