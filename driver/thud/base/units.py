"""SI units and their multiples by powers of ten."""

from __future__ import annotations

import math
import re
from decimal import Decimal

from thud.base.checks import refuse, require_kind, shown, suggestion

# For the SI unit of a key, the allowed units and their powers of ten.
MULTIPLES: dict[str, dict[str, int]] = {
    "m": {"m": 0, "cm": -2, "mm": -3, "um": -6},
    "s": {"s": 0, "ms": -3, "us": -6},
    "Hz": {"Hz": 0, "kHz": 3},
    "Pa": {"Pa": 0, "kPa": 3, "MPa": 6, "GPa": 9, "N/mm2": 6, "N/m2": 0, "hPa": 2, "bar": 5},
    "N": {"N": 0, "kN": 3},
    "kg": {"kg": 0, "g": -3},
    "kg/m3": {"kg/m3": 0, "g/cm3": 3},
    "N/m": {"N/m": 0, "kN/m": 3, "N/mm": 3},
    "N/m3": {"N/m3": 0, "kN/m3": 3, "MN/m3": 6},
    "m3": {"m3": 0},
    "m/s2": {"m/s2": 0},
    "s/m": {"s/m": 0, "ms/m": -3},
    "degC": {"degC": 0},
    "K": {"K": 0},
    "": {"1": 0, "%": -2},
}
# The number at the beginning of a quantity.
NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)")
# Units of tables and figures, ascending.
DISPLAY_UNITS = {
    "Pa": ("Pa", "kPa", "MPa", "GPa"),
    "m": ("mm", "m"),
    "s": ("ms", "s"),
    "Hz": ("Hz", "kHz"),
    "N/m": ("N/m", "kN/m"),
    "N/m3": ("N/m3", "kN/m3", "MN/m3"),
}


def power_of(unit: object, key_unit: str, label: str) -> int:
    """Return the power of ten that converts a unit to the unit of a key.

    Raise InputError if the unit does not fit; its message begins with `label`.
    """
    # Other units have no multiples.
    multiples = MULTIPLES.get(key_unit, {key_unit: 0})
    if not isinstance(unit, str) or unit not in multiples:
        hint = suggestion(unit, multiples)
        refuse(f"{label}: unit {shown(unit)} does not fit{hint}", ", ".join(multiples))
    return multiples[unit]


def quantity(text: str) -> float:
    """Return a number with a unit in SI units; temperatures in degC.

    Parameters
    ----------
    text
        Number and unit, such as ``"32 mm"``.

    Raises
    ------
    InputError
        If the number is not finite, or the unit is unknown.

    Examples
    --------
    >>> quantity("32 mm")
    0.032
    """
    require_kind("quantity", text, str)
    units = {unit: power for multiples in MULTIPLES.values() for unit, power in multiples.items()}
    match = NUMBER.match(text)
    if match is None or not math.isfinite(float(match[1])):
        refuse(f"quantity = {shown(text)} is not a number and its unit", "such as '32 mm'")
    unit = text[match.end() :].strip()
    if unit not in units:
        unknown = f"unit {shown(unit)} is not known{suggestion(unit, units)}"
        refuse(
            f"quantity = {shown(text)}: {unknown if unit else 'unit is missing'}", ", ".join(units)
        )
    value = scaled(float(match[1]), units[unit])
    if not math.isfinite(value):
        refuse(f"quantity = {shown(text)} is too large", "finite numbers")
    return value + 0.0


def scaled(value: float, power: int) -> float:
    """Return a number times a power of ten, correctly rounded.

    >>> scaled(35, -3)
    0.035
    """
    return float(Decimal(repr(float(value))).scaleb(power))


def frequency_text(frequency: float) -> str:
    """Return a frequency, Hz, as text, in kHz from 10 kHz on.

    >>> frequency_text(1600.0), frequency_text(12_800.0)
    ('1600 Hz', '12.8 kHz')
    """
    is_large = round(frequency) >= 10_000  # noqa: PLR2004
    return f"{frequency / 1e3:.4g} kHz" if is_large else f"{frequency:.4g} Hz"


def display_unit(unit: str, value: float) -> tuple[str, float]:
    """Return the largest unit in which a value is at least 1, and this unit in SI units."""
    sizes = {name: scaled(1.0, MULTIPLES[unit][name]) for name in DISPLAY_UNITS.get(unit, ())}
    usable = [(name, size) for name, size in sizes.items() if size <= abs(value)]
    return usable[-1] if usable and value else (unit, 1.0)
