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
    """Sets from number `start` on that are computed together.

    They differ from the case in the columns, shape (n_set,), by names of keys; `version` is that of
    thud which has to compute them.
    """

    start: int
    case: Case
    columns: Columns
    version: str


def evaluate(block: Block) -> Columns:
    """Compute the sets of a block.

    Returns the `SCALARS`; the levels of `level_names`, dB, shape (n_set, n_band); ``margin``, dB;
    ``conforms``; ``status`` and ``reason``. Sets with an error have no numbers: NaN.
    Raises InputError where this is another version of thud.
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
    """Return force and bands of the levels of each set, by name.

    Octaves are always among them: the verdict needs them.
    """
    octave, *others = BANDWIDTHS
    wanted = [bands for bands in others if case.levels.bands in {bands, "both"}]
    names = {f"{force}_level": (force, octave) for force in FORCES}
    return names | {
        f"{force}_{bands}_level": (force, bands) for bands in wanted for force in FORCES
    }


def block_size(case: Case) -> int:
    """Return the number of sets in a block, the same for all backends."""
    return max(1, round(_BLOCK_TIME / get_cost(case)))
