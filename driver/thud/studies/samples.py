"""Studies of many samples, and the values of keys in each sample."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from thud.base.bridge import version
from thud.base.checks import refuse
from thud.case.keys import DENSITY
from thud.impact.ensemble import solve_many
from thud.level.levels import peak_count
from thud.studies.sampling import sampler_versions, unit_samples
from thud.studies.study import Study, wall_volume

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.case.case import Case
    from thud.studies.temperature import Temperature
    from thud.studies.trained_surrogate import Surrogate

    Columns = dict[str, NDArray[Any]]


# Numbers of samples in a block, which takes some tenths of a second, of elements more: predicted by
# a surrogate, by the batch of shells, by other models, and by elements.
_SURROGATE_BLOCK_SIZE, _BATCH_BLOCK_SIZE, _BLOCK_SIZE, _ELEMENT_BLOCK_SIZE = 2**16, 2**14, 32, 1


@dataclass(frozen=True)
class SampleStudy(Study):
    """A study whose samples differ from its case in the values of the parameters.

    Attributes
    ----------
    design : str
        ``"grid"``, ``"list"``, ``"random"``, ``"latin_hypercube"``, ``"sobol"`` or ``"saltelli"``.
    size, seed : int
        Number of random samples (of base samples for ``"saltelli"``), and the seed.
    temperature : Temperature or None
        How the material depends on temperature, if the temperature is a parameter.
    surrogate : Surrogate or None
        Surrogate that predicts the samples instead of the model.
    """

    design: str = "grid"
    size: int = 0
    seed: int = 0
    temperature: Temperature | None = None
    surrogate: Surrogate | None = None

    # Whether the peaks of the assessed force are counted in each sample.
    counts_peaks: ClassVar[bool] = False

    def kind_settings(self) -> dict[str, str]:
        """Return the settings of design, temperature and surrogate on which results depend."""
        result = sampler_versions(self.design) | {"[design] kind": self.design}
        if self.size:
            result |= {"[design] size": f"{self.size}", "[design] seed": f"{self.seed}"}
        if self.temperature:
            result |= {f"[temperature] {k}": f"{v!r}" for k, v in self.temperature.table.items()}
        if self.surrogate:
            result["surrogate"] = self.surrogate.digest
        return result

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values of each parameter in a grid; for other designs the number of samples."""
        if self.design == "grid":
            return tuple(parameter.size for parameter in self.parameters)
        if self.design == "list":
            return (self.parameters[0].size,)
        if self.design == "saltelli":
            return (self.size * (len(self.parameters) + 2),)
        return (self.size,)

    @property
    def count(self) -> int:
        """Number of samples."""
        return math.prod(self.shape)

    @property
    def block_size(self) -> int:
        """Number of samples that are computed together, the same for all executors."""
        if self.surrogate:
            return _SURROGATE_BLOCK_SIZE
        model = self.case.model.name if self.case.model else ""
        if model == "finite_element":
            return _ELEMENT_BLOCK_SIZE
        is_batch = not self.case.floor and self.case.levels.method == "exact"
        return _BATCH_BLOCK_SIZE if model == "hollow_sphere" and is_batch else _BLOCK_SIZE

    def parameter_columns(self, start: int, stop: int) -> Columns:
        """Return values of samples `start` to `stop` - 1 by parameter, shape (n_sample,)."""
        if self.design == "grid":
            indices = np.unravel_index(np.arange(start, stop), self.shape)
            return {p.name: p.grid()[i] for p, i in zip(self.parameters, indices, strict=True)}
        if self.design == "list":
            return {p.name: p.grid()[start:stop] for p in self.parameters}
        fractions = unit_samples(
            self.design, len(self.parameters), self.size, self.seed, start, stop
        )
        return {p.name: p.quantiles(fractions[:, i]) for i, p in enumerate(self.parameters)}

    def key_columns(self, columns: Columns) -> Columns:
        """Return samples of `parameter_columns` as values of keys, shape (n_sample,).

        The density determines the mass; the temperature determines modulus and loss factor.
        """
        result = dict(columns)
        density = result.pop(DENSITY.name, self.density)
        if density is not None:
            ball = vars(self.case.resolved().ball) | result
            volume = wall_volume(ball["outer_radius"], ball["wall_thickness"])
            result["mass"] = density * volume * np.ones(len(next(iter(columns.values()))))
        return self.temperature.apply(self.case, result) if self.temperature else result


@dataclass(frozen=True)
class Block:
    """Samples from index `start` on that are computed together.

    `columns` are the values, shape (n_sample,), of the keys in which samples differ from the case.
    `version` is the required version of thud; `surrogate` replaces the model if there is one.
    """

    start: int
    case: Case
    columns: Columns
    version: str
    surrogate: Surrogate | None = None
    counts_peaks: bool = False


def evaluate(block: Block) -> Columns:
    """Return the results of a block by names as in `RESULTS`; NaN for a failed sample.

    Raise InputError if the block requires another version of thud.
    """
    if block.version != version():
        refuse(
            f"thud {version()} cannot compute samples of thud {block.version}",
            "the same version everywhere",
        )
    if block.surrogate:
        return block.surrogate.predict(block.case, block.columns)
    result = solve_many(block.columns, block.case, threads=1, forces=block.counts_peaks)
    columns = result.results
    columns["status"] = columns["status"].astype("int8")
    if block.counts_peaks:
        forces = getattr(result, f"{block.case.levels.force}_force")
        columns["peaks"] = np.array(
            [peak_count(f, result.sample_rate) if np.isfinite(f).all() else np.nan for f in forces]
        )
    return columns
