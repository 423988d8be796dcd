"""Mobility of floors."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from thud.base._schema import FloorOptions
from thud.base.bridge import ask
from thud.base.checks import refuse, require_array, require_kind, require_pair, require_real
from thud.case.case import Case, case_text

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


def mobility(
    floor: FloorOptions, frequency: ArrayLike, point: tuple[float, float] | None = None
) -> NDArray[np.complex128]:
    """Return the mobility of a floor: velocity, at the source or a point, divided by the force.

    Parameters
    ----------
    floor
        An object of `Rigid`, `InfinitePlate`, `Oscillator`, `Plate` or another floor.
    frequency : array_like, shape (n,)
        Frequencies, Hz.
    point
        Position along length and width of a rectangular floor, m; None: at the source.

    Returns
    -------
    ndarray, shape (n,)
        Complex mobilities, m/(N s).

    Raises
    ------
    InputError
        If a key of the floor is out of range, the point is outside, or the floor has no sides.

    Examples
    --------
    >>> import thud
    >>> thud.mobility(thud.InfinitePlate(resistance=1600.0), [31.5]).real
    array([0.000625])
    """
    require_kind("floor", floor, FloorOptions)
    values = require_real("frequency", require_array("frequency", frequency, dimensions=(0, 1)))
    if not np.isfinite(values).all():
        refuse("frequency has a value that is not finite", "finite numbers, Hz")
    frequencies = np.ascontiguousarray(np.atleast_1d(values))
    points = {} if point is None else {"point": np.array(require_pair("point", point))}
    answer = ask("mobility", case=case_text(Case(floor=floor)), frequency=frequencies, **points)
    return np.asarray(answer["real"] + 1j * answer["imaginary"])
