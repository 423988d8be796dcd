"""What results of many samples state of themselves."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

NO_ERRORS = "The samples state no numerical errors; a run of a single case states its own."


def sample_warnings(
    status: NDArray[np.integer], reason: NDArray[np.object_], conforms: NDArray[np.bool_] | None
) -> tuple[str, ...]:
    """Return warnings of samples without results, and of sources that do not conform.

    Parameters
    ----------
    status, reason
        Exit code and message of each sample, as in `Ensemble`, of any shape.
    conforms
        Whether each source conforms, of the same shape; None if levels in a room are not rated.
    """
    failed = status != 0
    result = []
    if failed.any():
        ((cause, _),) = Counter(reason[failed]).most_common(1)
        count = f"{failed.sum()} of {failed.size} samples have no results"
        result.append(f"{count}; most frequent reason: {cause}")
    if conforms is not None:
        others = ~failed & ~conforms
        if others.any():
            result.append(
                f"the sources of {others.sum()} of {failed.size} samples do not conform: their "
                "levels in the room are not those of a standard source"
            )
    return tuple(result)
