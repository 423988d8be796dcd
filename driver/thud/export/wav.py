"""WAV files of one channel, by soundfile."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

from thud.base.bridge import version
from thud.base.extras import library

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

# Maximum number of bytes of a comment; libsndfile leaves out longer ones as a whole.
_MAX_COMMENT = 32_000


def wav_file(
    samples: NDArray[np.float64], sample_rate: int, comment: str, subtype: str = "FLOAT"
) -> bytes:
    """Return a WAV file with a comment.

    The samples, shape (n_sample,), are fractions of full scale, from -1 to 1; the highest whole
    number of the subtype ``"PCM_24"`` is one count below 1. Raise InputError if soundfile is not
    installed.
    """
    content = io.BytesIO()
    with library("soundfile", "recordings").SoundFile(
        content, "w", sample_rate, 1, subtype, format="WAV"
    ) as file:
        file.comment = comment.encode()[:_MAX_COMMENT].decode(errors="ignore")
        file.software = f"thud {version()}"
        file.write(samples)
    return content.getvalue()
