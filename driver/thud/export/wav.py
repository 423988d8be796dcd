"""WAV files of sound pressure: one channel of 24 bit with a comment."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

BYTES = 3
# Counts at full scale.
COUNTS = 2 ** (8 * BYTES - 1)
PCM = 1


def wav_file(samples: NDArray[np.float64], sample_rate: int, comment: str, software: str) -> bytes:
    """Return the content of a WAV file.

    The samples, shape (n_sample,), are fractions of full scale, between -1 and 1; the highest
    code is one count below 1. Comment and software are the entries ICMT and ISFT of the INFO list,
    in UTF-8.
    """
    counts = np.minimum(np.round(samples * COUNTS), COUNTS - 1).astype("<i4")
    data = counts.view(np.uint8).reshape(-1, 4)[:, :BYTES].tobytes()
    form = struct.pack("<HHIIHH", PCM, 1, sample_rate, BYTES * sample_rate, BYTES, 8 * BYTES)
    info = _chunk(b"ICMT", comment.encode() + b"\0") + _chunk(b"ISFT", software.encode() + b"\0")
    chunks = _chunk(b"fmt ", form) + _chunk(b"LIST", b"INFO" + info) + _chunk(b"data", data)
    return _chunk(b"RIFF", b"WAVE" + chunks)


def _chunk(name: bytes, content: bytes) -> bytes:
    """Return a chunk: name, length, content, and a byte that makes an odd length even."""
    return name + struct.pack("<I", len(content)) + content + b"\0" * (len(content) % 2)
