"""Results of many drops, by the names that the library gives them, with units and meanings."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from thud.base._schema import (
    BANDS,
    QUANTITIES,
    RATED_BANDS,
    SAMPLE_QUANTITIES,
)
from thud.base.key import Quantity
from thud.base.note import Note

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


NO_ERRORS = Note("no_numerical_errors")
# Nominal frequencies, Hz, by the name of the dimension: of force levels, and of levels in a room.
FREQUENCIES = {bands: entry["nominal"] for bands, entry in BANDS.items()} | {
    "rated_third": RATED_BANDS["third"]
}
# Dimension of the force exposure levels, of the elastic force, of the force on a rigid floor and of
# that on the floor of the case.
LEVELS: dict[str, str] = {
    f"{force}_{bands}": bands for bands in BANDS for force in ("elastic", "floor", "contact")
}
# Second dimension of results; the first is the sample.
DIMENSIONS = LEVELS | {"room_third": "rated_third"}


def _level(force: str, bands: str) -> Quantity:
    """Return the declaration of the levels of a force in bands."""
    meaning = f"force exposure level of the {force} force, re 1 N and 1 s"
    title = f"{force} level" if bands == "octave" else f"{force} {bands} level"
    return Quantity(f"{force}_{bands}", title, "L_{FE}", "dB", "dB", 1.0, 2, meaning)


def _number(name: str, meaning: str) -> Quantity:
    """Return the declaration of a pure number, a truth value or a text."""
    return Quantity(name, name, "", "", "", 1.0, 0, meaning)


# All results of samples, including those of surrogates and of their training, in their order.
RESULTS = {
    **{name: QUANTITIES[name] for name in SAMPLE_QUANTITIES},
    **{name: _level(name.partition("_")[0], bands) for name, bands in LEVELS.items()},
    "margin": QUANTITIES["margin"],
    "conforms": _number("conforms", "all criteria of the standard are met"),
    "status": _number("status", "0: computed; otherwise the exit code of the error"),
    "reason": _number("reason", "why there are no results"),
    "floor_work": QUANTITIES["floor_work"],
    "room_third": Quantity(
        "room_third", "level in the room", "L_{i,Fmax}", "dB", "dB", 1.0, 1,
        "maximum Fast level in the room, re 20 uPa",
    ),
    "room_rating": QUANTITIES["room_rating"],
    "undecided": _number("undecided", "the verdict could change by the errors of the surrogate"),
    "peaks": QUANTITIES["peak_count"],
}  # fmt: skip


def sample_warnings(
    status: NDArray[np.integer], reason: NDArray[np.object_], conforms: NDArray[np.bool_] | None
) -> tuple[Note, ...]:
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
        count = float(failed.sum())
        others = {"reason": cause}
        result.append(Note("samples_failed", value=count, high=failed.size, others=others))
    if conforms is not None and (unlike := ~failed & ~conforms).any():
        result.append(Note("samples_not_standard", value=float(unlike.sum()), high=failed.size))
    return tuple(result)
