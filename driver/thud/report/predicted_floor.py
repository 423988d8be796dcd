"""A predicted floor for consultants: assumptions, changes, and every number in tables."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from thud.base._schema import RATED_BANDS, MeasuredMobility, ModalFloor, Room
from thud.base.errors import ThudError
from thud.base.note import decimal_text
from thud.base.units import display_unit
from thud.case.keys import humanize
from thud.floors.description import CONTRIBUTIONS, case_layers, rating_title, verdict_text
from thud.floors.prediction import BANDS, predict_level
from thud.floors.resonances import floor_frequencies, resonances, room_frequencies
from thud.level.levels import get_bands
from thud.level.rating import class_text

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from thud.base._schema import FloorOptions
    from thud.base.key import Key
    from thud.case.constructions import Construction, Layer
    from thud.floors.prediction import RoomPrediction

    Array = NDArray[np.float64]
    Cells = tuple[str | float, ...]


# Keys that are listed even if they have their default value.
_MAIN = (
    "length", "width", "thickness", "sheathing_thickness", "joist_height", "density",
    "screed_thickness", "layer_stiffness", "loss_factor", "support", "reverberation_time",
)  # fmt: skip
# Added to a thickness, m.
_ADDED = 0.01
_THICKNESSES = {
    "screed_thickness": "floating plate",
    "thickness": "bearing plate",
    "sheathing_thickness": "sheathing",
    "joist_height": "joists",
    "layer_thickness": "top lamella",
}
# Changed key of a floor by the words for its change, and its factor.
_FACTORS = {
    "stiffness of the resilient layer halved": ("layer_stiffness", 0.5),
    "stiffness of the channels halved": ("channel_stiffness", 0.5),
    "mass of the subceiling doubled": ("subceiling_density", 2.0),
}
# Maximum number of values of a key that are listed.
_MAX_SHOWN = 12
# Keys that are the requirement, no assumptions.
_REQUIRED = ("required", "rating")


class Change(NamedTuple):
    """A change of floor or room, and the change of the rating, dB."""

    text: str
    difference: float


@dataclass(frozen=True)
class PredictedFloor:
    """A prediction with what is known of its floor.

    Attributes
    ----------
    name, file : str
        Title of the floor, and beginning of the names of its files.
    prediction : RoomPrediction
        Level in the room below.
    construction : Construction or None
        Construction, with sources of its values; None for the floor of a case.
    details : tuple of (str, str)
        Names and texts at the head of the page, such as project, client and date.
    """

    name: str
    file: str
    prediction: RoomPrediction
    construction: Construction | None = None
    details: tuple[tuple[str, str], ...] = ()

    @property
    def layers(self) -> tuple[Layer, ...]:
        """Layers from top to bottom; of a case, those that its keys describe."""
        if self.construction:
            return self.construction.layers
        return case_layers(self.prediction.floor, self.prediction.room)

    @property
    def contributions(self) -> dict[str, float]:
        """Contributions to the standard uncertainty of the rating, dB; the largest first."""
        contributions = self.prediction.rating.contributions
        return {CONTRIBUTIONS[name].title: value for name, value in contributions.items() if value}

    @property
    def ratings(self) -> list[tuple[str, float, float, str]]:
        """Title, value, standard uncertainty, dB, and text of each rating, the asked one first."""
        prediction = self.prediction
        korean = class_text(prediction.korean_class)
        classes = korean and f"; KS F 2863-2: {korean}"
        ratings = sorted(prediction.ratings.values(), key=lambda entry: entry != prediction.rating)
        return [
            (
                rating_title(prediction, entry.name), entry.level, entry.uncertainty,
                f"{entry}{classes if entry.name == 'octaves' else ''}",
            )
            for entry in ratings
        ]  # fmt: skip

    @property
    def paths(self) -> list[str]:
        """Titles of the paths of the sound: the floor and each wall."""
        lengths = self.prediction.room.wall_lengths
        return ["floor", *(f"wall {i} ({length:g} m)" for i, length in enumerate(lengths, start=1))]

    @property
    def path_shares(self) -> str:
        """Fractions of the A-weighted energy by path, in percent."""
        shares = zip(self.paths, self.prediction.weighted_shares, strict=True)
        return ", ".join(f"{path} {100 * share:.0f} %" for path, share in shares)

    @property
    def assumptions(self) -> list[tuple[str, str, str]]:
        """Quantity, value with unit, and source of the main and the stated values."""
        rows = [(meaning, value, source) for _, meaning, value, source in self._values() if source]
        return [("Quantity", "Value", "Source"), *rows]

    @property
    def defaults(self) -> list[str]:
        """Names and values of the other keys that have an effect."""
        return [f"{name}: {value}" for name, _, value, source in self._values() if not source]

    def _values(self) -> Iterator[tuple[str, str, str, str]]:
        """Yield name, meaning, value and source of each key with an effect.

        The source is empty for default values of keys that are not main ones.
        """
        floor, room, construction = self.prediction.floor, self.prediction.room, self.construction
        sources = construction.sources if construction else {}
        ceiling = {key: sources[key] for key in construction.room} if construction else {}
        for group, known in ((floor, sources), (room, ceiling)):
            for key, value, is_default in _effective_values(group):
                default = "default value" if key.name in _MAIN else ""
                source = known.get(key.name, default if is_default else "stated in the case")
                # The construction takes the sides of the case.
                stated = getattr(construction.floor, key.name, value) if construction else value
                if group is floor and value != stated:
                    source = "that of the case"
                yield humanize(key.name), key.meaning, _value_text(key, value), source

    @cached_property
    def modes(self) -> list[tuple[str, float]]:
        """Name and natural frequency, Hz, of the lowest modes of floor and room, and resonances."""
        own = enumerate(floor_frequencies(self.prediction), start=1)
        rooms = room_frequencies(self.prediction).items()
        return [
            *((f"floor {number}", frequency) for number, frequency in own),
            *(("room {}, {}, {}".format(*order), frequency) for order, frequency in rooms),
            *resonances(self.prediction).items(),
        ]

    @cached_property
    def changes(self) -> tuple[Change, ...]:
        """Changes of the rating by those that the floor allows, predicted again; largest first."""
        now, result = self.prediction, []
        for text, of_floor, of_room in _variants(now.floor, now.room):
            try:
                floor, room = replace(now.floor, **of_floor), replace(now.room, **of_room)
                changed = predict_level(now.source, floor, room)
            except ThudError:
                continue
            result.append(Change(text, changed.rating.level - now.rating.level))
        return tuple(sorted(result, key=lambda change: -abs(change.difference)))

    def columns(self) -> dict[str, tuple[Array, str]]:
        """Return the levels in bands, and what they follow from; NaN where edges do not matter."""
        prediction = self.prediction
        levels = prediction.source.levels(BANDS, force="floor")
        rated = np.isin(get_bands(BANDS).nominal, prediction.frequency)
        matters = prediction.simple_level != prediction.clamped_level

        def of_edges(level: Array) -> Array:
            return np.where(matters, level, np.nan)

        return {
            "band, Hz": (prediction.frequency, "g"),
            "force level, dB re 1 N, 1 s": (levels[rated], ".1f"),
            "energy into the bearing floor, µJ": (1e6 * prediction.energy, "#.3g"),
            "radiation factor": (prediction.radiation_factor, "#.3g"),
            "loss factor": (prediction.loss_factor, ".3f"),
            "T, s": (prediction.reverberation_time, ".2f"),
            "level, dB": (prediction.level, ".1f"),
            "standard uncertainty, dB": (prediction.uncertainty, ".1f"),
            "simply supported, dB": (of_edges(prediction.simple_level), ".1f"),
            "clamped, dB": (of_edges(prediction.clamped_level), ".1f"),
            "standardized, dB": (prediction.standardized, ".1f"),
        }


def difference_text(change: Change) -> str:
    """Return the change of a rating, dB, with its sign."""
    return f"{change.difference:+z.1f}".replace("-", "−")


def number_text(value: float, form: str = ".3g") -> str:
    """Return a number by a format, without exponent and with a minus sign.

    >>> number_text(-0.123), number_text(4.45e-5), number_text(1e5, ".5g"), number_text(66.092)
    ('−0.123', '0.0000445', '100000', '66.1')
    """
    return decimal_text(value, f"z{form}").replace("-", "−")


def band_rows(floor: PredictedFloor) -> list[tuple[str, ...]]:
    """Return the bands as rows of text, the header first."""
    columns = floor.columns()
    cells = [
        ["–" if np.isnan(value) else number_text(value, form) for value in values]
        for values, form in columns.values()
    ]
    return [tuple(columns), *zip(*cells, strict=True)]


def tables(floors: Sequence[PredictedFloor], *, changes: bool) -> dict[str, list[Cells]]:
    """Return every number of floors in tables by name, each with a header."""
    result: dict[str, list[Cells]] = {}
    for floor in floors:
        for name, (titles, rows) in _tables(floor, changes=changes).items():
            table = result.setdefault(name, [("floor", *titles)])
            table += [(floor.name, *row) for row in rows]
    return result


def _tables(
    floor: PredictedFloor, *, changes: bool
) -> dict[str, tuple[Sequence[str], Iterable[Iterable[str | float]]]]:
    """Return titles and rows of each table of a floor."""
    prediction, limit = floor.prediction, floor.prediction.room.required
    columns, bands = floor.columns(), prediction.frequency.tolist()
    by_modes = [float(i < prediction.n_modal) for i in range(len(bands))]
    texts = [("required", limit, "", verdict_text(prediction))] if limit else []
    shares = zip([*bands, "A"], [*prediction.path_shares, prediction.weighted_shares], strict=True)
    deviation = "standard uncertainty, dB"
    changed: list[Change] = [*floor.changes] if changes else []
    return {
        "bands": (
            (*columns, "by modes"),
            zip(*(_cells(values) for values, _ in columns.values()), by_modes, strict=True),
        ),
        "octaves": (octave_titles(), [prediction.octave_level.tolist()]),
        "ratings": (("rating", "value, dB", deviation, "text"), [*floor.ratings, *texts]),
        "contributions": (("contribution", deviation), floor.contributions.items()),
        "paths": (
            ("band, Hz", "path", "fraction of the energy"),
            [(band, *path) for band, row in shares for path in zip(floor.paths, row, strict=True)],
        ),
        "modes": (("mode", "natural frequency, Hz"), floor.modes),
        **({"changes": (("change", "difference, dB"), changed)} if changes else {}),
        "assumptions": (("quantity", "value", "source"), floor.assumptions[1:]),
        "warnings": (("warning",), [(str(note),) for note in prediction.notes]),
    }


def _cells(values: Iterable[float]) -> list[float | str]:
    """Return numbers for a table; an empty text for NaN."""
    return ["" if np.isnan(value) else float(value) for value in values]


def octave_titles() -> list[str]:
    """Return the titles of the columns of octave levels."""
    return [f"{frequency:g} Hz, dB" for frequency in RATED_BANDS["octave"]]


def _effective_values(group: FloorOptions | Room) -> Iterator[tuple[Key, object, bool]]:
    """Yield the keys of a group that have an effect, their values, and whether by default."""
    for key in group.keys.values():
        value = getattr(group, key.name)
        is_default = value == getattr(type(group)(), key.name)
        is_shown = key.has_effect(group) and not key.name.startswith(("point_", *_REQUIRED))
        if is_shown and not (is_default and value in (0.0, ())):
            yield key, value, is_default


def _value_text(key: Key, value: object) -> str:
    """Return the value of a key with its unit."""
    numbers = value if isinstance(value, tuple) else (value,)
    if len(numbers) > _MAX_SHOWN:
        return f"{len(numbers)} values"
    if key.kind == "text":
        return str(value)
    if not all(isinstance(number, int | float) for number in numbers):
        return ", ".join(humanize(str(entry)) for entry in numbers)
    # A reverberation time of 500 ms would be unusual.
    largest = max(map(abs, numbers), default=0.0)
    unit, size = ("s", 1.0) if key.unit == "s" else display_unit(key.unit, largest)
    text = ", ".join(number_text(number / size, ".4g") for number in numbers)
    return f"{text} {unit.replace('m2', 'm²').replace('m3', 'm³')}".strip()


def _variants(
    floor: Any,  # noqa: ANN401 - the keys of floors differ
    room: Room,
) -> Iterator[tuple[str, dict[str, Any], dict[str, Any]]]:
    """Yield changes in words, with the changed values of keys of the floor and of the room."""
    # The mobility or the modes of a known floor do not follow its plate.
    is_computed = not isinstance(floor, ModalFloor | MeasuredMobility)
    for key, title in _THICKNESSES.items():
        if is_computed and (value := getattr(floor, key, 0.0)):
            # Of the layers of a laminate the top one changes.
            changed = (
                (value[0] + _ADDED, *value[1:]) if isinstance(value, tuple) else value + _ADDED
            )
            yield f"{title} +{1e3 * _ADDED:g} mm", {key: changed}, {}
    for text, (key, factor) in _FACTORS.items():
        if key in floor.keys and floor.keys[key].has_effect(floor):
            yield text, {key: factor * getattr(floor, key)}, {}
    if room.ceiling_mass:
        yield "mass of the ceiling doubled", {}, {"ceiling_mass": 2 * room.ceiling_mass}
    times = tuple((2 * np.atleast_1d(room.reverberation_time)).tolist())
    yield "reverberation time doubled", {}, {"reverberation_time": times}
