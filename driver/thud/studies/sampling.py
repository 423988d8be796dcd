"""Points of random designs."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from thud.base.checks import refuse
from thud.base.immutable import freeze

if TYPE_CHECKING:
    from thud.studies.arrays import Array

SAMPLED = ("random", "latin_hypercube", "sobol", "saltelli")
# Minimum number of base samples for Sobol indices.
MIN_BASE_SAMPLES = 4


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
