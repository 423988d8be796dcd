"""Fit of a floor to a measured mobility from a file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import f90nml
import numpy as np

from thud.base._schema import MeasuredMobility
from thud.base.bridge import ask
from thud.base.checks import refuse, require_kind, require_whole
from thud.base.display import Tabulated
from thud.base.errors import NumericalError, ThudError
from thud.base.files import replace_file, require_ending
from thud.base.note import Note
from thud.case.case import Case
from thud.floors.mobility import Mobility, mobility
from thud.level.levels import get_bands

if TYPE_CHECKING:
    import os

    from numpy.typing import NDArray

    from thud.base.display import Columns

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


@dataclass(frozen=True, eq=False, repr=False)
class MobilityFit(Tabulated):
    """Measured mobility, and the fit by a passive sum of poles.

    Attributes
    ----------
    measured : Mobility
        The measurement.
    floor : MeasuredMobility
        Floor with the fitted mobility, for `solve` and cases.
    free_error : float
        Relative error, root mean square, of the fit before it was made passive.
    """

    drawn_by: ClassVar[str] = "floor_figures.draw_mobility_fit"

    measured: Mobility
    floor: MeasuredMobility
    free_error: float

    @property
    def name(self) -> str:
        """Name of the measurement, without the ending of its file."""
        return Path(self.measured.name).stem

    @property
    def fitted(self) -> Mobility:
        """Mobility of the fit at the frequencies of the measurement."""
        return mobility(self.floor, self.measured.frequency)

    @property
    def error(self) -> float:
        """Relative error, root mean square over the frequency points."""
        return float(np.sqrt(np.mean(self._errors() ** 2)))

    @property
    def notes(self) -> tuple[Note, ...]:
        """Warnings on the measurement and the fit."""
        result = [*self.measured.notes]
        error, free_error = 100 * self.error, 100 * self.free_error
        if self.error > _MAX_ERROR:
            result.append(Note("mobility_misfit", value=error, high=100 * _MAX_ERROR, unit="%"))
        elif self.error > _MAX_INCREASE * self.free_error and self.error > _MIN_ERROR:
            result.append(Note("passivity_misfit", value=error, low=free_error, unit="%"))
        return tuple(result)

    def columns(self) -> Columns:
        """Return errors in the octaves 31.5 to 500 Hz that the measurement covers.

        They are the root mean square of the relative error, and the level of the fitted − measured
        real part, which determines the energy into the floor; NaN if a real part is not positive.
        """
        frequency, errors = self.measured.frequency, self._errors()
        bands = _covered(frequency)
        levels = []
        for inside in bands.values():
            fitted, measured = (
                float(np.trapezoid(curve.values.real[inside], frequency[inside]))
                for curve in (self.fitted, self.measured)
            )
            is_known = min(fitted, measured) > 0
            levels.append(10 * np.log10(fitted / measured) if is_known else np.nan)
        relative = [100 * np.sqrt(np.mean(errors[inside] ** 2)) for inside in bands.values()]
        return {
            "octave, Hz": (np.array([*bands]), "g"),
            "error, %": (relative, ".2g"),
            "real part, dB": (levels, "+z.2f"),
        }

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write `namelist` to a file that ends with ``.nml``."""
        replace_file(require_ending(path, ".nml"), self.namelist().encode())

    def namelist(self) -> str:
        """Return the groups ``&floor`` and ``&measured_mobility`` as text for a case."""
        case, groups = Case(floor=self.floor).to_namelist(), f90nml.Namelist()
        for group in ("floor", self.floor.name):
            groups[group] = case[group]
        return f"! Mobility {self.name}, fitted: relative error {self.error:.2g}.\n{groups}\n"

    def _errors(self) -> Array:
        """Return the relative errors at the frequency points."""
        return np.asarray(np.abs(self.fitted.values / self.measured.values - 1))

    def __repr__(self) -> str:
        """Return number of poles and error."""
        pairs = sum(ratio < 1 for ratio in self.floor.damping_ratio)
        order = len(self.floor.damping_ratio) + pairs
        poles = f"{order} pole{'s' * (order != 1)}"
        return f"<MobilityFit {self.name}: {poles}, error {100 * self.error:.2g} %>"


def fit_mobility(measured: Mobility, *, order: int | None = None) -> MobilityFit:
    """Fit a passive sum of poles to a measured mobility.

    Relaxed vector fitting (Gustavsen 2006) minimizes the relative error. Then the residues are
    changed as little as possible to make the real part nowhere negative.

    Parameters
    ----------
    measured
        The mobility, such as that of `read_mobility`.
    order
        Number of poles, two for a complex pair; by default the number with the minimum Bayesian
        information criterion.

    Raises
    ------
    InputError
        If the measurement or `order` is invalid; the message names its file or the argument.
    """
    require_kind("measured", measured, Mobility)
    label, frequency, values = measured.name, measured.frequency, measured.values
    if (values == 0).any():
        first = frequency[(values == 0).argmax()]
        refuse(f"{label}: the value at {first:g} Hz is 0", "values other than 0")
    if not _covered(frequency):
        refuse(
            f"{label}: {len(frequency)} frequencies from {frequency.min():g} to "
            f"{frequency.max():g} Hz cover no octave from 31.5 to 500 Hz",
            f"at least one octave, with {_MIN_POINTS} frequencies or more inside",
        )
    if order is not None:
        require_whole("order", order, 1, _ORDERS[-1])
    try:
        return _best_fit(measured) if order is None else _fit(measured, order)
    except ThudError as error:
        implausible = (n for n in measured.notes if n.code == "mobility_implausible")
        message = "; ".join([f"{label}: {error}", *map(str, implausible)])
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


def _best_fit(measured: Mobility) -> MobilityFit:
    """Return the fit with the minimum information criterion for relative errors of equal size."""
    n_point = len(measured.frequency)
    best, minimum, worse_count = None, np.inf, 0
    failure: ThudError | None = None
    orders = [order for order in _ORDERS if order < n_point]
    for order in orders or [1]:
        # With fewer than three values for each coefficient, noise would be fitted.
        if best is not None and (
            worse_count == _STAGNATION_LIMIT or 3 * (2 * order + 1) > 2 * n_point
        ):
            break
        worse_count += 1
        try:
            result = _fit(measured, order)
        except ThudError as error:
            failure = failure or error
            continue
        fit_error = max(result.error, _MIN_ERROR)
        count = 2 * n_point
        criterion = count * np.log(fit_error**2) + (2 * order + 1) * np.log(count)
        if criterion < minimum:
            best, minimum, worse_count = result, criterion, 0
        if fit_error <= _MIN_ERROR:
            break
    if best is None:
        raise failure or NumericalError("no fit of the mobility exists")
    return best


def _fit(measured: Mobility, order: int) -> MobilityFit:
    """Return the fit with a number of poles."""
    result = ask(
        "mobility_fit", frequency=measured.frequency, real=measured.values.real,
        imaginary=measured.values.imag, order=order,
    )  # fmt: skip
    return MobilityFit(measured, MeasuredMobility(**result["floor"]), result["free_error"])
