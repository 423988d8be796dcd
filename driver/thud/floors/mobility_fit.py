"""Fit of a floor to a measured mobility from a file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import f90nml
import numpy as np

from thud.base._schema import MeasuredMobility
from thud.base.bridge import ask
from thud.base.checks import refuse, require_whole
from thud.base.display import Displayed, column_rows
from thud.base.errors import NumericalError, ThudError
from thud.base.extras import data_frame
from thud.base.note import Note
from thud.case.case import Case
from thud.floors.mobility_table import Quantity, read_mobility
from thud.impact.floor_impact import mobility
from thud.level.levels import get_bands

if TYPE_CHECKING:
    import os

    import pandas as pd
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]

# Minimum number of frequencies in an octave.
_MIN_POINTS = 2
# Numbers of poles to try, up to the maximum of the library.
_ORDERS = (2, 4, 6, 8, 10, 12, 14, 16, 20, 24, 28, 32, 40, 48, 56, 64)
# Numbers of poles without improvement after which the search ends.
_STAGNATION_LIMIT = 5
# Error at which the search ends: the rounding error of a table with eight digits.
_MIN_ERROR = 1e-8
# Maximum error of the fit without a warning, and maximum factor by which passivity increases it.
_MAX_ERROR = 0.1
_MAX_INCREASE = 1.5
# Range of geometric means of mobilities of floors, m/(N s): 0.5 m of concrete has 2e-7, one board
# on timber joists 8e-4.
_PLAUSIBLE = (1e-7, 1e-3)


@dataclass(frozen=True, eq=False, repr=False)
class MobilityFit(Displayed):
    """Measured mobility, and the fit by a passive sum of poles.

    Attributes
    ----------
    name : str
        Name, such as that of the file.
    frequency : ndarray, shape (n_point,)
        Frequencies of the measurement, Hz.
    measured : ndarray, shape (n_point,)
        The measured mobility, m/(N s), complex.
    floor : MeasuredMobility
        Floor with the fitted mobility, for `solve` and cases.
    free_error : float
        Relative error, root mean square, of the fit before it was made passive.
    """

    name: str
    frequency: Array
    measured: NDArray[np.complex128]
    floor: MeasuredMobility
    free_error: float

    def mobility(self, frequency: ArrayLike) -> NDArray[np.complex128]:
        """Return the mobility of the fit, m/(N s), at frequencies, Hz."""
        return mobility(self.floor, frequency)

    @property
    def error(self) -> float:
        """Relative error, root mean square over the frequency points."""
        return float(np.sqrt(np.mean(self._errors() ** 2)))

    def band_errors(self) -> dict[float, tuple[float, float]]:
        """Return errors in the octaves 31.5 to 500 Hz that the measurement covers.

        The keys are mid frequencies, Hz. The values are the root mean square of the relative error,
        and the level of the fitted − measured real part, which determines the energy into the
        floor, dB; NaN if a real part is not positive.
        """
        result = {}
        errors = self._errors()
        fitted = self.mobility(self.frequency)
        for name, inside in _covered(self.frequency).items():
            real = [np.trapezoid(y.real[inside], self.frequency[inside])
                    for y in (fitted, self.measured)]  # fmt: skip
            level = 10 * np.log10(real[0] / real[1]) if min(real) > 0 else np.nan
            result[name] = float(np.sqrt(np.mean(errors[inside] ** 2))), float(level)
        return result

    @property
    def notes(self) -> tuple[Note, ...]:
        """Warnings on the measurement and the fit."""
        result = _unit_warnings(self.measured)
        error, free_error = 100 * self.error, 100 * self.free_error
        if (negative := 100 * float(np.mean(self.measured.real < 0))) > 0:
            result.append(Note("real_part_negative", value=negative, unit="%"))
        if self.error > _MAX_ERROR:
            result.append(Note("mobility_misfit", value=error, high=100 * _MAX_ERROR, unit="%"))
        elif self.error > _MAX_INCREASE * self.free_error and self.error > _MIN_ERROR:
            result.append(Note("passivity_misfit", value=error, low=free_error, unit="%"))
        return tuple(result)

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text of the errors."""
        errors = self.band_errors()
        relative, level = zip(*errors.values(), strict=True)
        return column_rows(
            {
                "octave, Hz": (errors, "g"),
                "error, %": (100 * np.array(relative), ".2g"),
                "real part, dB": (level, "+z.2f"),
            }
        )

    def to_dataframe(self) -> pd.DataFrame:
        """Return the measured mobility and the fit, m/(N s), complex.

        Raise InputError if pandas is not installed.
        """
        fitted = self.mobility(self.frequency)
        return data_frame(
            {"frequency_Hz": self.frequency, "measured": self.measured, "fitted": fitted}
        )

    def namelist(self) -> str:
        """Return the groups ``&floor`` and ``&measured_mobility`` as text for a case."""
        case, groups = Case(floor=self.floor).to_namelist(), f90nml.Namelist()
        for group in ("floor", self.floor.name):
            groups[group] = case[group]
        return f"! Mobility {self.name}, fitted: relative error {self.error:.2g}.\n{groups}\n"

    def plot(self) -> Figure:
        """Draw the measured mobility and the fit."""
        from thud.plot.floor_figures import mobility_fit

        return mobility_fit(self)

    def _errors(self) -> Array:
        """Return the relative errors at the frequency points."""
        return np.asarray(np.abs(self.mobility(self.frequency) / self.measured - 1))

    def __repr__(self) -> str:
        """Return number of poles and error."""
        pairs = sum(ratio < 1 for ratio in self.floor.damping_ratio)
        order = len(self.floor.damping_ratio) + pairs
        poles = f"{order} pole{'s' * (order != 1)}"
        return f"<MobilityFit {self.name}: {poles}, error {100 * self.error:.2g} %>"


def fit_mobility(
    table: str | os.PathLike[str] | tuple[ArrayLike, ArrayLike],
    *,
    quantity: Quantity | None = None,
    order: int | None = None,
) -> MobilityFit:
    """Fit a passive sum of poles to a measured mobility.

    Relaxed vector fitting (Gustavsen 2006) minimizes the relative error. Then the residues are
    changed as little as possible to make the real part nowhere negative.

    Parameters
    ----------
    table
        A file, or a tuple of frequencies, Hz, and complex values. Files are tables in SI units with
        the columns ``frequency``, Hz, ``real`` and ``imaginary`` (or ``magnitude`` and ``phase``,
        degrees), or universal files with a frequency response (data set 58).
    quantity
        Quantity of the table: ``"mobility"``, m/(N s), ``"accelerance"``, 1/kg, or
        ``"receptance"``, m/N. By default what the file states, or ``"mobility"``.
    order
        Number of poles, two for a complex pair; by default the number with the minimum Bayesian
        information criterion.

    Raises
    ------
    InputError
        If the input is invalid; the message names the file, and the line, column or argument.
    """
    label, frequency, values = read_mobility(table, quantity)
    if len(frequency) <= 1:
        refuse(f"{label}: {len(frequency)} frequencies above 0 Hz", "two or more")
    if not _covered(frequency):
        refuse(
            f"{label}: {len(frequency)} frequencies from {frequency.min():g} to "
            f"{frequency.max():g} Hz cover no octave from 31.5 to 500 Hz",
            f"at least one octave, with {_MIN_POINTS} frequencies or more inside",
        )
    if order is not None:
        require_whole("order", order, 1, _ORDERS[-1])
    name = Path(label).stem
    try:
        if order is None:
            return _best_fit(name, frequency, values)
        return _fit(name, frequency, values, order)
    except ThudError as error:
        message = "; ".join([f"{label}: {error}", *map(str, _unit_warnings(values))])
        raise type(error)(message) from error


def _covered(frequency: Array) -> dict[float, NDArray[np.bool_]]:
    """Return which frequencies lie in each octave that they cover, by mid frequencies, Hz."""
    octaves = get_bands("octave")
    result = {}
    for name, low, high in zip(octaves.nominal, octaves.lower, octaves.upper, strict=True):
        inside = (frequency >= low) & (frequency < high)
        reached = frequency.min() <= low and frequency.max() >= high
        if reached and inside.sum() >= _MIN_POINTS:
            result[float(name)] = inside
    return result


def _unit_warnings(values: NDArray[np.complex128]) -> list[Note]:
    """Return a warning of mobilities, m/(N s), that no floor has; otherwise nothing."""
    mean = float(np.exp(np.mean(np.log(np.abs(values)))))
    low, high = _PLAUSIBLE
    is_plausible = low <= mean <= high
    note = Note("mobility_implausible", value=mean, low=low, high=high, unit="m/(N s)")
    return [] if is_plausible else [note]


def _best_fit(name: str, frequency: Array, values: NDArray[np.complex128]) -> MobilityFit:
    """Return the fit with the minimum information criterion for relative errors of equal size."""
    best, minimum, worse_count = None, np.inf, 0
    failure: ThudError | None = None
    orders = [order for order in _ORDERS if order < len(frequency)]
    for order in orders or [1]:
        # With fewer than three values for each coefficient, noise would be fitted.
        if best is not None and (
            worse_count == _STAGNATION_LIMIT or 3 * (2 * order + 1) > 2 * len(frequency)
        ):
            break
        worse_count += 1
        try:
            result = _fit(name, frequency, values, order)
        except ThudError as error:
            failure = failure or error
            continue
        fit_error = max(result.error, _MIN_ERROR)
        count = 2 * len(frequency)
        criterion = count * np.log(fit_error**2) + (2 * order + 1) * np.log(count)
        if criterion < minimum:
            best, minimum, worse_count = result, criterion, 0
        if fit_error <= _MIN_ERROR:
            break
    if best is None:
        raise failure or NumericalError("no fit of the mobility exists")
    return best


def _fit(name: str, frequency: Array, values: NDArray[np.complex128], order: int) -> MobilityFit:
    """Return the fit with a number of poles."""
    result: dict[str, Any] = ask(
        "mobility_fit", frequency=frequency, real=values.real, imaginary=values.imag, order=order
    )
    lists: dict[str, Any] = {
        key: value if isinstance(value, float) else tuple(map(float, value))
        for key, value in result["floor"].items()
    }
    return MobilityFit(name, frequency, values, MeasuredMobility(**lists), result["free_error"])
