"""Mobilities of floors: velocity at a point, divided by the force of the source."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from thud.base._schema import FloorOptions
from thud.base.bridge import ask
from thud.base.checks import refuse, refuse_value, require_array, require_kind, require_pair
from thud.base.display import Tabulated
from thud.base.files import replace_file, require_ending
from thud.base.note import Note
from thud.base.tables import csv_text
from thud.case.case import Case, case_text
from thud.level.levels import finite_array

if TYPE_CHECKING:
    import os

    from numpy.typing import ArrayLike, NDArray

    from thud.base.display import Columns

# Range of geometric means of mobilities of floors, m/(N s): 0.5 m of concrete has 2e-7, one board
# on timber joists 8e-4.
_PLAUSIBLE = (1e-7, 1e-3)


@dataclass(frozen=True, eq=False, repr=False)
class Mobility(Tabulated):
    """Mobility against frequency, of a floor or measured.

    Called with frequencies, Hz, it returns the mobilities there: those of the floor, or between
    measured values, by linear interpolation.

    Attributes
    ----------
    frequency : ndarray, shape (n,)
        Frequencies, Hz.
    values : ndarray, shape (n,)
        Mobilities, m/(N s), complex.
    name : str
        Name, such as that of the file or of the floor.
    floor : FloorOptions or None
        The floor; None for a measurement.
    point : tuple of float or None
        Position along length and width of the floor, m; None: at the source.
    """

    drawn_by: ClassVar[str] = "floor_figures.draw_mobility"

    is_curve = True
    frequency: NDArray[np.float64]
    values: NDArray[np.complex128]
    name: str = "measurement"
    floor: FloorOptions | None = None
    point: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        """Store arrays; raise InputError unless they are finite numbers of the same length."""
        frequency = finite_array("frequency", self.frequency, (1,))
        values = require_array("values", self.values, (1,))
        if values.size and values.dtype.kind not in "iufc":
            refuse("values are not numbers", "complex numbers")
        if frequency.shape != values.shape:
            refuse(
                f"{len(frequency)} frequencies and {len(values)} values",
                "one value for each frequency",
            )
        if not (is_valid := np.isfinite(values)).all():
            first = frequency[is_valid.argmin()]
            refuse(f"values: that at {first:g} Hz is not finite", "finite numbers")
        object.__setattr__(self, "frequency", frequency)
        object.__setattr__(self, "values", values.astype(complex))
        super().__post_init__()

    def __call__(self, frequency: ArrayLike) -> NDArray[np.complex128]:
        """Return the mobilities at frequencies, Hz, m/(N s), shape (n,).

        Raise InputError if a frequency is beyond those of a measurement.
        """
        if self.floor is not None:
            return mobility(self.floor, frequency, self.point).values
        frequencies = np.atleast_1d(finite_array("frequency", frequency, (0, 1)))
        order = np.argsort(self.frequency)
        known = self.frequency[order]
        outside = frequencies[(frequencies < known[0]) | (frequencies > known[-1])]
        if outside.size:
            refuse_value("frequency", float(outside[0]), f"{known[0]:g} to {known[-1]:g} Hz")
        return np.asarray(np.interp(frequencies, known, self.values[order]))

    @property
    def notes(self) -> tuple[Note, ...]:
        """Warnings on a measurement: mobilities that no floor has, and negative real parts."""
        used = np.abs(self.values[self.values != 0])
        if self.floor is not None or not used.size:
            return ()
        result, (low, high) = [], _PLAUSIBLE
        if not low <= (mean := float(np.exp(np.mean(np.log(used))))) <= high:
            note = Note("mobility_implausible", value=mean, low=low, high=high, unit="m/(N s)")
            result.append(note)
        if negative := 100 * float(np.mean(self.values.real < 0)):
            result.append(Note("real_part_negative", value=negative, unit="%"))
        return tuple(result)

    def columns(self) -> Columns:
        """Return real and imaginary part against frequency."""
        return {
            "frequency, Hz": (self.frequency, "g"),
            "real, m/(N s)": (self.values.real, ".4g"),
            "imaginary, m/(N s)": (self.values.imag, ".4g"),
        }

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the table to a CSV file (``.csv``), which `read_mobility` reads."""
        titles = "frequency (Hz)", "real (m/(N s))", "imaginary (m/(N s))"
        columns = np.column_stack([self.frequency, self.values.real, self.values.imag])
        replace_file(require_ending(path, ".csv"), csv_text([titles, *columns.tolist()]).encode())

    def __repr__(self) -> str:
        """Return name and range of frequencies."""
        low, high = self.frequency.min(), self.frequency.max()
        return f"<Mobility {self.name}: {len(self.frequency)} values, {low:g} to {high:g} Hz>"


def mobility(
    floor: FloorOptions, frequency: ArrayLike, point: tuple[float, float] | None = None
) -> Mobility:
    """Return the mobility of a floor, at the source or another point.

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
    Mobility
        Complex mobilities, m/(N s), at these frequencies; call it for others.

    Raises
    ------
    InputError
        If a key of the floor is out of range, the point is outside, or the floor has no sides.

    Examples
    --------
    >>> import thud
    >>> thud.mobility(thud.InfinitePlate(resistance=1600.0), [31.5]).values.real
    array([0.000625])
    """
    require_kind("floor", floor, FloorOptions)
    frequencies = np.atleast_1d(finite_array("frequency", frequency, (0, 1)))
    points = {} if point is None else {"point": np.array(require_pair("point", point))}
    answer = ask("mobility", case=case_text(Case(floor=floor)), frequency=frequencies, **points)
    values = answer["real"] + 1j * answer["imaginary"]
    return Mobility(frequencies, values, floor.name, floor, point)
