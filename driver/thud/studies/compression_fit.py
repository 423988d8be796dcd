"""The modulus of a ball from its force and deflection in a press."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.optimize import least_squares

from thud.base._schema import Ball, Compression
from thud.base.checks import refuse, refuse_value, require_array, require_number
from thud.base.errors import FitWarning, NumericalError
from thud.base.note import Note
from thud.case.case import Case, new_model
from thud.case.keys import value_in
from thud.impact.compression import CompressionCurve, compress
from thud.studies.fitting.alternatives import PRESS_UNKNOWNS, require_unknowns
from thud.studies.fitting.estimates import Estimates
from thud.studies.fitting.fit_report import compression_files, compression_table
from thud.studies.fitting.inference import require_confidence
from thud.studies.fitting.marginal import Marginal, estimate_marginal
from thud.studies.fitting.residual_tests import color_warning, misfit_ratio

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from thud.base._schema import CompressionGas, ModelName, ModelOptions
    from thud.studies.arrays import Array


# Number of points of a curve of the model, which is interpolated.
_POINTS = 81
_PARAMETERS = 2
_MIN_DATA = 5
# Limits of the search: the plates may touch the ball a little before the first point.
_BOUNDS = ([-np.inf, -0.04], [np.inf, 0.9])
# Deflection over the span at which friction slides: it rises without a jump.
_SLIP = 0.01
# Step of the differences, of the logarithm of the modulus and of the touch over the span; maximum
# number of steps, and their size over the standard errors at which they end.
_STEP = 1e-3
_MAX_STEPS = 20
_CONVERGED = 0.05
# Minimum noise over the maximum force: errors of the interpolated curve.
NUMERICAL = 1e-5
# Standard deviations above which an unknown is larger than expected, at 0.1 %.
EXPECTED = 3.3
# Units of the unknowns.
_UNITS = {"offset": "N", "drift": "N", "friction": "N", "softening": "", "gain": ""}


@dataclass(frozen=True, eq=False, repr=False)
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
    nuisances : dict of str to tuple of float
        Unknowns of the press and of the rubber and their standard errors, by name: offset, drift
        over the whole curve and friction, N; softening at the last point, fraction of the force.
    effects : ndarray, shape (n,)
        What they add to the force of the model, N.
    """

    drawn_by: ClassVar[str] = "fit_figures.draw_compression_fit"

    deflection: Array
    force: Array
    curve: CompressionCurve
    nuisances: dict[str, tuple[float, float]]
    effects: Array

    def __repr__(self) -> str:
        """Return the modulus and its standard error."""
        modulus, error = self.values["youngs_modulus"], self.standard_errors["youngs_modulus"]
        return f"<CompressionFit: E {modulus / 1e6:.4g} MPa +- {error / 1e6:.2g} MPa>"

    def columns(self) -> dict[str, Array]:
        """Return the measured curve and the force of the model, m and N."""
        return {
            "deflection_m": self.deflection,
            "force_N": self.force,
            "model_N": self.force + self.residuals - self.effects,
            "effects_N": self.effects,
            "residual_N": self.residuals,
        }

    def table(self) -> str:
        """Return the fit as text."""
        return compression_table(self, _UNITS)

    def files(self) -> dict[str, bytes]:
        """Return ``fit.json`` and ``fit.csv`` by name."""
        return compression_files(self)


def fit_compression(  # noqa: PLR0913 - as in `compress`
    deflection: ArrayLike,
    force: ArrayLike,
    ball: Ball | None = None,
    model: ModelName | ModelOptions = "finite_element",
    *,
    gas: CompressionGas = Compression.gas,
    gain: float = 0.0,
    unknowns: Sequence[str] = tuple(PRESS_UNKNOWNS),
    confidence: float = 0.95,
) -> CompressionFit:
    """Estimate the modulus of elasticity of a ball from a compression between two plates.

    The deflection at first touch is estimated too. Unknowns of press and rubber, and the color of
    the noise, are estimated as far as the curve shows them; the intervals include the rest.
    Warnings report residuals that are not noise, and unknowns that are larger than expected.

    Parameters
    ----------
    deflection : array_like, shape (n,)
        Measured approach of the plates, m, ascending: the loading branch.
    force : array_like, shape (n,)
        Measured force, N.
    ball
        The ball, whose modulus starts the search; by default the standard ball.
    model, gas
        As in `compress`.
    gain
        Relative standard uncertainty of the calibration of the force.
    unknowns
        Names of what is not known of press and rubber; none: the curve is that of the model, and
        noise.
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
    case = Case(ball=Ball() if ball is None else ball, model=new_model(model, {}))
    measured, measured_force = _data(deflection, force)
    require_confidence(confidence)
    require_unknowns(unknowns, PRESS_UNKNOWNS)
    if not 0 <= require_number("gain", gain) < 1:
        refuse_value("gain", gain, "0 <= gain < 1")
    problem = _Problem(
        case.ball, value_in(case, "youngs_modulus"), model, gas, measured, measured_force,
        tuple(unknowns), gain,
    )  # fmt: skip
    first = problem.curve(problem.modulus)
    x = np.array([np.log(_work_ratio(first, measured, measured_force)), 0.0])
    x = least_squares(
        problem.residual, x, bounds=_BOUNDS, x_scale=(1.0, 0.1), diff_step=_STEP, xtol=1e-6
    ).x
    x, best, converged = _refine(problem, x)
    added = problem.effects(x) @ best.effect
    residual = problem.residual(x) + added
    notes, ratio = _warnings(best.whiten(residual), x[1])
    if not converged:
        notes.append(Note("not_converged"))
    for name, value in zip(problem.names, np.abs(best.effect).tolist(), strict=True):
        if value > EXPECTED:
            ratio = max(ratio, value)
            notes.append(Note("larger_than_expected", value=value, others={"name": name}))
    for note in notes:
        warnings.warn(FitWarning(note), stacklevel=3)
    scale = np.array([float(np.exp(x[0])) * problem.modulus, problem.span])
    errors = np.sqrt(np.diag(best.effect_covariance))
    nuisances = (problem.sizes * np.array([best.effect, errors])).T.tolist()
    freedom = len(residual) - _PARAMETERS
    return CompressionFit(
        names=("youngs_modulus", "touch"),
        units=("Pa", "m"),
        estimate=np.array([scale[0], measured[0] + x[1] * problem.span]),
        covariance=ratio**2 * best.covariance * np.outer(scale, scale),
        limits=np.array([[-np.inf, np.inf]] * _PARAMETERS),
        confidence=confidence,
        noise=best.deviation,
        residuals=residual,
        degrees_of_freedom=freedom,
        interval_freedom=freedom,
        warnings=tuple(notes),
        assumptions=tuple(problem.assumptions()),
        widened=ratio,
        deflection=measured,
        force=measured_force,
        curve=problem.curve(scale[0]),
        nuisances=dict(zip(problem.names, map(tuple, nuisances), strict=True)),
        effects=added,
    )


def _refine(problem: _Problem, x: Array) -> tuple[Array, Marginal, bool]:
    """Return the best x with unknowns and colored noise, and whether the steps have converged."""
    minimum = NUMERICAL * float(problem.force.max())
    last, fraction = np.zeros(_PARAMETERS), 1.0
    for _ in range(_MAX_STEPS):
        jacobian = problem.jacobian(x)
        if np.linalg.matrix_rank(jacobian) < _PARAMETERS:
            message = (
                "youngs_modulus has no effect on the force of this model; allowed: another model"
            )
            raise NumericalError(message)
        best = estimate_marginal(jacobian, problem.effects(x), problem.residual(x), minimum)
        # Steps that reverse cross the kink at first touch: shorter ones end there.
        fraction *= 0.5 if best.shift @ last < 0 else 1.0
        last = best.shift
        step = np.clip(x + fraction * best.shift, *_BOUNDS) - x
        x = x + step
        if np.all(np.abs(step) < _CONVERGED * np.sqrt(np.diag(best.covariance))):
            return x, best, True
    return x, best, False


@dataclass(frozen=True, eq=False)
class _Problem:
    """The curve of a model and the effects of unknowns, at x.

    x are the logarithm of the modulus over that of the start, and the first touch over the span.
    """

    ball: Ball
    modulus: float
    model: ModelName | ModelOptions
    gas: CompressionGas
    deflection: Array
    force: Array
    unknowns: tuple[str, ...]
    gain: float
    curves: dict[float, CompressionCurve] = field(default_factory=dict)

    @property
    def span(self) -> float:
        """Span of the measured deflections, m."""
        return float(self.deflection[-1] - self.deflection[0])

    def curve(self, modulus: float) -> CompressionCurve:
        """Return the curve of the model for a modulus, computed once."""
        if modulus not in self.curves:
            self.curves[modulus] = compress(
                replace(self.ball, youngs_modulus=modulus), self.model,
                max_deflection=1.05 * self.span, points=_POINTS, gas=self.gas,
            )  # fmt: skip
        return self.curves[modulus]

    def depth(self, x: Array) -> Array:
        """Return the compression of the ball, m: [n]."""
        result: Array = np.maximum(self.deflection - self.deflection[0] - x[1] * self.span, 0)
        return result

    def residual(self, x: Array) -> Array:
        """Return model − measured, N: [n]."""
        curve = self.curve(float(np.exp(x[0])) * self.modulus)
        force = PchipInterpolator(curve.deflection, curve.force)(self.depth(x))
        return np.asarray(force - self.force, dtype=np.float64)

    def jacobian(self, x: Array) -> Array:
        """Return the derivatives of the residual: [n, 2]."""
        here = self.residual(x)
        steps = np.diag([_STEP, _STEP])
        columns = [(self.residual(x + step) - here) / step.sum() for step in steps]
        return np.column_stack(columns)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the unknowns, and of the gain if its uncertainty is stated."""
        chosen = [name for name in PRESS_UNKNOWNS if name in self.unknowns]
        return (*chosen, *(["gain"] if self.gain else []))

    @property
    def sizes(self) -> Array:
        """Standard deviations expected of the unknowns, N, or 1 for softening and gain."""
        width = {**PRESS_UNKNOWNS, "gain": self.gain}
        top = float(self.force.max())
        return np.array([width[name] * (top if _UNITS[name] else 1.0) for name in self.names])

    def effects(self, x: Array) -> Array:
        """Return the forces that unknowns of their expected sizes add, N: [n, n_unknown]."""
        depth, model = self.depth(x), self.residual(x) + self.force
        position = (self.deflection - self.deflection[0]) / self.span
        shapes = {
            "offset": np.ones_like(depth),
            "drift": position,
            "friction": np.tanh(depth / (_SLIP * self.span)),
            "softening": -model * depth / max(float(depth[-1]), np.finfo(float).tiny),
            "gain": model,
        }
        columns = [shapes[name] * size for name, size in zip(self.names, self.sizes, strict=True)]
        return np.column_stack([np.empty((len(depth), 0)), *columns])

    def assumptions(self) -> list[Note]:
        """Return what the intervals include, and what the curve cannot show."""
        expected = ", ".join(
            f"{name} ± {size:.2g} {_UNITS[name]}".rstrip()
            for name, size in zip(self.names, self.sizes, strict=True)
        )
        result = [Note("press_included", others={"unknowns": expected})] if expected else []
        if not self.gain:
            others = {"cause": "calibration 1 % high", "changes": "youngs_modulus +1 %"}
            result.append(Note("not_visible", others=others))
        return result


def _data(deflection: ArrayLike, force: ArrayLike) -> tuple[Array, Array]:
    """Return both columns; raise InputError if they are not a curve."""
    measured, measured_force = (
        require_array(name, values, {1}, "iuf")
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


def _warnings(residual: Array, relative_touch: float) -> tuple[list[Note], float]:
    """Return warnings, and by how much residuals of unit variance that are not noise exceed it."""
    result = []
    if min(relative_touch - _BOUNDS[0][1], _BOUNDS[1][1] - relative_touch) < 1e-6:  # noqa: PLR2004 - of the span
        result.append(Note("touch_at_limit"))
    notes = color_warning(residual)
    return [*result, *notes], misfit_ratio(residual) if notes else 1.0
