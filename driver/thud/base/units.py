"""Units of keys and of files: base unit and size of each."""

from __future__ import annotations

import math
from decimal import Decimal

from thud.base.checks import refuse, require_choice, shown

# By base unit, that of a key of this dimension: sizes of units in it.
SIZES: dict[str, dict[str, float]] = {
    "N": {"N": 1.0, "kN": 1e3, "MN": 1e6, "mN": 1e-3, "uN": 1e-6, "daN": 10.0, "kgf": 9.80665,
          "kp": 9.80665, "lbf": 4.4482216152605},
    "V": {"V": 1.0, "mV": 1e-3, "uV": 1e-6},
    "pC": {"pC": 1.0, "nC": 1e3},
    "counts": {"counts": 1.0},
    "FS": {"FS": 1.0},
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0},
    "Hz": {"Hz": 1.0, "kHz": 1e3, "MHz": 1e6},
    "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "nm": 1e-9},
    "m/s": {"m/s": 1.0, "mm/s": 1e-3, "in/s": 0.0254},
    "m/s2": {"m/s2": 1.0, "mm/s2": 1e-3, "in/s2": 0.0254, "g": 9.80665},
    "Pa": {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "N/mm2": 1e6, "N/m2": 1.0, "hPa": 1e2,
           "bar": 1e5},
    "degC": {"degC": 1.0},
    "K": {"K": 1.0},
    "dB": {"dB": 1.0, "dB(Z)": 1.0},
    "deg": {"deg": 1.0, "rad": 180 / math.pi},
    "m/(Ns)": {"m/(Ns)": 1.0, "mm/(Ns)": 1e-3},
    "m/N": {"m/N": 1.0, "mm/N": 1e-3},
    "m/(Ns2)": {"m/(Ns2)": 1.0, "1/kg": 1.0, "g/N": 9.80665},
    # Of keys only: in the title of a column "1", "g" or "m3" is no such unit.
    "": {"1": 1.0, "%": 1e-2},
    "kg": {"kg": 1.0, "g": 1e-3},
    "kg/m3": {"kg/m3": 1.0, "g/cm3": 1e3},
    "N/m": {"N/m": 1.0, "kN/m": 1e3, "N/mm": 1e3},
    "N/m3": {"N/m3": 1.0, "kN/m3": 1e3, "MN/m3": 1e6},
    "m3": {"m3": 1.0},
    "s/m": {"s/m": 1.0, "ms/m": 1e-3},
}  # fmt: skip
_OF_KEYS = {"", "kg", "kg/m3", "N/m", "N/m3", "m3", "s/m"}
# By unit of a file: base unit, and size in it.
UNITS = {
    unit: (base, size)
    for base, sizes in SIZES.items()
    if base not in _OF_KEYS
    for unit, size in sizes.items()
}
# Other spellings by unit, in lower case, without blanks and the "s" of plurals.
_WORDS = {
    "N": "newton n", "kN": "kilonewton kn", "lbf": "lb lbs", "V": "volt v", "mV": "millivolt mv",
    "pC": "pc", "counts": "count digit lsb bit cts adc", "FS": "fs fullscale",
    "s": "sec second sekunden", "ms": "msec millisecond", "us": "usec microsecond",
    "ns": "nsec nanosecond", "min": "minute", "h": "hour", "Hz": "hz hertz s/s 1/s sps",
    "kHz": "khz", "MHz": "mhz", "m/s2": "m/s/s", "dB": "db dbz db(lin) dbre20upa",
    "deg": "° degree grad", "degC": "°c", "m/(Ns)": "m/ns m/s/n (m/s)/n",
    "mm/(Ns)": "mm/ns mm/s/n (mm/s)/n", "m/(Ns2)": "m/s2/n (m/s2)/n m/ns2", "1/kg": "kg-1",
}  # fmt: skip
SPELLINGS = {word: unit for unit, words in _WORDS.items() for word in words.split()}
_PLAIN = str.maketrans("\u00b5\u03bc\u00b2\u00b3", "uu23", " *\u00b7\u22c5^\u00a0")
# Units of tables and figures, ascending.
DISPLAY_UNITS = {
    "Pa": ("Pa", "kPa", "MPa", "GPa"), "m": ("mm", "m"), "s": ("ms", "s"), "Hz": ("Hz", "kHz"),
    "N/m": ("N/m", "kN/m"), "N/m3": ("N/m3", "kN/m3", "MN/m3"),
}  # fmt: skip


def find_unit(text: str) -> str:
    """Return the unit of `UNITS` that a text names, or an empty string.

    >>> find_unit("Newtons"), find_unit("m/s^2"), find_unit("mmHg")
    ('N', 'm/s2', '')
    """
    name = text.translate(_PLAIN)
    lower = name.casefold()
    singular = lower.removesuffix("s") if lower.isalpha() and len(lower) > len("kgs") else lower
    unit = SPELLINGS.get(lower) or SPELLINGS.get(singular, lower)
    return name if name in UNITS else unit if unit in UNITS else ""


def size_of(text: str) -> tuple[str, float]:
    """Return the base unit of a unit that a text names, and its size in it; empty and 1 if none.

    >>> size_of("kHz"), size_of("mmHg")
    (('Hz', 1000.0), ('', 1.0))
    """
    return UNITS.get(find_unit(text), ("", 1.0))


def factor_to(unit: str, text: str, label: str, allowed: str = "") -> float:
    """Return the factor from a unit that a text names to a unit of `UNITS`; 1 without a text.

    Raise InputError if the unit is not known or of another quantity.
    """
    base, size = size_of(text) if text else UNITS[unit]
    if base != UNITS[unit][0]:
        known = ", ".join(name for name, entry in UNITS.items() if entry[0] == UNITS[unit][0])
        problem = "does not fit" if base else "is not known"
        refuse(f"{label}: the unit {shown(text)} {problem}", allowed or known)
    return size / UNITS[unit][1]


def power_of(unit: object, key_unit: str, label: str) -> int:
    """Return the power of ten that converts a unit to the unit of a key.

    Raise InputError if the unit does not fit; its message begins with `label`.

    >>> power_of("us", "s", "contact time")
    -6
    """
    sizes = SIZES.get(key_unit, {key_unit: 1.0})  # others have no multiples
    powers = {unit: round(math.log10(size)) for unit, size in sizes.items()}
    powers = {unit: power for unit, power in powers.items() if scaled(1.0, power) == sizes[unit]}
    return powers[require_choice(f"{label}: unit", unit, powers)]


def scaled(value: float, power: int) -> float:
    """Return a number times a power of ten, correctly rounded.

    >>> scaled(35, -3)
    0.035
    """
    return float(Decimal(repr(float(value))).scaleb(power))


def display_unit(unit: str, value: float) -> tuple[str, float]:
    """Return the largest unit in which a value is at least 1, and this unit in SI units."""
    names = [name for name in DISPLAY_UNITS.get(unit, ()) if SIZES[unit][name] <= abs(value)]
    return (names[-1], SIZES[unit][names[-1]]) if names and value else (unit, 1.0)
