"""Single-number ratings of the levels in the room below, and their standardization."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from thud.base._schema import CLASS_LIMITS, RATED_BANDS
from thud.base.bridge import ask
from thud.base.checks import refuse, require_choice, require_number
from thud.base.display import Tabulated
from thud.level.levels import BANDWIDTHS, finite_array

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    from thud.base._schema import BandSet, RoomRating
    from thud.base.display import Columns

# Maximum magnitude of a sound level, dB.
MAX_LEVEL = 1000.0
# Range of volumes, m3, times, s, and frequencies, Hz: any that are positive.
POSITIVE = 1e-9, 1e9


@dataclass(frozen=True, repr=False)
class Rating(Tabulated):
    """Single-number rating of the levels of a heavy/soft impact source in the room below.

    Attributes
    ----------
    bands : str
        Rated bands: octaves 63 to 500 Hz, or one-third octaves 50 to 630 Hz.
    a_weighted : float
        A-weighted maximum level L_iA,Fmax, dB (ISO 717-2 annex D).
    rounded : int
        `a_weighted`, rounded half up, dB.
    korean_class : int or None
        Class 1 to 4 of KS F 2863-2 by A-weighted level (at most 37, 41, 45 and 49 dB), 0 for none.
        It applies to levels that are not standardized. None for one-third octaves, which KS F
        2863-2 does not use.
    curve : int or None
        Inverse-A curve rating, dB, of former editions of KS F 2863-2; None for one-third octaves.
    """

    bands: BandSet
    a_weighted: float
    rounded: int
    korean_class: int | None
    curve: int | None

    def __repr__(self) -> str:
        """Return rating and class."""
        number = self.korean_class
        name = f", {f'class {number}' if number else 'no class'} (KS F 2863-2)"
        level = f"L_iA,Fmax {self.rounded} dB ({self.a_weighted:.2f})"
        return f"<Rating, {self.bands}s: {level}{'' if number is None else name}>"

    def columns(self) -> Columns:
        """Return the numbers; NaN where one-third octaves have none."""
        names = ("L_iA,Fmax, dB", "rounded, dB", "class", "inverse-A curve, dB")
        values = (self.a_weighted, self.rounded, self.korean_class, self.curve)
        return {"rating": (names, ""), "value": ([np.nan if v is None else v for v in values], "g")}

    def rows(self) -> list[tuple[str, ...]]:
        """Return header and rows of text, with the standards."""
        rows: list[tuple[str, ...]] = [
            ("rating", "value"),
            ("L_iA,Fmax, dB (ISO 717-2)", f"{self.rounded} ({self.a_weighted:.2f})"),
        ]
        if self.korean_class is not None:
            rows += [
                ("class (KS F 2863-2)", class_text(self.korean_class)),
                ("inverse-A curve rating, dB (KS F 2863-2, former)", str(self.curve)),
            ]
        return rows


@dataclass(frozen=True, repr=False)
class PredictedRating:
    """Single-number rating of predicted levels in the room below.

    Attributes
    ----------
    name : str
        ``"octaves"``, ``"thirds"`` or ``"standardized"``.
    level, uncertainty : float
        A-weighted level, not rounded, and its standard uncertainty, dB.
    contributions : mapping
        Contributions to the standard uncertainty by name, dB, the largest first: support of the
        edges, data of floor and room, source, and model.
    """

    name: RoomRating
    level: float
    uncertainty: float
    contributions: Mapping[str, float]

    @property
    def rounded(self) -> int:
        """Level as it is stated and compared with limits, dB."""
        return math.floor(self.level + 0.5)

    def __repr__(self) -> str:
        """Return level and standard uncertainty."""
        return f"{self.rounded} dB, standard uncertainty {self.uncertainty:.1f} dB"


def excess_level(limit: float) -> float:
    """Return the lowest level that, rounded, exceeds a limit.

    >>> excess_level(49.0)
    49.5
    """
    return math.floor(limit) + 0.5


def class_of(level: float) -> int:
    """Return the class of a level by KS F 2863-2; 0 is no class.

    >>> class_of(49.49), class_of(49.5)
    (4, 0)
    """
    classes = enumerate(CLASS_LIMITS, 1)
    return next((number for number, limit in classes if level < excess_level(limit)), 0)


def class_text(korean_class: int | None) -> str:
    """Return a class of KS F 2863-2 with its limit; empty for None.

    >>> class_text(4)
    'class 4 (at most 49 dB)'
    """
    if korean_class is None:
        return ""
    number = korean_class or len(CLASS_LIMITS)
    limit = f"at most {CLASS_LIMITS[number - 1]:g} dB"
    return f"class {number} ({limit})" if korean_class else f"no class (class {number}: {limit})"


def rating(levels: ArrayLike, bands: BandSet = "octave") -> Rating:
    """Return the single-number rating of levels in the room below.

    Parameters
    ----------
    levels : array_like, shape (4,) or (12,)
        Maximum Fast levels of the octaves 63 to 500 Hz, or of the one-third octaves 50 to 630 Hz,
        dB re 20 uPa, as measured or standardized.
    bands
        ``"octave"`` or ``"third"``. Each band is weighted on its own, as the maxima of one-third
        octaves do not add up to those of octaves.

    Raises
    ------
    InputError
        If the number of levels is wrong, or a value is not a plausible sound level.

    Examples
    --------
    >>> import thud
    >>> thud.rating([65.3, 64.5, 58.0, 55.8]).rounded
    55
    """
    require_choice("bands", bands, RATED_BANDS)
    frequencies = RATED_BANDS[bands]
    values = finite_array("levels", levels, (1,), (-MAX_LEVEL, MAX_LEVEL), "dB")
    if values.shape != (len(frequencies),):
        refuse(
            f"levels have the shape {values.shape}",
            f"({len(frequencies)},), the {bands}s {frequencies[0]:g} to {frequencies[-1]:g} Hz",
        )
    answer = ask("rating", bands=bands, levels=values)
    class_, curve = None, None
    if bands == BANDWIDTHS[0]:
        class_, curve = int(answer["class"]), int(answer["curve"])
    return Rating(bands, answer["a_weighted"], int(answer["rounded"]), class_, curve)


def standardized_level(
    level: ArrayLike, reverberation_time: ArrayLike, volume: float
) -> NDArray[np.float64]:
    """Standardize levels to a room of 50 m3 with a reverberation time of 0.5 s (ISO 16283-2).

    L'_i,Fmax,V,T = L_i,Fmax + 10 lg(V/V0) - 10 lg(g(C)/g(C0)) with C = T/1.7275 s and
    g(C) = C**(-1/(C - 1)), the maximum response of the Fast detector to a decay.

    Parameters
    ----------
    level : array_like, shape (n,)
        Maximum Fast levels, dB re 20 uPa.
    reverberation_time : array_like, shape () or (n,)
        Reverberation times, s.
    volume
        Volume of the room, m3.

    Returns
    -------
    ndarray, shape (n,)
        Standardized levels, dB.

    Raises
    ------
    InputError
        If a value is not finite, a time or the volume is not positive, or the lengths differ.
    """
    values = finite_array("level", level, (0, 1)).ravel()
    times = finite_array("reverberation_time", reverberation_time, (0, 1), POSITIVE, "s").ravel()
    if len(times) not in {1, len(values)}:
        refuse(
            f"reverberation_time has {len(times)} values for {len(values)} levels",
            "one, or one for each level",
        )
    times = np.broadcast_to(times, values.shape)
    volume = require_number("volume", volume, *POSITIVE, "m3")
    answer = ask("rating", levels=values, reverberation_time=times, volume=volume)
    return np.asarray(answer["levels"])
