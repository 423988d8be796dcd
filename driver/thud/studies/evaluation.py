"""How a block of samples is computed, by any backend: one call of the library."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base.bridge import version
from thud.base.checks import refuse
from thud.impact.ensemble import solve_many
from thud.impact.quantities import FLOOR_QUANTITIES, LEVELS, SCALAR_QUANTITIES
from thud.level.levels import BANDWIDTHS, peak_count

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.base._schema import BandSet, LevelsForce
    from thud.case.case import Case
    from thud.studies.trained_surrogate import Surrogate

    Columns = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class Block:
    """Samples from number `start` on that are computed together.

    They differ from the case in the columns, shape (n_sample,), by names of keys; `version` is that
    of thud which has to compute them. A surrogate answers instead of the model if there is one.
    """

    start: int
    case: Case
    columns: Columns
    version: str
    surrogate: Surrogate | None = None
    counts_peaks: bool = False


def evaluate(block: Block) -> Columns:
    """Compute the samples of a block.

    Returns the `SCALAR_QUANTITIES`; the levels of `level_names`, dB, shape (n_sample, n_band);
    ``margin``, dB; ``conforms``; ``status`` and ``reason``; on floors ``contact_octave_level`` and
    the like, and `FLOOR_QUANTITIES`; of a surrogate ``doubtful``; where they are counted, the
    ``peaks`` of the judged force. Samples with an error have no numbers: NaN.
    Raises InputError where this is another version of thud.
    """
    if block.version != version():
        refuse(
            f"thud {version()} cannot compute samples of thud {block.version}",
            "the same version everywhere",
        )
    if block.surrogate:
        return block.surrogate.predict(block.case, block.columns)
    found = solve_many(block.columns, block.case, threads=1, forces=block.counts_peaks)
    columns: Columns = {name: getattr(found, name) for name in SCALAR_QUANTITIES}
    for name, (force, bands) in level_names(block.case).items():
        columns[name] = found.levels[force, bands]
    columns |= {f"contact_{bands}_level": level for bands, level in found.contact_levels.items()}
    columns |= {n: v for n in FLOOR_QUANTITIES if (v := getattr(found, n)) is not None}
    if block.counts_peaks:
        forces = getattr(found, f"{block.case.levels.force}_force")
        columns["peaks"] = np.array(
            [peak_count(f, found.sample_rate) if np.isfinite(f).all() else np.nan for f in forces]
        )
    return columns | {
        "margin": found.margin,
        "conforms": found.conforms,
        "status": found.status.astype("int8"),
        "reason": found.reason,
    }


def level_names(case: Case) -> dict[str, tuple[LevelsForce, BandSet]]:
    """Return force and bands of the levels of each sample, by name.

    Octaves are always among them: the verdict needs them.
    """
    wanted = {BANDWIDTHS[0], *(BANDWIDTHS if case.levels.bands == "both" else [case.levels.bands])}
    return {name: entry for name, entry in LEVELS.items() if entry[1] in wanted}
