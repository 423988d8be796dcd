"""Sampling designs: which samples a study has, and the points of random designs."""

from __future__ import annotations

import math
import warnings
from functools import lru_cache
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base.checks import MAX_SEED, refuse, refuse_unknown, refuse_value, require_whole
from thud.studies.parameter import MAX_VALUES, Parameter

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

SAMPLED = ("random", "latin_hypercube", "sobol", "saltelli")
# Minimum number of base samples for Sobol indices.
MIN_BASE_SAMPLES = 4
# Largest integer of NumPy.
_MAX_SAMPLES = 2**63 - 1


def sampler_versions(design: str) -> dict[str, str]:
    """Return the versions of the packages on which the points of a design depend."""
    names = {"saltelli": ("scipy", "SALib")}.get(design, ("scipy",) if design in SAMPLED else ())
    return {f"{name.lower()}_version": version(name) for name in names}


def read_design(
    table: Mapping[str, Any], allowed: tuple[str, ...], parameters: tuple[Parameter, ...]
) -> dict[str, Any]:
    """Return design, size and seed of ``[design]``; the first allowed kind is the default."""
    design = table.get("kind", allowed[0])
    if design not in allowed:
        refuse_value("[design] kind", design, ", ".join(allowed))
    words = ("kind", "size", "seed") if design in SAMPLED else ("kind",)
    refuse_unknown(f"[design] of kind {design}", table, words)
    for parameter in parameters:
        if design in SAMPLED and parameter.count:
            refuse(
                f"[parameters] {parameter.name}: count is not used by a {design} design",
                "low, high and scale",
            )
        if design not in SAMPLED and not parameter.size:
            refuse(
                f"[parameters] {parameter.name} has no values for a {design} design",
                "values = [...], or low, high and count",
            )
    if design == "list" and len({p.size for p in parameters}) > 1:
        refuse("[parameters] differ in their number of values", "the same for all")
    if design == "grid" and math.prod(p.size for p in parameters) > _MAX_SAMPLES:
        refuse("[parameters] make too many samples", "up to 2^63 - 1 in a grid")
    if design not in SAMPLED:
        return {"design": design}
    size, seed = table.get("size", 0), table.get("seed", 0)
    minimum = MIN_BASE_SAMPLES if design == "saltelli" else 1
    require_whole("[design] size", size, minimum, MAX_VALUES)
    require_whole("[design] seed", seed, 0, MAX_SEED)
    if design in {"sobol", "saltelli"} and size & (size - 1):
        near = 1 << size.bit_length() - 1
        refuse(
            f"[design] size = {size} breaks the balance of Sobol's points",
            f"powers of 2, such as {near} or {2 * near}",
        )
    return {"design": design, "size": size, "seed": seed}


def unit_samples(  # noqa: PLR0913, PLR0917 - the numbers of a design
    design: str, dimension: int, size: int, seed: int, start: int, stop: int
) -> NDArray[np.float64]:
    """Return points of a design in the unit cube, shape (stop - start, dimension)."""
    if design == "random":
        generator = np.random.PCG64(seed).advance(start * dimension)
        return np.random.Generator(generator).random((stop - start, dimension))
    if design == "sobol":
        from scipy.stats import qmc

        points = qmc.Sobol(dimension, rng=seed)
        if start:
            points.fast_forward(start)
        with warnings.catch_warnings():
            # The size of the design is a power of 2, that of a block need not be.
            warnings.simplefilter("ignore", UserWarning)
            return _float(points.random(stop - start))
    return _all_points(design, dimension, size, seed)[start:stop]


@lru_cache(maxsize=1)
def _all_points(design: str, dimension: int, size: int, seed: int) -> NDArray[np.float64]:
    """Return all points of a design that cannot be sampled block by block."""
    try:
        if design == "latin_hypercube":
            from scipy.stats import qmc

            return _float(qmc.LatinHypercube(dimension, rng=seed).random(size))
        from SALib.sample import sobol as saltelli

        names = list(map(str, range(dimension)))
        cube = {"num_vars": dimension, "names": names, "bounds": [[0.0, 1.0]] * dimension}
        return _float(saltelli.sample(cube, size, calc_second_order=False, seed=seed))
    except MemoryError as error:
        refuse(f"[design] size = {size} of kind {design} does not fit in memory", "fewer", error)


def _float(points: Any) -> NDArray[np.float64]:  # noqa: ANN401 - of libraries without types
    return np.asarray(points, dtype=np.float64)
