"""WAV files of one channel, by soundfile."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import numpy as np

from thud.base.bridge import version
from thud.base.extras import library

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Counts at full scale of 24 bit.
_COUNTS = 2**23
# Maximum number of bytes of a comment; libsndfile leaves out longer ones as a whole.
_MAX_COMMENT = 32_000


def wav_file(
    samples: NDArray[np.float64], sample_rate: int, comment: str, *, whole: bool = False
) -> bytes:
    """Return a WAV file with a comment, of floats of 32 bit or whole numbers of 24 bit.

    The samples, shape (n_sample,), are fractions of full scale, between -1 and 1; the highest whole
    number is one count below 1. Raise InputError if soundfile is not installed.
    """
    content = io.BytesIO()
    with library("soundfile", "recordings").SoundFile(
        content, "w", sample_rate, 1, "PCM_24" if whole else "FLOAT", format="WAV"
    ) as file:
        file.comment = comment.encode()[:_MAX_COMMENT].decode(errors="ignore")
        file.software = f"thud {version()}"
        if whole:
            # soundfile writes the upper 24 of 32 bit.
            counts = np.minimum(np.round(samples * _COUNTS), _COUNTS - 1)
            file.write(counts.astype(np.int32) << 8)
        else:
            file.write(samples.astype(np.float32))
    return content.getvalue()
