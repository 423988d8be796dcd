"""Damaged recordings as a part of the campaign: what `mutate_recordings` makes of one of them."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import mutate_recordings
import numpy as np

if TYPE_CHECKING:
    import random


@cache
def _originals() -> dict[str, bytes]:
    with tempfile.TemporaryDirectory(prefix="thud_originals_") as folder:
        mutate_recordings.write_originals(Path(folder))
        return {path.name: path.read_bytes() for path in sorted(Path(folder).iterdir())}


def attempt(chance: random.Random) -> tuple[str, str]:
    """Return what becomes of a recording, and how to see it."""
    path = Path(chance.choice(list(_originals())))
    rng = np.random.default_rng(chance.getrandbits(63))
    path.write_bytes(mutate_recordings.mutate(_originals()[path.name], rng))
    word, _, detail = mutate_recordings.attempt(path).partition("\t")
    path.unlink()
    return word, detail
