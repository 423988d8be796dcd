"""How a surrogate is trained: the table ``[surrogate]`` of a study."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from thud.base.checks import (
    LARGEST_SEED,
    refuse_value,
    require_number,
    require_whole,
    require_words,
)
from thud.base.extras import require_extra
from thud.studies.trained_surrogate import Surrogate, read_surrogate

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

# Fewer drops have no order statistic that bounds 95 % of all with a confidence of 95 %.
MIN_DROPS = 64
# Training takes the third power of their number.
MAX_DROPS = 8192


@dataclass(frozen=True)
class Plan:
    """How a surrogate is trained.

    Attributes
    ----------
    error : float
        Bound of the error of what is judged, dB.
    size : int
        Maximum number of drops.
    seed : int
        Seed of their design, scrambled points of Sobol.
    """

    error: float = 0.1
    size: int = 1024
    seed: int = 0

    @property
    def identity(self) -> dict[str, str]:
        """What a surrogate depends on besides its drops, as texts by place and key."""
        with require_extra("surrogate"):
            import sklearn
        return {
            "scikit-learn_version": sklearn.__version__,
            **{f"[surrogate] {word}": f"{value!r}" for word, value in vars(self).items()},
        }

    @property
    def stages(self) -> list[tuple[int, int]]:
        """First and one past the last drop of each stage: steps of half, of at most `size`."""
        ends = [min(MIN_DROPS, self.size)]
        while ends[-1] < self.size:
            # 64, 96, 128, 192, ...: whole parts of the sequence.
            power = 1 << (ends[-1].bit_length() - 1)
            step = power // 2 if ends[-1] == power else 2 * power - ends[-1]
            ends.append(min(ends[-1] + step, self.size))
        return list(zip([0, *ends[:-1]], ends, strict=True))


def read_plan(given: Mapping[str, object], folder: Path) -> Plan | Surrogate:
    """Return the plan of a table ``[surrogate]``, or the surrogate of the file that it names."""
    place = "[surrogate]"
    if "file" in given:
        require_words(f"{place} with file", given, ("file",))
        path = given["file"]
        if not isinstance(path, str) or not path.strip():
            refuse_value(f"{place} file", path, "the path of a saved surrogate")
        return read_surrogate(folder / path)
    require_words(place, given, ("error", "size", "seed", "file"))
    error, size, seed = (given.get(w, getattr(Plan, w)) for w in ("error", "size", "seed"))
    require_number(f"{place} error", error)
    if not error > 0:  # type: ignore[operator]
        refuse_value(f"{place} error", error, "numbers above 0, dB")
    require_whole(f"{place} size", size, MIN_DROPS, MAX_DROPS)
    require_whole(f"{place} seed", seed, 0, LARGEST_SEED)
    return Plan(float(error), size, seed)  # type: ignore[arg-type]
