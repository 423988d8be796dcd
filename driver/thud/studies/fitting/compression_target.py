"""Force and deflection of a ball in a press as the target of a fit."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import PchipInterpolator

from thud.base._schema import Compression
from thud.base.checks import refuse, refuse_value, require_array, require_number
from thud.base.immutable import Plain
from thud.case.case import new_model
from thud.impact.compression import CompressionCurve, compress
from thud.studies.fitting.comparison import (
    Comparison,
    Own,
    color_warning,
    misfit_ratio,
    require_unknowns,
)
from thud.studies.fitting.force_target import GAIN, OWN

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike

    from thud.base._schema import CompressionGas
    from thud.base.note import Note
    from thud.case.case import Case
    from thud.studies.arrays import Array


# Number of points of a curve of the model, which is interpolated.
_POINTS = 81
_MIN_DATA = 5
# The plates may touch the ball a little before the first point: fractions of the span.
_LIMITS = (-0.04, 0.9)
# Deflections over the span at which the force rises without a kink, and friction without a jump.
_SMOOTH = 3e-3
_SLIP = 0.01
# Noise over the maximum force of the first search, and its minimum: errors of the curve.
_FIRST_NOISE = 5e-3
_NUMERICAL = 1e-5
# Maximum correlation of neighbors, and change of the noise below which it stays as it is.
_MAX_CORRELATION = 0.95
_SAME = 0.02
TOUCH = "touch"
# Standard deviations of the unknowns of a press and of rubber in it: of offset, drift over the
# curve and friction over the maximum force, of the relative softening at the last point.
PRESS_UNKNOWNS: Mapping[str, float] = {
    "offset": 0.01,
    "drift": 0.01,
    "friction": 0.005,
    "softening": 0.05,
}


@dataclass(frozen=True, eq=False)
class CompressionTarget(Plain):
    """The loading branch of a ball between two plates, to be fitted.

    The deflection at first touch is fitted too, and unknowns of press and rubber, each of which has
    a normal prior. Noise is a first-order autoregressive process along the points, whose size and
    correlation follow from the residuals.

    Attributes
    ----------
    deflection : array_like, shape (n,)
        Measured approach of the plates, m, ascending.
    force : array_like, shape (n,)
        Measured force, N.
    gas : str
        As in `compress`.
    gain : float or None
        Relative standard uncertainty of the calibration of the force; None: it is exact.
    unknowns : sequence of str
        What is not known of press and rubber; none: the curve is that of the model, and noise.
    fixed : mapping of str to object
        Keys of ball and model that are different for this target.
    """

    deflection: ArrayLike
    force: ArrayLike
    gas: CompressionGas = Compression.gas
    gain: float | None = None
    unknowns: Sequence[str] = tuple(PRESS_UNKNOWNS)
    fixed: Mapping[str, object] = field(default_factory=dict)

    def compare(self) -> CompressionComparison:
        """Return the comparison of a curve with the measured one."""
        deflection, force = _curve(self.deflection, self.force)
        require_unknowns(self.unknowns, PRESS_UNKNOWNS)
        if self.gain is not None and not 0 < require_number("gain", self.gain) < 1:
            refuse_value("gain", self.gain, "0 < gain < 1")
        top, begin, span = float(force[-1]), float(deflection[0]), float(np.ptp(deflection))
        low, high = (begin + fraction * span for fraction in _LIMITS)
        own = {TOUCH: Own("m", span / 10, begin, low=low, high=high)}
        for name, size in PRESS_UNKNOWNS.items():
            if name in self.unknowns:
                # Softening is a fraction of the force.
                unit, scale = ("", size) if name == "softening" else ("N", size * top)
                own[name] = Own(unit, scale, deviation=scale)
        if self.gain is not None:
            own[GAIN] = OWN[GAIN]._replace(deviation=self.gain)
        return CompressionComparison(
            weighted_target=force / (_FIRST_NOISE * top), known_noise=True, own=own,
            unit_deviation=_FIRST_NOISE * top, noise_freedom=len(force) - 2, gas=self.gas,
            deflection=deflection, force=force,
        )  # fmt: skip


@dataclass(frozen=True, eq=False, kw_only=True)
class CompressionComparison(Comparison[CompressionCurve]):
    """A measured curve, prepared for a fit; see `Comparison` for the other attributes.

    Attributes
    ----------
    deflection, force : ndarray, shape (n,)
        The measured curve, m and N.
    gas : str
        As in `compress`.
    correlation : float
        Correlation of the noise of neighbors.
    """

    unit = "N"
    has_own_noise = True
    deflection: Array
    force: Array
    gas: CompressionGas
    correlation: float = 0.0

    @property
    def _span(self) -> float:
        return float(np.ptp(self.deflection))

    def solve(self, case: Case) -> CompressionCurve:
        """Return the curve of a case."""
        deflection = 1.05 * self._span
        model = new_model(case.model, {})
        return compress(case.ball, model, max_deflection=deflection, points=_POINTS, gas=self.gas)

    def effects(self, result: CompressionCurve, own: Array) -> tuple[Array, Array]:
        """Return the force of the model, and what press and rubber add to it, N: [n] each."""
        value = dict(zip(self.own, own.tolist(), strict=True))
        above = (self.deflection - value.pop(TOUCH)) / 2
        depth = above + np.hypot(above, _SMOOTH * self._span / 2)
        model = PchipInterpolator(result.deflection, result.force)(depth)
        shapes = {
            "offset": np.ones_like(depth),
            "drift": (self.deflection - self.deflection[0]) / self._span,
            "friction": np.tanh(depth / (_SLIP * self._span)),
            "softening": -model * depth / depth[-1],
            GAIN: model,
        }
        value[GAIN] = value.get(GAIN, 1.0) - 1.0
        added = np.zeros_like(depth)
        for name, size in value.items():
            added += size * shapes[name]
        return model, added

    def misfit(self, result: CompressionCurve, own: Array) -> Array:
        """Return model minus target over standard deviation, shape (n,)."""
        model, added = self.effects(result, own)
        return _whiten(model + added - self.force, self.correlation) / self.unit_deviation

    def reweighted(
        self, result: CompressionCurve, own: Array, jacobian: Array
    ) -> CompressionComparison:
        """Return the comparison with the noise that the best residuals show, or itself."""
        model, added = self.effects(result, own)
        residual, count = model + added - self.force, len(self.force)
        # Parameters with priors take less than one degree of freedom each.
        taken = float(np.trace(jacobian[:count] @ np.linalg.pinv(jacobian)[:, :count]))
        lag = float(residual[1:] @ residual[:-1]) / (float(residual @ residual) or 1.0)
        # Fitting k parameters lowers it by (k + (k + 2) r)/n: Marriott and Pope (1954).
        lag += (taken + (taken + 2) * lag) / count
        correlation = float(np.clip(lag, 0.0, _MAX_CORRELATION))
        white = _whiten(residual, correlation)
        deviation = float(np.sqrt(white @ white / max(count - taken, 1.0)))
        deviation = max(deviation, _NUMERICAL * float(self.force[-1]))
        change = deviation / self.unit_deviation - 1, correlation - self.correlation
        if max(map(abs, change)) < _SAME:
            return self
        weighted = _whiten(self.force, correlation) / deviation
        return replace(
            self, weighted_target=weighted, unit_deviation=deviation, correlation=correlation
        )

    def warnings(
        self,
        result: CompressionCurve,  # noqa: ARG002
        own: Array,  # noqa: ARG002
        residual: Array,
        freedom: float,  # noqa: ARG002
        unit: float,  # noqa: ARG002
    ) -> list[Note]:
        """Return a warning if the residuals are colored otherwise than the noise."""
        return color_warning(residual[: len(self.force)])

    def excess(self, result: CompressionCurve, own: Array, residual: Array) -> float:  # noqa: ARG002
        """Return by how much residuals exceed noise of unit variance; at least 1."""
        return misfit_ratio(residual)

    def columns(self, result: CompressionCurve, own: Array) -> dict[str, Array]:
        """Return the measured curve and the force of the model, m and N: columns by their names."""
        model, added = self.effects(result, own)
        return {
            "deflection_m": self.deflection,
            "force_N": self.force,
            "model_N": model,
            "effects_N": added,
            "residual_N": model + added - self.force,
        }


def _whiten(values: Array, correlation: float) -> Array:
    """Return values that are independent and of equal variance if they are a process: [n]."""
    white = values - correlation * np.append(0.0, values[:-1])
    white[0] *= np.sqrt(1 - correlation**2)
    return white


def _curve(deflection: ArrayLike, force: ArrayLike) -> tuple[Array, Array]:
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
