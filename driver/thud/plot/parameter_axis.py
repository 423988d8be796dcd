"""Axes of parameters: names, units, scales."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np
from matplotlib.ticker import FormatStrFormatter, LogLocator, MaxNLocator, NullFormatter

from thud.base.units import display_unit
from thud.case.keys import humanize
from thud.plot.style import SIZE

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from numpy.typing import NDArray

Which = Literal["x", "y"]
# Outside of these, numbers in the unit of the key are shown in a handier unit.
_PLAIN = (1e-2, 1e4)
# Maximum over minimum from which logarithmic ticks are 1, 2, 5, and powers of ten.
_HALF_DECADE, _DECADES = 5.0, 200.0


def show_parameter(axes: Axes, which: Which, parameter: xr.DataArray) -> float:
    """Give an axis the name, unit and scale of a numeric parameter.

    The parameter has the attributes of the dataset. Return the factor of its values on the axis.
    """
    unit, factor = parameter.attrs["shown_unit"], 10.0 ** int(parameter.attrs["shown_power"])
    values = parameter.values
    maximum = float(np.abs(values).max())
    if unit == parameter.attrs["units"] and not _PLAIN[0] <= maximum < _PLAIN[1]:
        unit, size = display_unit(unit, maximum)
        factor = 1 / size
    shown = unit.replace("degC", "°C")
    label = words(parameter) if unit == "1" else f"{words(parameter)}, {shown}"
    axes.set(**{f"{which}label": label})
    axis: Axis = getattr(axes, f"{which}axis")
    axis.label.set_fontsize(SIZE)
    if parameter.attrs.get("scale") == "log":
        axes.set(**{f"{which}scale": "log"})
        _mark_decades(axis, values * factor)
    else:
        axes.ticklabel_format(axis=which, useOffset=False)
    return factor


def _mark_decades(axis: Axis, values: NDArray[np.float64]) -> None:
    """Give a logarithmic axis ticks with plain numbers."""
    ratio = values.max() / values.min()
    if ratio < _HALF_DECADE:
        axis.set_major_locator(MaxNLocator(5))
    else:
        axis.set_major_locator(
            LogLocator(subs=(1, 2, 5) if ratio < _DECADES else (1,), numticks=12)
        )
    axis.set_major_formatter(FormatStrFormatter("%g"))
    axis.set_minor_formatter(NullFormatter())


def words(parameter: xr.DataArray) -> str:
    """Return the name of a parameter in words, as a label begins."""
    return humanize(str(parameter.name)).capitalize()
