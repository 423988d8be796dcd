"""The sets of a study: designs, and what they mean for the keys of the input."""

from __future__ import annotations

import math
import warnings
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.keys import DENSITY, TEMPERATURE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.studies.study import Study

    Columns = dict[str, NDArray[Any]]


def shape(study: Study) -> tuple[int, ...]:
    """Return the number of values of each parameter of a grid, or the one number of all sets."""
    if study.design == "grid":
        return tuple(parameter.spread.size for parameter in study.parameters)
    if study.design == "list":
        return (study.parameters[0].spread.size,)
    if study.design == "saltelli":
        return (study.size * (len(study.parameters) + 2),)
    return (study.size,)


def count(study: Study) -> int:
    """Return the number of sets."""
    return math.prod(shape(study))


def parameter_columns(study: Study, start: int, stop: int) -> Columns:
    """Return the parameters of some sets in their order, in the units of their keys.

    Parameters
    ----------
    study
        The study.
    start, stop
        The first set, and the one after the last.

    Returns
    -------
    dict of str to ndarray, shape (stop - start,)
        Values by the names of parameters.
    """
    if study.design == "grid":
        places = np.unravel_index(np.arange(start, stop), shape(study))
        return {p.name: p.spread.grid()[i] for p, i in zip(study.parameters, places, strict=True)}
    if study.design == "list":
        return {p.name: p.spread.grid()[start:stop] for p in study.parameters}
    shares = unit_sets(study.design, len(study.parameters), study.size, study.seed, start, stop)
    return {p.name: p.spread.quantile(shares[:, i]) for i, p in enumerate(study.parameters)}


def unit_sets(  # noqa: PLR0913, PLR0917 - a design has these many numbers
    design: str, dimension: int, size: int, seed: int, start: int, stop: int
) -> NDArray[np.float64]:
    """Return some points of a design in the unit cube, shape (stop - start, dimension).

    Random and Sobol points are made when they are asked for; the other designs are a whole.
    """
    if design == "random":
        generator = np.random.PCG64(seed).advance(start * dimension)
        return np.random.Generator(generator).random((stop - start, dimension))
    if design == "sobol":
        from scipy.stats import qmc  # noqa: PLC0415 - takes its time

        points = qmc.Sobol(dimension, rng=seed)
        if start:
            points.fast_forward(start)
        with warnings.catch_warnings():
            # The whole is a power of 2; its parts need not be.
            warnings.simplefilter("ignore", UserWarning)
            return _float(points.random(stop - start))
    return _whole(design, dimension, size, seed)[start:stop]


@lru_cache(maxsize=1)
def _whole(design: str, dimension: int, size: int, seed: int) -> NDArray[np.float64]:
    """Return all points of a design."""
    if design == "latin_hypercube":
        from scipy.stats import qmc  # noqa: PLC0415 - takes its time

        return _float(qmc.LatinHypercube(dimension, rng=seed).random(size))
    from SALib.sample import sobol as saltelli  # noqa: PLC0415 - takes its time

    cube = {
        "num_vars": dimension,
        "names": list(map(str, range(dimension))),
        "bounds": [[0.0, 1.0]] * dimension,
    }
    return _float(saltelli.sample(cube, size, calc_second_order=False, seed=seed))


def _float(points: Any) -> NDArray[np.float64]:  # noqa: ANN401 - of libraries without types
    """Return points as an array of floats."""
    return np.asarray(points, dtype=np.float64)


def key_columns(study: Study, columns: Columns) -> Columns:
    """Return what some sets mean for the keys of the input.

    The density gives the mass, and the temperature the modulus of elasticity.

    Parameters
    ----------
    study
        The study.
    columns
        What `parameter_columns` gives.

    Returns
    -------
    dict of str to ndarray, shape (n_set,)
        Values by the names of keys of the library.
    """
    found = dict(columns)
    density = found.pop(DENSITY.name, study.density)
    if density is not None:
        ball = vars(study.base.ball) | found
        volume = wall_volume(ball["outer_radius"], ball["wall_thickness"])
        found["mass"] = density * volume * np.ones(len(_first(columns)))
    temperature = found.pop(TEMPERATURE.name, None)
    if study.temperature and temperature is not None:
        law = study.temperature
        modulus = found.get("youngs_modulus", study.base.ball.youngs_modulus)
        found["youngs_modulus"] = modulus * (1 + law.coefficient * (temperature - law.reference))
    return found


def wall_volume(outer_radius: Any, wall_thickness: Any) -> Any:  # noqa: ANN401 - or arrays
    """Return the volume of the wall of a ball, m3, from its measures, m."""
    inner = outer_radius - wall_thickness
    # Products of absurd radii are infinite, where their powers are errors of Python.
    outer_cube, inner_cube = (radius * radius * radius for radius in (outer_radius, inner))
    return 4 / 3 * np.pi * (outer_cube - inner_cube)


def _first(columns: Columns) -> NDArray[Any]:
    """Return one of the columns."""
    return next(iter(columns.values()))
