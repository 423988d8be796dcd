"""Quasi-static compression of the ball between two plates, as in a press."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from thud.base._schema import Ball, Compression
from thud.base.bridge import ask
from thud.base.display import Displayed
from thud.base.extras import data_frame
from thud.base.key import check_keywords
from thud.case.case import Case, case_text, new_model

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from thud.base._schema import CompressionGas, ModelName, ModelOptions
    from thud.base.bridge import Bundle


@dataclass(frozen=True, eq=False)
class CompressionCurve(Displayed):
    """Force against deflection of the ball between two rigid plates without friction.

    Attributes
    ----------
    case : Case
        The input.
    deflection : ndarray, shape (n,)
        Approach of the plates, m, from 0 on; each pole moves by half of it.
    force : ndarray, shape (n,)
        Force on each plate, N.
    """

    case: Case
    deflection: NDArray[np.float64]
    force: NDArray[np.float64]

    def __repr__(self) -> str:
        """Return model and end of the curve."""
        model = self.case.model.name if self.case.model else ""
        end = f"{self.force[-1]:.1f} N at {1e3 * self.deflection[-1]:.1f} mm"
        return f"<CompressionCurve, {model}: {end}>"

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text, about ten of them."""
        every = range(0, len(self.force), max(1, len(self.force) // 10))
        rows = [(f"{1e3 * self.deflection[i]:.2f}", f"{self.force[i]:.2f}") for i in every]
        return [("deflection, mm", "force, N"), *rows]

    def plot(self) -> Figure:
        """Return a figure of the force against the deflection."""
        from thud.plot.ball_figures import compression

        return compression({"": self})

    def to_dataframe(self) -> pd.DataFrame:
        """Return the columns of ``compression.csv``.

        Raise InputError if pandas is not installed.
        """
        return data_frame({"deflection_m": self.deflection, "force_N": self.force})


@check_keywords
def compress(
    ball: Ball | None = None,
    model: ModelName | ModelOptions = "hollow_sphere",
    *,
    max_deflection: float = Compression.max_deflection,
    points: int = Compression.points,
    gas: CompressionGas = Compression.gas,
) -> CompressionCurve:
    """Compress a ball quasi-statically between two rigid plates without friction.

    Viscosity has relaxed: the force is that of the long-term modulus, which is the modulus of the
    ball for Kelvin–Voigt damping, and less than its storage modulus for Maxwell branches.
    Fractional damping, the default of finite elements, enters with its modulus at about 1 Hz.

    Parameters
    ----------
    ball
        By default the rubber ball of the paper.
    model
        Name or options of the source model; ``"measured_modes"`` has no compression.
    max_deflection
        Maximum approach of the plates, m.
    points
        Points of the curve, the undeformed ball included.
    gas
        ``"vented"``: the gas leaves by the hole; ``"isothermal"`` and ``"adiabatic"``: it is
        sealed in.

    Returns
    -------
    CompressionCurve
        Force against deflection.

    Raises
    ------
    InputError
        Names group, key, value and allowed range.
    NumericalError
        If the ball cannot be compressed so far.
    """
    case = Case(
        ball=Ball() if ball is None else ball,
        model=new_model(model, {}),
        compression=Compression(max_deflection, points, gas),
    )
    return new_curve(case, ask("compression", case=case_text(case)))


def new_curve(case: Case, answer: Bundle) -> CompressionCurve:
    """Return the curve in a bundle of the library."""
    return CompressionCurve(case, **answer["compression"])
