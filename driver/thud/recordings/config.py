"""A laboratory's configuration: a small TOML file beside its recordings."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any

from thud.base.checks import refuse, require_choice, require_number, shown
from thud.base.errors import InputError
from thud.level.assessment import get_criteria
from thud.level.levels import SOURCES
from thud.recordings.channel import MIB, shown_path, shown_text
from thud.recordings.excursion import POLARITIES
from thud.recordings.force_units import read_chain, require_unit
from thud.recordings.plate import Plate, check_plate
from thud.recordings.restitution import DropConditions
from thud.recordings.signal_files import regular_file

if TYPE_CHECKING:
    import os
    from collections.abc import Callable

    from thud.base._schema import LimitsSource
    from thud.recordings.force_units import Calibration
    from thud.recordings.plate import PlateCheck

LONGEST = 500
ABSOLUTE_ZERO = -273.15


@dataclass(frozen=True)
class PlateConfig:
    """A force plate.

    Attributes
    ----------
    f0, Q : float or None
        Frequency, Hz, and quality factor of the first resonance, which is corrected; None where it
        is not.
    f0_uncertainty : float or None
        Relative standard uncertainty of the frequency; None where it is not known.
    time_constant : float or None
        Time constant of the amplifier, s; None where it is not known.
    full_scale : float or None
        Largest force that plate and recorder can read, N; None where it is not known.
    linearity : tuple of tuple
        Pairs of a force applied and the force indicated, N.
    """

    f0: float | None = None
    Q: float | None = None
    f0_uncertainty: float | None = None
    time_constant: float | None = None
    full_scale: float | None = None
    linearity: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True)
class Config:
    """What a laboratory says about its ball, its instruments and its files; see `read_config`.

    Attributes
    ----------
    laboratory, ball, serial : str
        Names for the report.
    date : str
        Date of the measurement, such as ``"2024-05-03"``; by default that of the files.
    source : str
        Source whose limits apply.
    temperature : float or None
        Temperature of ball and air, degC.
    instruments : tuple of str
        Instruments, one each.
    channel, unit, polarity, sample_rate
        As `open_signals` takes them.
    calibration : Calibration, str, float or None
        As `open_signals` takes it.
    calibration_uncertainty : float or None
        Relative standard uncertainty of the force, wherever its calibration comes from; by default
        that of the `Calibration`.
    mass, height : float or None
        Mass of the ball, kg, and drop height, m.
    mass_uncertainty, height_uncertainty : float or None
        Their standard uncertainties, kg and m; None where they are not known.
    plate : PlateConfig or None
        The force plate.
    low_pass : bool
        Whether levels are those of the force below 1.25 kHz.
    limits : mapping
        Minimum and maximum by criterion where they differ from the standards'.
    """

    laboratory: str = ""
    ball: str = ""
    serial: str = ""
    date: str = ""
    source: LimitsSource = "rubber_ball"
    temperature: float | None = None
    instruments: tuple[str, ...] = ()
    channel: int | str | None = None
    unit: str | None = None
    calibration: Calibration | str | float | None = None
    calibration_uncertainty: float | None = None
    polarity: str | None = None
    sample_rate: float | None = None
    mass: float | None = None
    height: float | None = None
    mass_uncertainty: float | None = None
    height_uncertainty: float | None = None
    plate: PlateConfig | None = None
    low_pass: bool = False
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def resonance(self) -> Plate | None:
        """The resonance that is corrected; an uncertainty that is not known counts as zero."""
        plate = self.plate
        if plate is None or plate.f0 is None or plate.Q is None:
            return None
        return Plate(plate.f0, plate.Q, frequency_uncertainty=plate.f0_uncertainty or 0.0)

    def conditions(self, calibration: float | None) -> DropConditions:
        """Return the conditions of the drops; an unknown uncertainty counts as zero."""
        return DropConditions(
            self.height,
            self.mass,
            calibration or 0.0,
            self.mass_uncertainty or 0.0,
            self.height_uncertainty or 0.0,
        )

    @property
    def plate_checks(self) -> tuple[PlateCheck, ...]:
        """The standard's demands on the plate; none where there is no ``[plate]``."""
        plate = self.plate
        if plate is None:
            return ()
        return check_plate(
            self.resonance,
            time_constant=plate.time_constant,
            full_scale=plate.full_scale,
            linearity=plate.linearity or None,
        )


def read_config(path: str | os.PathLike[str]) -> Config:
    """Read a configuration.

    Raises
    ------
    InputError
        Names the file and the key that is not known, of another kind or out of range.
    """
    file = regular_file(path)
    name = shown_path(file)
    if file.stat().st_size > MIB:
        refuse(f"{name}: is larger than 1 MiB", "a TOML file of some lines")
    try:
        given = tomllib.loads(file.read_text(encoding="utf-8"))
    except UnicodeDecodeError as error:
        refuse(f"{name}: byte {error.start + 1} is not of UTF-8", "TOML, which is UTF-8", error)
    except (OSError, ValueError, RecursionError) as error:
        refuse(f"{name}: is no TOML ({shown_text(error)})", 'lines such as unit = "V"', error)
    _require_known(given, [one.name for one in fields(Config)], name)
    return Config(**{key: check_key(key, value, f"{name}: {key}") for key, value in given.items()})


def checked_config(config: Config) -> Config:
    """Return a configuration; raise InputError where a number is not within its range.

    So it is where source or limits, which only the verdict needs, are not allowed.
    """
    for key in NUMBERS:
        value = getattr(config, key, None)
        if value is not None:
            check_key(key, value, key)
    for key in ("source", "limits"):
        check_key(key, getattr(config, key), key)
    return config


def _require_known(given: Mapping[str, object], known: list[str], place: str) -> None:
    """Raise InputError where a key is not known, with the one that is probably meant."""
    for key in given:
        if key not in known:
            close = difflib.get_close_matches(key, known, n=1, cutoff=0.5)
            hint = f", did you mean {close[0]}?" if close else ""
            refuse(f"{place}: {shown_text(key)!r} is not known{hint}", ", ".join(known))


def check_key(key: str, value: object, place: str) -> Any:  # noqa: ANN401 - of any key
    """Return the value of a key; raise InputError where it is not allowed."""
    if key in NUMBERS:
        return _number(value, place, *NUMBERS[key])
    return CHECKS.get(key, _text)(value, place)


# Minimum and maximum of the keys that are numbers.
NUMBERS = {
    "temperature": (ABSOLUTE_ZERO, 200.0),
    "calibration_uncertainty": (0.0, 0.5),
    "sample_rate": (1.0, 1e9),
    "mass": (0.01, 1000.0),
    "height": (0.001, 100.0),
    "mass_uncertainty": (0.0, 100.0),
    "height_uncertainty": (0.0, 10.0),
    "f0": (1.0, 1e6),
    "Q": (0.5, 1e6),
    "f0_uncertainty": (0.0, 0.5),
    "time_constant": (1e-3, 1e9),
    "full_scale": (1.0, 1e9),
}


def _number(value: object, place: str, low: float, high: float) -> float:
    """Return a number within a range."""
    require_number(place, value)
    if not isinstance(value, int | float) or not low <= value <= high:
        refuse(f"{place} = {shown(value)} is not allowed", f"{low:g} to {high:g}")
    return float(value)


def _text(value: object, place: str) -> str:
    """Return a text of one line."""
    if not isinstance(value, str) or len(value) > LONGEST or not value.isprintable():
        refuse(f"{place} = {shown(value)} is not allowed", f"a line of up to {LONGEST} characters")
    return value


def _instruments(value: object, place: str) -> tuple[str, ...]:
    """Return texts."""
    names = value if isinstance(value, list) else [value]
    return tuple(_text(one, place) for one in names)


def _calibration(value: object, place: str) -> str | float:
    """Return a chain of factors or N per unit."""
    if not isinstance(value, str):
        return _number(value, place, -1e30, 1e30)
    text = _text(value, place)
    try:
        read_chain(text)
    except InputError as error:
        message = f"{place}: {error}"
        raise InputError(message) from error
    return text


def _channel(value: object, place: str) -> int | str:
    """Return the number or the name of a channel."""
    is_number = isinstance(value, int) and not isinstance(value, bool)
    return int(_number(value, place, 1, 1e6)) if is_number else _text(value, place)


def _unit(value: object, place: str) -> str:
    """Return a unit of recorded values."""
    return require_unit(value, place)


def _polarity(value: object, place: str) -> str:
    """Return the sign of a compression."""
    require_choice(place, value, POLARITIES)
    return str(value)


def _source(value: object, place: str) -> str:
    """Return the name of a source."""
    require_choice(place, value, SOURCES)
    return str(value)


def _table(value: object, place: str, known: list[str]) -> Mapping[str, object]:
    """Return a table of which all keys are known."""
    if not isinstance(value, Mapping):
        refuse(f"{place} = {shown(value)} is not allowed", "a table")
    _require_known(value, known, place)
    return value


def _plate(value: object, place: str) -> PlateConfig:
    """Return a force plate."""
    table = _table(value, place, [one.name for one in fields(PlateConfig)])
    if "f0_uncertainty" in table or ("f0" in table) != ("Q" in table):
        for key in ("f0", "Q"):
            if key not in table:
                refuse(f"{place}: {key} is missing", "f0 and Q")
    return PlateConfig(
        **{key: check_key(key, value, f"{place}: {key}") for key, value in table.items()}
    )


def _linearity(value: object, place: str) -> tuple[tuple[float, float], ...]:
    """Return pairs of forces."""
    pairs = value if isinstance(value, list) else []
    if len(pairs) < 2 or not all(isinstance(one, list) and len(one) == 2 for one in pairs):  # noqa: PLR2004
        refuse(
            f"{place} = {shown(value)} is not allowed",
            "[[applied, indicated], ...], N",
        )
    low, high = ([_number(one[k], place, 1e-3, 1e9) for one in pairs] for k in (0, 1))
    return tuple(zip(low, high, strict=True))


def _flag(value: object, place: str) -> bool:
    """Return yes or no."""
    if not isinstance(value, bool):
        refuse(f"{place} = {shown(value)} is not allowed", "true or false")
    return value


def _limits(value: object, place: str) -> dict[str, tuple[float, float]]:
    """Return limits by criterion."""
    names = [one.name for one in get_criteria(SOURCES[0])]
    found = {}
    for key, span in _table(value, place, names).items():
        if not isinstance(span, list | tuple) or len(span) != 2:  # noqa: PLR2004 - minimum, maximum
            refuse(f"{place}: {key} = {shown(span)} is not allowed", "[minimum, maximum]")
        low, high = (_number(one, f"{place}: {key}", -1e6, 1e6) for one in span)
        if not low < high:
            refuse(f"{place}: {key} = {shown(span)} is not allowed", "minimum < maximum")
        found[key] = (low, high)
    return found


CHECKS: dict[str, Callable[[object, str], object]] = {
    "instruments": _instruments,
    "calibration": _calibration,
    "channel": _channel,
    "unit": _unit,
    "polarity": _polarity,
    "source": _source,
    "plate": _plate,
    "linearity": _linearity,
    "low_pass": _flag,
    "limits": _limits,
}
