"""Quasi-static compression of the ball between two plates, as in a press."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from thud.base._schema import Ball, Compression
from thud.base.bridge import ask, without_units
from thud.base.display import Tabulated
from thud.case.case import Case, case_text, new_model

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from thud.base._schema import CompressionGas, ModelName, ModelOptions
    from thud.base.bridge import Bundle
    from thud.base.display import Columns


@dataclass(frozen=True, eq=False)
class CompressionCurve(Tabulated):
    """Force and deflection of a ball between two rigid plates without friction.

    Attributes
    ----------
    case : Case
        The input.
    deflection : ndarray, shape (n,)
        Approach of the plates, m, ascending from 0; each pole moves by half the approach.
    force : ndarray, shape (n,)
        Force on each plate, N.
    """

    drawn_by: ClassVar[str] = "ball_figures.compression"

    is_curve = True
    case: Case
    deflection: NDArray[np.float64]
    force: NDArray[np.float64]

    def __repr__(self) -> str:
        """Return the model and the last point of the curve."""
        model = self.case.model.name if self.case.model else ""
        end = f"{self.force[-1]:.1f} N at {1e3 * self.deflection[-1]:.1f} mm"
        return f"<CompressionCurve, {model}: {end}>"

    def columns(self) -> Columns:
        """Return the columns of ``compression.csv``."""
        return {"deflection, m": (self.deflection, ".4g"), "force, N": (self.force, ".2f")}


def compress(
    ball: Ball | None = None,
    model: ModelName | ModelOptions = "modal_ball",
    *,
    max_deflection: float = Compression.max_deflection,
    points: int = Compression.points,
    gas: CompressionGas = Compression.gas,
) -> CompressionCurve:
    """Compress a ball quasi-statically between two rigid plates without friction.

    Viscous stresses have relaxed: the force depends on the long-term modulus. For Kelvin–Voigt
    damping this is the modulus of the ball; for Maxwell branches it is less than their storage
    modulus. For fractional damping, the default of finite elements, the modulus at about 1 Hz is
    used.

    Parameters
    ----------
    ball
        Ball, by default the standard ball.
    model
        Name or options of the source model; ``"measured_modes"`` has no compression.
    max_deflection
        Maximum approach of the plates, m.
    points
        Number of points of the curve, including the undeformed ball.
    gas
        ``"vented"``: the gas escapes through the hole; ``"isothermal"`` and ``"adiabatic"``: the
        gas is enclosed.

    Returns
    -------
    CompressionCurve
        Force against deflection.

    Raises
    ------
    InputError
        If the input is invalid; the message names group, key, value and allowed range.
    NumericalError
        If no solution exists up to the maximum deflection.
    """
    case = Case(
        ball=Ball() if ball is None else ball,
        model=new_model(model, {}),
        compression=Compression(max_deflection, points, gas),
    )
    return new_curve(case, ask("compression", case=case_text(case)))


def new_curve(case: Case, answer: Bundle) -> CompressionCurve:
    """Return the curve in a bundle of the library."""
    return CompressionCurve(case, **without_units(answer["compression"]))
