"""Verdicts on what a surrogate answers, and which of them its errors could change."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from thud.level.assessment import get_criteria

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.base._schema import LimitsSource

    Values = NDArray[np.float64]


def assess_many(
    values: tuple[Values, ...], errors: tuple[Values, ...], source: LimitsSource
) -> dict[str, NDArray[Any]]:
    """Return margin, verdict, and whether errors could change it, of many drops.

    Parameters
    ----------
    values
        Octave levels, dB, shape (n, 5); contact time, s; restitution; number of peaks; mass, kg;
        height, m, as in `thud.assess`, shape (n,) or of one value.
    errors
        The same of their errors, in the same units.
    source
        Source whose limits apply.
    """
    count, bands = values[0].shape
    judged, by = (_columns(part, count) for part in (values, errors))
    criteria = get_criteria(source)
    lower = np.array([one.lower for one in criteria])
    upper = np.array([one.upper for one in criteria])
    inside = np.minimum(judged - lower, upper - judged)
    surely, perhaps = ((inside >= sign * by).all(axis=1) for sign in (1, -1))
    return {
        "margin": inside[:, :bands].min(axis=1),
        "conforms": (inside >= 0).all(axis=1),
        "doubtful": perhaps & ~surely,
    }


def _columns(parts: tuple[Values, ...], count: int) -> Values:
    """Return the values of all criteria, shape (count, n_criterion)."""
    levels = np.broadcast_to(parts[0], (count, parts[0].shape[-1]))
    return np.column_stack([levels, *(np.broadcast_to(part, count) for part in parts[1:])])
