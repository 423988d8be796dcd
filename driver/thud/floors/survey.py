"""Evaluation of levels measured in a room below a floor.

According to ISO 16283-2 for the rubber ball: energy mean over the positions, correction for
background, standardization by reverberation time and volume, and rating by ISO 717-2 annex D.
"""

from __future__ import annotations

import math
import unicodedata
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from thud.base._schema import RATED_BANDS
from thud.base.bridge import ask
from thud.base.checks import refuse, require_number
from thud.base.display import Tabulated
from thud.base.note import Note
from thud.level.levels import BANDWIDTHS
from thud.level.rating import POSITIVE, Rating, rating, standardized_level
from thud.recordings.formats.text import read_table

if TYPE_CHECKING:
    import os

    from numpy.typing import NDArray

    from thud.base._schema import BandSet
    from thud.base.display import Columns

    Array = NDArray[np.float64]

# Rounded mid frequencies from 1 Hz (ISO 3, R10), and the relative tolerance of frequencies.
R10 = 1.0, 1.25, 1.6, 2.0, 2.5, 3.15, 4.0, 5.0, 6.3, 8.0
NOMINAL = np.array([float(f"{10**decade * value:.3g}") for decade in range(5) for value in R10])
FREQUENCY_TOLERANCE = 0.03
# Minimum number of positions, and distance to the background, dB, below which a level is an upper
# bound (ISO 16283-2).
MIN_POSITIONS = 4
MIN_DISTANCE = 6.0
# Titles of the kinds of columns in English, German, Korean and Japanese, in lower case, letters
# only; those of positions may have a number. A column of a mean stands for all positions.
WORDS = {
    "frequency": "frequency f freq band hz centerfrequency centrefrequency midfrequency "
    "frequenz mittenfrequenz terzmittenfrequenz oktavmittenfrequenz terz terzband oktave oktavband "
    "octave octaveband thirdoctave onethirdoctave "
    "주파수 중심주파수 밴드 옥타브밴드 周波数 中心周波数 バンド オクターブバンド",
    "time": "reverberationtime t t20 t30 t60 rt rt20 rt30 rt60 nachhallzeit 잔향시간 残響時間",
    "background": "background backgroundlevel backgroundnoise backgroundnoiselevel noise "
    "hintergrund hintergrundpegel hintergrundgeräusch grundgeräusch grundgeräuschpegel störpegel "
    "störgeräusch fremdgeräusch fremdgeräuschpegel ruhepegel "
    "배경소음 배경소음레벨 암소음 암소음레벨 暗騒音 暗騒音レベル 背景騒音",
    "position": "position pos p point source level l lf lfmax lzf lzfmax lifmax lmax measurement "
    "messung messposition messpunkt punkt pegel 측정점 측정위치 위치 레벨 測定点 位置 レベル",
    "mean": "mean average mittelwert mittel mittlererpegel energymean meanlevel averagelevel "
    "평균 평균값 평균레벨 平均 平均値 平均レベル",
}
TITLES = {word: kind for kind, words in WORDS.items() for word in words.split()}
ALLOWED = (
    "a header row with the titles frequency (Hz), P1, P2 and so on for levels of positions (dB, "
    "not weighted) or mean for their mean, and, if known, background (dB), reverberation_time (s)"
)
# Name in messages, unit, and plausible values of each kind of column.
RANGES = {
    "frequency": ("frequency", "Hz", 0.0, math.inf),
    "position": ("level", "dB", -50.0, 200.0),
    "mean": ("level", "dB", -50.0, 200.0),
    "background": ("background", "dB", -50.0, 200.0),
    "time": ("reverberation_time", "s", 0.01, 100.0),
}
# Maximum plausible difference between levels of two positions, dB, mean over the bands.
MAX_DIFFERENCE = 15.0


@dataclass(frozen=True, eq=False, repr=False)
class RoomLevels(Tabulated):
    """Levels of a heavy/soft impact source in the room below, in bands.

    Attributes
    ----------
    name : str
        Name, such as that of the file.
    bands : str
        ``"octave"`` or ``"third"``.
    frequency : ndarray, shape (n_band,)
        Rounded mid frequencies, Hz, ascending; all rated bands, perhaps more.
    positions : ndarray, shape (n_position, n_band)
        Maximum Fast levels of each position, dB re 20 uPa.
    background, reverberation_time : ndarray, shape (n_band,), or None
        Background level, dB, and reverberation time, s, if known.
    volume : float or None
        Volume of the room, m3.
    """

    drawn_by: ClassVar[str] = "room_figures.room_levels"

    name: str
    bands: BandSet
    frequency: Array
    positions: Array
    background: Array | None = None
    reverberation_time: Array | None = None
    volume: float | None = None

    @property
    def measured(self) -> Array:
        """Energy mean of the positions, not corrected for background, dB, shape (n_band,)."""
        return np.asarray(10 * np.log10((10 ** (self.positions / 10)).mean(axis=0)))

    @property
    def level(self) -> Array:
        """Energy mean L_i,Fmax, corrected for background, dB, shape (n_band,)."""
        return self._corrected()[0]

    @property
    def is_upper_bound(self) -> NDArray[np.bool_]:
        """Whether a level is only an upper bound: less than 6 dB above the background."""
        return self._corrected()[1]

    @property
    def standardized(self) -> Array | None:
        """Standardized levels L'_i,Fmax,V,T, dB, shape (n_band,); None without time or volume."""
        if self.reverberation_time is None or self.volume is None:
            return None
        return standardized_level(self.level, self.reverberation_time, self.volume)

    @property
    def spread(self) -> Array | None:
        """Standard deviation over the positions, dB, shape (n_band,); None for one position."""
        return self.positions.std(axis=0, ddof=1) if len(self.positions) > 1 else None

    @property
    def rating(self) -> Rating:
        """Single-number rating of the levels without standardization."""
        return rating(self.level[self._rated], self.bands)

    @property
    def standardized_rating(self) -> Rating | None:
        """Single-number rating of the standardized levels; None without these levels."""
        levels = self.standardized
        return None if levels is None else rating(levels[self._rated], self.bands)

    @property
    def position_uncertainty(self) -> float | None:
        """Standard uncertainty of the ratings by the scatter of positions, dB.

        It is the standard error of the mean A-weighted energy over the positions; None for one
        position. It excludes instruments and reverberation time.
        """
        count = len(self.positions)
        if count == 1:
            return None
        weighted = [rating(levels[self._rated], self.bands).a_weighted for levels in self.positions]
        energy = 10 ** ((np.array(weighted) - max(weighted)) / 10)
        error = energy.std(ddof=1) / math.sqrt(count) / energy.mean()
        return float(10 / math.log(10) * error)

    @property
    def notes(self) -> tuple[Note, ...]:
        """Warnings on the levels and ratings."""
        result = []
        if (count := len(self.positions)) < MIN_POSITIONS:
            result.append(Note("few_positions", value=count, low=MIN_POSITIONS))
        difference = float(np.ptp(self.positions.mean(axis=1)))
        if difference > MAX_DIFFERENCE:
            result.append(
                Note("positions_differ", value=difference, high=MAX_DIFFERENCE, unit="dB")
            )
        if self.background is None:
            result.append(Note("background_unknown"))
        elif self.is_upper_bound.any():
            bands = ", ".join(f"{f:g}" for f in self.frequency[self.is_upper_bound])
            result.append(
                Note("near_background", low=MIN_DISTANCE, unit="dB", others={"bands": bands})
            )
        stated = {"reverberation times": self.reverberation_time, "the volume": self.volume}
        if missing := [name for name, value in stated.items() if value is None]:
            others = {"missing": " and ".join(missing)}
            result.append(Note("not_standardized", others=others))
        return tuple(result)

    def columns(self) -> Columns:
        """Return levels, reverberation times and background in bands, where they are known."""
        columns = {
            "nominal, Hz": (self.frequency, "g"),
            "mean, dB": (self.measured, "z.1f"),
            "spread, dB": (self.spread, "z.1f"),
            "background, dB": (self.background, "z.1f"),
            "level, dB": (self.level, "z.1f"),
            "is upper bound": (self.is_upper_bound, "d"),
            "reverberation time, s": (self.reverberation_time, ".2f"),
            "standardized, dB": (self.standardized, "z.1f"),
        }
        return {
            title: (values, form) for title, (values, form) in columns.items() if values is not None
        }

    def __repr__(self) -> str:
        """Return the single-number ratings."""
        standardized = self.standardized_rating
        suffix = "" if standardized is None else f", standardized {standardized.rounded} dB"
        count = len(self.positions)
        positions = f"{count} position{'s' * (count > 1)}"
        return f"<RoomLevels, {positions}: L_iA,Fmax {self.rating.rounded} dB{suffix}>"

    @property
    def _rated(self) -> NDArray[np.bool_]:
        return np.isin(self.frequency, RATED_BANDS[self.bands])

    def _corrected(self) -> tuple[Array, NDArray[np.bool_]]:
        if self.background is None:
            return self.measured, np.zeros(len(self.frequency), dtype=bool)
        result = ask("rating", levels=self.measured, background=self.background)
        return result["levels"], result["is_upper_bound"].astype(bool)


def read_room_levels(path: str | os.PathLike[str], volume: float | None = None) -> RoomLevels:
    """Read levels in a room from a table.

    Parameters
    ----------
    path
        Columns with a header row, as text or in the first sheet of a workbook (.xlsx) that has
        numbers: ``frequency``, Hz; ``background``, dB, and ``reverberation_time``, s, if known;
        ``P1``, ``P2`` and so on for levels of positions, dB, or ``mean`` for their mean. Titles may
        be German, Korean or Japanese, in UTF-8, or in the encodings of spreadsheets in these
        languages. There is a row for each rated band, and optionally for other bands.
    volume
        Volume of the room, m3.

    Raises
    ------
    InputError
        If a column or band is missing, duplicate or not plausible; the message names it.
    """
    table = read_table(path, ALLOWED)
    if not table.has_titles:
        refuse(f"{path}: {len(table.columns)} columns without titles", ALLOWED)
    kinds = [_kind(column.name) for column in table.columns]
    for column, kind in zip(table.columns, kinds, strict=True):
        if not kind or (kind == "mean" and "position" in kinds):
            refuse(f"{column.label} is not a level of a position", ALLOWED)
        if kind != "position" and kinds.count(kind) > 1:
            refuse(f"{path}: more than one column of {kind}", ALLOWED)
    columns = {
        kind: np.array([c.to(unit) for c, k in zip(table.columns, kinds, strict=True) if k == kind])
        for kind, (_, unit, *_) in RANGES.items()
        if kind in kinds
    }
    levels = "position" if "position" in kinds else "mean"
    for kind, name in (("frequency", "frequency"), (levels, "levels")):
        if kind not in kinds:
            refuse(f"{path}: there is no column of {name}", ALLOWED)
    stated = columns.pop("frequency")[0]
    frequency = NOMINAL[np.abs(NOMINAL - stated[:, np.newaxis]).argmin(axis=1)]
    unlike = stated[~(np.abs(frequency - stated) < FREQUENCY_TOLERANCE * stated)]
    if unlike.size:
        allowed = "those of octave or one-third-octave bands, such as 50, 63, 80"
        refuse(f"{path}: frequency = {unlike[0]:g} Hz is not a mid frequency", allowed)
    order = np.argsort(frequency)
    bands = _bands_of(frequency[order], path)
    for kind, values in columns.items():
        name, unit, low, high = RANGES[kind]
        if (wrong := values[~((values >= low) & (values <= high))]).size:
            refuse(
                f"{path}: {name} = {wrong[0]:g} {unit} is not allowed",
                f"{low:g} to {high:g} {unit}",
            )
        columns[kind] = values[:, order]
    background, time = (
        columns[kind][0] if kind in columns else None for kind in ("background", "time")
    )
    volume = None if volume is None else require_number("volume", volume, *POSITIVE, "m3")
    name = Path(path).stem
    return RoomLevels(name, bands, frequency[order], columns[levels], background, time, volume)


def rating_table(result: RoomLevels) -> list[tuple[str, ...]]:
    """Return header and rows of the single-number ratings."""
    standardized = result.standardized_rating
    rows = [*result.rating.rows()]
    if standardized is not None:
        rows = [(*row, other[1]) for row, other in zip(rows, standardized.rows(), strict=True)]
        rows[0] = ("rating", "in the room", "standardized")
        # The classes apply to levels in the room only.
        rows[2:3] = [(*row[:2], "") for row in rows[2:3]]
    return rows


def _kind(title: str) -> str:
    """Return the kind of a column, or an empty string if its title is not known.

    >>> _kind("Reverberation_time"), _kind("L_i,Fmax 3"), _kind("L_i,Fmax,V,T")
    ('time', 'position', '')
    """
    text = unicodedata.normalize("NFKC", title).lower()
    word = "".join(filter(str.isalnum, text))
    kind = TITLES.get(word, "")
    return kind or ("position" if TITLES.get(word.rstrip("0123456789")) == "position" else "")


def _bands_of(frequency: Array, path: object) -> BandSet:
    """Return the set of bands; raise InputError if a rated band is missing or a band duplicate."""
    duplicates = frequency[1:][np.diff(frequency) <= 0]
    if duplicates.size:
        refuse(f"{path}: frequency {duplicates[0]:g} Hz occurs twice", "each band once")
    steps = np.diff(np.log10(frequency))
    bands: BandSet = BANDWIDTHS[0] if steps.size and steps.min() > 0.2 else BANDWIDTHS[1]  # noqa: PLR2004
    rated = RATED_BANDS[bands]
    missing = np.setdiff1d(rated, frequency)
    if missing.size:
        words = ", ".join(f"{f:g}" for f in missing)
        refuse(
            f"{path}: there is no level at {words} Hz", f"{bands}s {rated[0]:g} to {rated[-1]:g} Hz"
        )
    return bands
