"""What becomes of a block of sets: one call of the library, whatever computes it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from thud import _schema as schema
from thud._api import version
from thud.ensemble import get_cost, solve_many
from thud.errors import InputError
from thud.impact import FORCES
from thud.levels import BANDWIDTHS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.case import Case

    Columns = dict[str, NDArray[Any]]

# By name: unit and meaning of the numbers that each set has.
SCALARS = {
    name: (schema.SCALARS[name][0] or "1", schema.SCALARS[name][1]) for name in schema.OUTCOMES
}
# A block of sets should take about this time, s.
_BLOCK_TIME = 0.5


@dataclass(frozen=True)
class Block:
    """Sets that are computed together.

    Attributes
    ----------
    start : int
        The first of them.
    case : Case
        The case from which they differ.
    columns : dict of str to ndarray, shape (n_set,)
        Their values by the names of keys.
    version : str
        The version of thud that has to compute them.
    """

    start: int
    case: Case
    columns: Columns
    version: str


def evaluate(block: Block) -> Columns:
    """Compute the sets of a block.

    Parameters
    ----------
    block
        The sets.

    Returns
    -------
    dict of str to ndarray, shape (n_set,) or (n_set, n_band)
        The `SCALARS`; the levels of `level_names`, dB; ``margin``, the minimum distance of the
        judged force's octave levels to a limit, dB; ``conforms``; ``status``, 0 or the exit code
        of the error; ``reason``, its text. Sets with an error have no numbers: NaN.

    Raises
    ------
    InputError
        Where this is another version of thud.
    """
    if block.version != version():
        message = (
            f"thud {version()} is asked for sets of thud {block.version}; "
            f"allowed: the same version everywhere"
        )
        raise InputError(message)
    found = solve_many(block.columns, block.case, threads=1)
    columns: Columns = {name: getattr(found, name) for name in SCALARS}
    for name, (force, bands) in level_names(block.case).items():
        columns[name] = found.levels[force, bands]
    return columns | {
        "margin": found.margin,
        "conforms": found.conforms,
        "status": found.status.astype("int8"),
        "reason": found.reason,
    }


def level_names(case: Case) -> dict[str, tuple[str, str]]:
    """Return force and bands of the levels that each set has, by their names.

    The octaves serve the verdict also where the case wants others only.
    """
    octave, *others = BANDWIDTHS
    wanted = [bands for bands in others if case.levels.bands in {bands, "both"}]
    names = {f"{force}_level": (force, octave) for force in FORCES}
    return names | {
        f"{force}_{bands}_level": (force, bands) for bands in wanted for force in FORCES
    }


def block_size(case: Case) -> int:
    """Return how many sets are computed together: the same wherever they are computed."""
    return max(1, round(_BLOCK_TIME / get_cost(case)))
