"""Surrogates: a study of a slow model, of which a Gaussian process learns the samples."""

from __future__ import annotations

from typing import TYPE_CHECKING, Unpack

from thud.studies.run import compute
from thud.studies.trained_surrogate import Surrogate

if TYPE_CHECKING:
    import os

    from thud.studies.run import RunOptions
    from thud.studies.study import Source


def surrogate(
    study: Source, output: str | os.PathLike[str] | None = None, **options: Unpack[RunOptions]
) -> Surrogate:
    """Train a surrogate: a fast approximation of a slow model for other studies.

    Each parameter of the study has `low` and `high`; ``[design] size`` is the number of drops, a
    power of 2 from 64. Arguments and errors are those of `sweep`; InputError is also raised if a
    drop has no result, or drops differ in their number of peaks.
    """
    return compute(Surrogate, study, output, **options)
