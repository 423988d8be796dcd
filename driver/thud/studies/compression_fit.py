"""The modulus of a ball from its force and deflection in a press."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.optimize import least_squares

from thud.base._schema import Ball, Compression
from thud.base.checks import refuse, require_array, require_real
from thud.base.errors import FitWarning, NumericalError
from thud.base.extras import require_extra
from thud.base.key import check_keywords
from thud.impact.compression import CompressionCurve, compress
from thud.studies.fitting.estimates import Estimates
from thud.studies.fitting.inference import require_confidence, runs_warning

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike, NDArray

    from thud.base._schema import CompressionGas, ModelName, ModelOptions

    Array = NDArray[np.float64]

# Number of points of a curve of the model, which is interpolated.
_POINTS = 81
_PARAMETERS = 2
_MIN_DATA = 5


@dataclass(frozen=True, eq=False)
class CompressionFit(Estimates):
    """Modulus of elasticity and first touch that fit a measured compression best.

    The ``youngs_modulus``, Pa, is the storage modulus of materials with Maxwell branches (the press
    measures their long-term modulus), and the modulus at about 1 Hz of a fractional damping law.
    ``touch`` is the deflection at which the plates touch the ball, m. See `Estimates` for the
    other attributes.

    Attributes
    ----------
    deflection, force : ndarray, shape (n,)
        The measured curve, m and N.
    curve : CompressionCurve
        The curve of the model, with deflections from first touch.
    """

    deflection: Array
    force: Array
    curve: CompressionCurve

    def __repr__(self) -> str:
        """Return the modulus and its standard error."""
        modulus, error = self.values["youngs_modulus"], self.standard_errors["youngs_modulus"]
        return f"<CompressionFit: E {modulus / 1e6:.4g} MPa +- {error / 1e6:.2g} MPa>"

    def to_dataframe(self) -> pd.DataFrame:
        """Return the measured curve and the force of the model."""
        with require_extra("studies"):
            import pandas as pd

        model = self.force + self.residuals
        return pd.DataFrame(
            {"deflection_m": self.deflection, "force_N": self.force, "model_N": model}
        )

    def plot(self) -> Figure:
        """Draw the measured curve from first touch on, and that of the model."""
        from thud.plot import compression

        shown = self.deflection >= self.values["touch"]
        measured = replace(
            self.curve,
            deflection=(self.deflection - self.values["touch"])[shown],
            force=self.force[shown],
        )
        return compression({"measured": measured, "model": self.curve})


@check_keywords
def fit_compression(  # noqa: PLR0913 - as in `compress`
    deflection: ArrayLike,
    force: ArrayLike,
    ball: Ball | None = None,
    model: ModelName | ModelOptions = "finite_element",
    *,
    gas: CompressionGas = Compression.gas,
    confidence: float = 0.95,
) -> CompressionFit:
    """Estimate the modulus of elasticity of a ball from a compression between two plates.

    Squared residuals of the force are minimized; the deflection at first touch is estimated too.
    Residuals are assumed to be independent and of equal variance. A warning reports if their signs
    are not random: the model then does not explain the curve.

    Parameters
    ----------
    deflection : array_like, shape (n,)
        Measured approach of the plates, m, ascending: the loading branch.
    force : array_like, shape (n,)
        Measured force, N.
    ball
        The ball, whose modulus starts the search; by default the ball of the paper.
    model, gas
        As in `compress`.
    confidence
        Confidence of the intervals.

    Returns
    -------
    CompressionFit
        Estimates, covariance, intervals and warnings, also issued as `FitWarning`.

    Raises
    ------
    InputError
        If the data or the model cannot be used.
    NumericalError
        If the model cannot be compressed that far, or its curve does not depend on the modulus.
    """
    start = Ball() if ball is None else ball
    measured, measured_force = _data(deflection, force)
    require_confidence(confidence)
    span = float(measured[-1] - measured[0])
    curves: dict[float, CompressionCurve] = {}

    def curve(modulus: float) -> CompressionCurve:
        """Return the curve of the model for a modulus, computed once."""
        if modulus not in curves:
            curves[modulus] = compress(
                replace(start, youngs_modulus=modulus), model, max_deflection=1.05 * span,
                points=_POINTS, gas=gas,
            )  # fmt: skip
        return curves[modulus]

    def residuals(x: Array) -> Array:
        result = curve(float(np.exp(x[0])) * start.youngs_modulus)
        depth = measured - measured[0] - x[1] * span
        model_force = PchipInterpolator(result.deflection, result.force)(np.maximum(depth, 0))
        return np.asarray(model_force - measured_force)

    # The plates may touch the ball a little before the first point.
    bounds = ([-np.inf, -0.04], [np.inf, 0.9])
    first = np.array(
        [np.log(_work_ratio(curve(start.youngs_modulus), measured, measured_force)), 0.0]
    )
    best = least_squares(residuals, first, bounds=bounds, x_scale=(1.0, 0.1), xtol=1e-10)
    if np.linalg.matrix_rank(best.jac) < _PARAMETERS:
        message = "youngs_modulus has no effect on the force of this model; allowed: another model"
        raise NumericalError(message)
    modulus = float(np.exp(best.x[0])) * start.youngs_modulus
    touch = float(measured[0] + best.x[1] * span)
    deviation = float(np.sqrt(best.fun @ best.fun / (len(measured_force) - _PARAMETERS)))
    scale = np.array([modulus, span])
    covariance = deviation**2 * np.linalg.inv(best.jac.T @ best.jac) * np.outer(scale, scale)
    result = tuple(_warnings(best.fun, best.x[1], bounds))
    for text in result:
        warnings.warn(text, FitWarning, stacklevel=3)
    return CompressionFit(
        names=("youngs_modulus", "touch"),
        units=("Pa", "m"),
        estimate=np.array([modulus, touch]),
        covariance=covariance,
        limits=np.array([[-np.inf, np.inf]] * _PARAMETERS),
        confidence=confidence,
        noise=deviation,
        residuals=best.fun,
        warnings=result,
        deflection=measured,
        force=measured_force,
        curve=curve(modulus),
    )


def _data(deflection: ArrayLike, force: ArrayLike) -> tuple[Array, Array]:
    """Return both columns; raise InputError if they are not a curve."""
    measured, measured_force = (
        require_real(name, require_array(name, values, {1}))
        for name, values in (("deflection", deflection), ("force", force))
    )
    if measured.shape != measured_force.shape or len(measured) < _MIN_DATA:
        refuse(
            f"deflection has {len(measured)} entries and force {len(measured_force)}",
            f"the same number, at least {_MIN_DATA}",
        )
    if not (np.isfinite(measured).all() and np.isfinite(measured_force).all()):
        refuse("deflection or force is not finite", "finite numbers")
    falling = np.flatnonzero(np.diff(measured) <= 0)
    if falling.size:
        refuse(f"deflection does not rise at point {falling[0] + 2}", "the loading branch")
    if not measured_force[-1] > max(0.0, measured_force[0]):
        refuse("force does not rise with the deflection", "forces that are positive in compression")
    return measured, measured_force


def _work_ratio(curve: CompressionCurve, measured: Array, measured_force: Array) -> float:
    """Return the measured work divided by that of a curve; raise InputError if that is 0."""
    work = float(np.trapezoid(measured_force, measured))
    shown = np.interp(measured - measured[0], curve.deflection, curve.force)
    model_work = float(np.trapezoid(shown, measured))
    if not model_work > 0:
        refuse(
            f"deflection spans {np.ptp(measured):g} m, where the model has no force",
            "a compression by millimeters",
        )
    return max(work, 0.01 * float(measured_force[-1] * np.ptp(measured))) / model_work


def _warnings(
    residuals: Array, relative_touch: float, bounds: tuple[list[float], list[float]]
) -> list[str]:
    result = []
    if min(relative_touch - bounds[0][1], bounds[1][1] - relative_touch) < 1e-6:  # noqa: PLR2004 - of the span
        result.append(
            "the first touch lies at the limit of the search: give data from first touch on"
        )
    if runs := runs_warning(residuals):
        result.append(f"{runs}: the model does not explain the curve")
    return result
