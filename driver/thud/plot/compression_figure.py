"""Force against deflection of slow compressions."""

from collections.abc import Mapping

from matplotlib.figure import Figure

from thud.base._schema import Ball, FiniteElement
from thud.base.checks import require_kind
from thud.base.errors import InputError
from thud.impact.compression import CompressionCurve, compress
from thud.plot.style import SIZE, add_curves, empty_axes, legend_above, own_style


@own_style()
def compression(curves: Mapping[str, CompressionCurve]) -> Figure:
    """Draw forces against the approach of the plates.

    Parameters
    ----------
    curves
        Curves by their names in the legend.

    Returns
    -------
    Figure
        Approach of the plates in mm, force in N.

    Raises
    ------
    InputError
        Where `curves` is not a mapping of names to curves, or empty.
    """
    if not isinstance(curves, Mapping) or not curves:
        message = "curves are not given; allowed: a mapping of names to curves, at least one"
        raise InputError(message)
    for name, curve in curves.items():
        require_kind(name, curve, CompressionCurve)
    figure, axes = empty_axes(2.5)
    add_curves(axes, {name: (1e3 * one.deflection, one.force) for name, one in curves.items()})
    axes.set_xlim(left=0)
    axes.set_ylim(bottom=0)
    axes.set_xlabel("Approach of the plates, mm", fontsize=SIZE)
    axes.set_ylabel("Force, N", fontsize=SIZE)
    if any(curves):
        legend_above(axes)
    return figure


def _draw_models() -> Figure:
    """Draw the ball of the paper by each model, at one modulus, without viscosity."""
    ball = Ball(poisson_ratio=0.49)
    models = {"shell": "hollow_sphere", "modal ball": "modal_ball"}
    curves = {name: compress(ball, model) for name, model in models.items()}  # type: ignore[arg-type]
    for gas in ("vented", "adiabatic"):
        elements = FiniteElement(viscosity="none")
        curves[f"finite elements, {gas}"] = compress(ball, elements, gas=gas)
    return compression(curves)


COMPRESSION_FIGURES = {"compression": CompressionCurve.plot}
DOCUMENTATION_FIGURES = {"compression": _draw_models}
