"""Sampling designs: which samples a study has, and the points of random designs."""

from __future__ import annotations

import math
from functools import lru_cache
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base.checks import MAX_SEED, refuse, refuse_unknown, refuse_value, require_whole
from thud.base.immutable import freeze
from thud.studies.parameter import MAX_VALUES

if TYPE_CHECKING:
    from collections.abc import Mapping

    from thud.studies.arrays import Array
    from thud.studies.parameter import Parameter

SAMPLED = ("random", "latin_hypercube", "sobol", "saltelli")
# Minimum number of base samples for Sobol indices.
MIN_BASE_SAMPLES = 4


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
    is_sampled = design in SAMPLED
    words = ("kind", "size", "seed") if is_sampled else ("kind",)
    refuse_unknown(f"[design] of kind {design}", table, words)
    for parameter in parameters:
        label = f"[parameters] {parameter.name}"
        if is_sampled and parameter.count:
            refuse(f"{label}: count is not used by a {design} design", "low, high and scale")
        if not is_sampled and not parameter.size:
            refuse(
                f"{label} has no values for a {design} design",
                "values = [...], or low, high and count",
            )
    if not is_sampled:
        sizes = [parameter.size for parameter in parameters]
        if design == "list" and len(set(sizes)) > 1:
            refuse("[parameters] differ in their number of values", "the same for all")
        if design == "grid" and math.prod(sizes) > MAX_VALUES:
            refuse("[parameters] make too many samples", f"up to {MAX_VALUES} in a grid")
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


@lru_cache(maxsize=1)
def unit_samples(design: str, dimension: int, size: int, seed: int) -> Array:
    """Return the points of a design in the unit cube, shape (n_sample, dimension), read-only.

    A ``"saltelli"`` design has `dimension` + 2 samples for each of the `size` base samples.
    """
    try:
        if design == "saltelli":
            from SALib.sample import sobol as saltelli

            names = list(map(str, range(dimension)))
            cube = {"num_vars": dimension, "names": names, "bounds": [[0.0, 1.0]] * dimension}
            points = saltelli.sample(cube, size, calc_second_order=False, seed=seed)
        elif design == "random":
            points = np.random.Generator(np.random.PCG64(seed)).random((size, dimension))
        else:
            from scipy.stats import qmc

            engine = qmc.Sobol if design == "sobol" else qmc.LatinHypercube
            points = engine(dimension, rng=seed).random(size)
        return freeze(np.asarray(points, dtype=np.float64))
    except MemoryError as error:
        refuse(f"[design] size = {size} of kind {design} does not fit in memory", "fewer", error)
