"""A predicted floor for consultants: assumptions, changes, and every number in tables."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from decimal import Decimal
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from thud.base._schema import (
    KEYS,
    JoistFloor,
    LaminateFloor,
    MeasuredMobility,
    ModalFloor,
    Plate,
    RectangularFloor,
    Room,
)
from thud.base.errors import ThudError
from thud.base.units import display_unit
from thud.case.keys import humanize
from thud.floors.constructions import Layer
from thud.floors.prediction import BANDS, predict_level
from thud.floors.resonances import resonances
from thud.level.levels import get_bands
from thud.level.rating import rated_bands, rating

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from thud.base._schema import FloorOptions, RoomRequiredRating
    from thud.base.key import Key
    from thud.floors.constructions import Construction
    from thud.floors.prediction import RoomPrediction

    Cells = tuple[str | float, ...]

# Contributions to the interval of the rating, in words.
CONTRIBUTIONS = {
    "source": "another source that conforms",
    "edges": "support of the edges",
    "reverberation_time": "reverberation time, ±20 %",
    "positions": "positions of ball and microphone",
    "model": "difference of both predictions",
}
# Beginnings of the names of keys without effect if another key has a value.
_WITHOUT_EFFECT: dict[tuple[str, object], tuple[str, ...]] = {
    ("screed_thickness", 0.0): ("screed_", "layer_stiffness", "layer_loss_factor"),
    ("subceiling_thickness", 0.0): ("subceiling_", "channel_", "cavity_"),
    ("covering_stiffness", 0.0): ("covering_",),
    ("ceiling_mass", 0.0): ("ceiling_",),
    ("wall_lengths", ()): ("wall_", "junction_"),
    ("wall_junction", "cross"): ("junction_",),
    ("wall_junction", "t"): ("junction_",),
}
# Keys that are listed even if they have their default value.
_MAIN = (
    "length", "width", "thickness", "sheathing_thickness", "joist_height", "density",
    "screed_thickness", "layer_stiffness", "loss_factor", "support", "reverberation_time",
)  # fmt: skip
# Deviation that is not listed by its value, dB.
_NEGLIGIBLE = 0.05
# Added to a thickness, m.
_ADDED = 0.01
_THICKNESSES = {
    "screed_thickness": "floating plate",
    "thickness": "bearing plate",
    "sheathing_thickness": "sheathing",
    "joist_height": "joists",
}
# Thicknesses that a case does not state, for its drawing, m.
_LAYER, _BOARD = 0.02, 0.0125
# Density that gives the drawn thickness of an added mass, kg/m3: that of loose gravel.
_GRAVEL_DENSITY = 1500.0
# Thicknesses of the layers of a laminate by default, m.
_LAMELLAS = (0.04, 0.02, 0.04, 0.02, 0.04)
_ASSUMED = "(thickness assumed)"
# Maximum number of values of a key that are listed.
_MAX_SHOWN = 12
# Key that is the requirement, not an assumption.
_REQUIRED = "required"


class Change(NamedTuple):
    """A change of floor or room, and the change of the rating, dB; NaN if it is not allowed."""

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
        return tuple(_case_layers(self.prediction))

    @property
    def contributions(self) -> dict[str, tuple[float, float]]:
        """Lower and upper deviation from the rating, dB, the largest contribution first.

        Without a prediction by modes those of edges and model are not known; that of the edges is
        not known either if the floor is given by its own modes.
        """
        entries = [
            (name, ends)
            for name, ends in self.prediction.contributions.items()
            if (self.prediction.n_modal or name != "model")
            and (self.prediction.has_edges or name != "edges")
        ]
        return dict(sorted(entries, key=lambda entry: -max(map(abs, entry[1]))))

    @property
    def largest(self) -> str:
        """Name of the largest contribution, in words."""
        return contribution_title(next(iter(self.contributions)), self.prediction)

    @property
    def ratings(self) -> list[tuple[str, str, float, str]]:
        """Title, standard, value, dB, and text of each rating; no standard for the tyre."""
        prediction = self.prediction
        note = f"; {prediction.source_note}" if prediction.source_note else ""
        octaves = ", ".join(filter(None, (prediction.octave_text, prediction.class_text)))
        if prediction.n_modal:
            statistical, modal = (
                known["octaves"].rounded for known in (prediction.ratings, prediction.modal_ratings)
            )
            octaves += f"; statistical {statistical} dB, by modes {modal} dB"
        predictions = "mean of both predictions" if prediction.n_modal else "prediction"
        mean = f"{predictions}, with interval"
        result = [
            (mean, "ISO 717-2", prediction.rated, f"{prediction.rated_text}{note}"),
            _rating_entry("statistical prediction", "ISO 717-2", prediction.level),
        ]
        if prediction.n_modal:
            result += [_rating_entry("prediction by modes", "ISO 717-2", prediction.modal_level)]
        if prediction.has_edges:
            result += [
                _rating_entry("by modes, simply supported", "ISO 717-2", prediction.simple_level),
                _rating_entry("by modes, clamped", "ISO 717-2", prediction.clamped_level),
            ]
        result += [
            (
                "standardized", "ISO 16283-2", prediction.rated_of("standardized"),
                prediction.standardized_text,
            ),
            ("of octaves", "KS F 2863-2", prediction.rated_of("octaves"), octaves),
        ]  # fmt: skip
        if prediction.is_ball:
            return result
        return [(title, "", value, text) for title, _, value, text in result]

    @property
    def paths(self) -> list[str]:
        """Titles of the paths of the sound: the floor and each wall."""
        lengths = self.prediction.room.wall_lengths
        return ["floor", *(f"wall {i} ({length:g} m)" for i, length in enumerate(lengths, start=1))]

    @property
    def path_shares(self) -> str:
        """Fractions of the A-weighted energy by path, in percent."""
        shares = zip(self.paths, self.prediction.rated_shares, strict=True)
        return ", ".join(f"{path} {100 * share:.2g} %" for path, share in shares)

    @property
    def assumptions(self) -> list[tuple[str, str, str]]:
        """Quantity, value with unit, and source of the main and the stated values.

        The resonances that follow from them are the last.
        """
        rows = [(meaning, value, source) for _, meaning, value, source in self._values() if source]
        computed = [
            (f"resonance: {name}", f"{number_text(value)} Hz", "from both masses and the stiffness")
            for name, value in resonances(self.prediction).items()
        ]
        return [("Quantity", "Value", "Source"), *rows, *computed]

    @property
    def defaults(self) -> list[str]:
        """Names and values of the other keys that have an effect."""
        return [f"{name}: {value}" for name, _, value, source in self._values() if not source]

    def _values(self) -> Iterator[tuple[str, str, str, str]]:
        """Yield name, meaning, value and source of each key with an effect.

        The source is empty for default values of keys that are not main ones.
        """
        construction = self.construction
        prediction, ceiling = self.prediction, construction.room if construction else {}
        sources = construction.sources if construction else {}
        for group, owner, known in (
            (prediction.floor, prediction.floor.name, sources),
            (prediction.room, "room", {key: sources[key] for key in ceiling}),
        ):
            for key, value, is_default in _effective_values(group, owner):
                source = known.get(key.name, "" if is_default else "stated in the case")
                if not source and key.name in _MAIN:
                    source = "default value"
                # The construction takes the sides of the case.
                stated = getattr(construction.floor, key.name, value) if construction else value
                if owner != "room" and value != stated:
                    source = "that of the case"
                meaning = re.split("[;:(]|, 0", key.meaning)[0].strip()
                yield humanize(key.name), meaning, _value_text(key, value), source

    @cached_property
    def changes(self) -> tuple[Change, ...]:
        """Changes of the rating by changes of floor and room, each predicted again."""
        source, floor = self.prediction.source, self.prediction.floor
        result = []
        for text, changed_floor, changed_room in _variants(floor, self.prediction.room):
            try:
                difference = predict_level(source, changed_floor, changed_room).rated
                difference -= self.prediction.rated
            except ThudError:
                difference = np.nan
            result.append(Change(text, difference))
        # The largest effect first; changes that are not allowed last.
        result.sort(key=lambda change: (np.isnan(change.difference), -abs(change.difference)))
        return tuple(result)

    @property
    def force_levels(self) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        """Force exposure levels of the used force, dB re 1 N, shape (12,)."""
        levels = self.prediction.source.levels(BANDS, force="floor")
        return np.asarray(levels[np.isin(get_bands(BANDS).nominal, self.prediction.frequency)])


# Title with unit, decimals or significant digits on the page, and value of each column of bands.
COLUMNS: dict[str, tuple[str, Callable[[PredictedFloor], Iterable[float]]]] = {
    "force level, dB re 1 N": (".1f", lambda floor: floor.force_levels),
    "energy into the bearing floor, µJ": ("#.3g", lambda floor: 1e6 * floor.prediction.energy),
    "radiation factor": ("#.3g", lambda floor: floor.prediction.radiation_factor),
    "loss factor": (".3f", lambda floor: floor.prediction.loss_factor),
    "T, s": (".2f", lambda floor: floor.prediction.reverberation_time),
    "statistical, dB": (".1f", lambda floor: floor.prediction.level),
    "spread, dB": (".1f", lambda floor: floor.prediction.spread),
    "modal, dB": (".1f", lambda floor: floor.prediction.modal_level),
    "simply supported, dB": (".1f", lambda floor: floor.prediction.simple_level),
    "clamped, dB": (".1f", lambda floor: floor.prediction.clamped_level),
    "modal − statistical, dB": (".1f", lambda floor: floor.prediction.model_difference),
    "standardized, dB": (".1f", lambda floor: floor.prediction.standardized),
}

# Columns of modal bands only, and whether they need a choice of edges.
_MODAL = {
    "modal, dB": False, "simply supported, dB": True, "clamped, dB": True,
    "modal − statistical, dB": False,
}  # fmt: skip


def contribution_title(name: str, prediction: RoomPrediction) -> str:
    """Return a contribution in words; that of other sources, if this one does not conform."""
    if name == "source" and prediction.source_note:
        return "sources that conform, unlike this one"
    return CONTRIBUTIONS.get(name, name.replace("_", " "))


def deviation_text(ends: tuple[float, float]) -> str:
    """Return lower and upper deviation, dB.

    >>> deviation_text((-1.5, 1.5)), deviation_text((-1.26, 0.0)), deviation_text((-0.04, 0.0))
    ('±1.5', '−1.3 to 0.0', 'less than 0.1')
    """
    if max(map(abs, ends)) < _NEGLIGIBLE:
        return "less than 0.1"
    low, high = (f"{end:z.1f}".replace("-", "−") for end in ends)
    return f"±{high}" if low == f"−{high}" else f"{low} to {high}"


def difference_text(change: Change) -> str:
    """Return the change of a rating, dB, with its sign."""
    if np.isnan(change.difference):
        return "not allowed"
    return f"{change.difference:+z.1f}".replace("-", "−")


def number_text(value: float, form: str = ".3g") -> str:
    """Return a number by a format, without exponent and with a minus sign.

    >>> number_text(-0.123), number_text(4.45e-5), number_text(1e5, ".5g"), number_text(66.092)
    ('−0.123', '0.0000445', '100000', '66.1')
    """
    return f"{Decimal(f'{value:z{form}}'):f}".replace("-", "−")


def band_rows(floor: PredictedFloor) -> list[tuple[str, ...]]:
    """Return the bands as rows of text, the header first; modal levels only of modal bands."""
    cells = [
        ["–" if isinstance(value, str) else number_text(value, form) for value in column]
        for (form, _), column in zip(COLUMNS.values(), _columns(floor), strict=True)
    ]
    bands = (f"{frequency:g}" for frequency in floor.prediction.frequency)
    return [("band, Hz", *COLUMNS), *zip(bands, *cells, strict=True)]


def _columns(floor: PredictedFloor) -> list[list[float | str]]:
    """Return the columns of bands; where a modal column has no own value, an empty text."""
    prediction = floor.prediction
    result: list[list[float | str]] = []
    for title, (_, values) in COLUMNS.items():
        column: list[float | str] = [*map(float, values(floor))]
        if title in _MODAL:
            count = prediction.n_modal if prediction.has_edges or not _MODAL[title] else 0
            column[count:] = [""] * (len(column) - count)
        result.append(column)
    return result


def tables(floors: Sequence[PredictedFloor], *, changes: bool) -> dict[str, list[Cells]]:
    """Return every number of floors in tables by name, each with a header."""
    bands: list[Cells] = [("floor", "band, Hz", *COLUMNS, "floor modes", "room modes", "modal")]
    ratings: list[Cells] = [("floor", "rating", "standard", "value, dB", "text")]
    head = ("floor", "rating", "contribution", "lower, dB", "upper, dB")
    contributions: list[Cells] = [head]
    octaves: list[Cells] = [("floor", "prediction", *octave_titles())]
    paths: list[Cells] = [("floor", "band, Hz", "path", "fraction of the energy")]
    changed: list[Cells] = [("floor", "change", "difference, dB")]
    for floor in floors:
        prediction = floor.prediction
        count = len(prediction.frequency)
        columns = [
            map(float, prediction.frequency), *_columns(floor), map(float, prediction.floor_modes),
            map(float, prediction.room_modes), map(float, np.arange(count) < prediction.n_modal),
        ]  # fmt: skip
        bands += [(floor.name, *row) for row in zip(*columns, strict=True)]
        octaves += [
            (floor.name, title, *values) for title, values in octave_levels(prediction).items()
        ]
        ratings += [(floor.name, *entry) for entry in floor.ratings]
        ratings += [(floor.name, *entry) for entry in _rating_details(floor)]
        required = prediction.requirement
        if required:
            ratings.append((floor.name, "required", "", required.required, str(required)))
        contributions += [
            (floor.name, rated, name, *deviations[name])
            for rated, deviations in prediction.all_contributions.items()
            for name in floor.contributions
        ]
        shares = [*prediction.path_shares, prediction.rated_shares]
        for band, row in zip([*prediction.frequency, "A"], shares, strict=True):
            paths += [(floor.name, band, *path) for path in zip(floor.paths, row, strict=True)]
        if changes:
            changed += [(floor.name, *change) for change in floor.changes]
    result = {
        "bands": bands, "octaves": octaves, "ratings": ratings, "contributions": contributions,
        "paths": paths,
    }  # fmt: skip
    return {**result, "changes": changed} if changes else result


def sheets(floors: Sequence[PredictedFloor]) -> dict[str, list[Cells]]:
    """Return the assumptions and the warnings of floors as tables, each with a header."""
    assumptions: list[Cells] = [("floor", "quantity", "value", "source")]
    warnings: list[Cells] = [("floor", "warning")]
    for floor in floors:
        assumptions += [(floor.name, *row) for row in floor.assumptions[1:]]
        warnings += [(floor.name, warning) for warning in floor.prediction.warnings]
    return {"assumptions": assumptions, "warnings": warnings}


def octave_levels(prediction: RoomPrediction) -> dict[str, list[float]]:
    """Return levels of octaves and their rating, dB, by the prediction that they belong to."""
    both = {"statistical": (prediction.octave_level, prediction.ratings)}
    if prediction.n_modal:
        both["by modes"] = (prediction.modal_octave_level, prediction.modal_ratings)
    return {
        title: [*map(float, levels), ratings["octaves"].a_weighted]
        for title, (levels, ratings) in both.items()
    }


def octave_texts(prediction: RoomPrediction) -> list[str]:
    """Return the levels of octaves, in a text for each prediction."""
    octaves = ", ".join(f"{frequency:g}" for frequency in rated_bands("octave"))
    return [
        f"{title}: {', '.join(number_text(level, '.1f') for level in levels)} dB at {octaves} Hz"
        for title, (*levels, _) in octave_levels(prediction).items()
    ]


def octave_titles() -> list[str]:
    """Return the titles of the columns of `octave_levels`."""
    return [*(f"{frequency:g} Hz, dB" for frequency in rated_bands("octave")), "A-weighted, dB"]


def _rating_details(floor: PredictedFloor) -> Iterator[tuple[str, str, float, str]]:
    """Yield the ends of the intervals, and the ratings by both predictions of what is not rated."""
    prediction = floor.prediction
    names: dict[RoomRequiredRating, str] = {
        "thirds": "", "standardized": "standardized, ", "octaves": "of octaves, ",
    }  # fmt: skip
    standards = {title: standard for title, standard, _, _ in floor.ratings}
    for name, beginning in names.items():
        standard = standards[beginning.removesuffix(", ") or "statistical prediction"]
        if beginning:
            value = prediction.ratings[name]
            yield f"{beginning}statistical", standard, value.a_weighted, f"{value.rounded} dB"
        if beginning and prediction.n_modal:
            value = prediction.modal_ratings[name]
            yield f"{beginning}by modes", standard, value.a_weighted, f"{value.rounded} dB"
        for end, level in zip(("lower", "upper"), prediction.interval_of(name), strict=True):
            yield f"{beginning}{end} end of the interval", standard, level, ""


def _rating_entry(
    title: str, standard: str, levels: np.ndarray[tuple[int], np.dtype[np.float64]]
) -> tuple[str, str, float, str]:
    value = rating(levels, BANDS)
    return title, standard, value.a_weighted, f"{value.rounded} dB"


def _effective_values(group: FloorOptions | Room, owner: str) -> Iterator[tuple[Key, object, bool]]:
    """Yield the keys of a group that have an effect, their values, and whether by default."""
    off = [
        prefix
        for (switch, value), prefixes in _WITHOUT_EFFECT.items()
        if getattr(group, switch, None) == value
        for prefix in prefixes
    ]
    for key in KEYS:
        if key.owner != owner or not hasattr(group, key.name):
            continue
        value = getattr(group, key.name)
        is_default = value == getattr(type(group)(), key.name)
        if key.name.startswith(("point_", _REQUIRED, *off)) or (is_default and value in (0.0, ())):
            continue
        yield key, value, is_default


def _value_text(key: Key, value: object) -> str:
    """Return the value of a key with its unit."""
    numbers = value if isinstance(value, tuple) else (value,)
    if len(numbers) > _MAX_SHOWN:
        return f"{len(numbers)} values"
    if key.kind == "text":
        return str(value)
    if not all(isinstance(number, float) for number in numbers):
        return ", ".join(humanize(str(entry)) for entry in numbers)
    # A reverberation time of 500 ms would be unusual.
    largest = max(map(abs, numbers), default=0.0)
    unit, size = ("s", 1.0) if key.unit == "s" else display_unit(key.unit, largest)
    text = ", ".join(number_text(number / size, ".4g") for number in numbers)
    return f"{text} {unit.replace('m2', 'm²').replace('m3', 'm³')}".strip()


def _variants(
    floor: Any,  # noqa: ANN401 - the keys of floors differ
    room: Room,
) -> list[tuple[str, FloorOptions, Room]]:
    """Return changes of floor and room in words, with the changed floor and room."""
    variants: list[tuple[str, FloorOptions, Room]] = []

    def add(text: str, floor: FloorOptions = floor, room: Room = room) -> None:
        variants.append((text, floor, room))

    for key, title in _THICKNESSES.items():
        value = getattr(floor, key, 0.0)
        # The mobility or the modes of a known floor do not follow its plate.
        if value and not isinstance(floor, ModalFloor | MeasuredMobility):
            add(f"{title} +{1e3 * _ADDED:g} mm", replace(floor, **{key: value + _ADDED}))
    if isinstance(floor, LaminateFloor) and floor.layer_thickness:
        top, *others = floor.layer_thickness
        layers = (top + _ADDED, *others)
        add(f"top lamella +{1e3 * _ADDED:g} mm", replace(floor, layer_thickness=layers))
    if getattr(floor, "screed_thickness", 0.0):
        stiffness = floor.layer_stiffness / 2
        add("stiffness of the resilient layer halved", replace(floor, layer_stiffness=stiffness))
    if getattr(floor, "subceiling_thickness", 0.0):
        stiffness = floor.channel_stiffness / 2
        add("stiffness of the channels halved", replace(floor, channel_stiffness=stiffness))
        density = 2 * floor.subceiling_density
        add("mass of the subceiling doubled", replace(floor, subceiling_density=density))
    if room.ceiling_mass:
        add("mass of the ceiling doubled", room=replace(room, ceiling_mass=2 * room.ceiling_mass))
    time = room.reverberation_time
    times = tuple(2 * value for value in (time if isinstance(time, tuple) else (time,)))
    add("reverberation time doubled", room=replace(room, reverberation_time=times))
    return variants


def _case_layers(prediction: RoomPrediction) -> list[Layer]:
    """Return the layers that the keys of floor and room describe."""
    floor, room = prediction.floor, prediction.room
    layers: list[Layer] = []

    def add(material: str, thickness: float) -> None:
        layers.append(Layer(material, round(thickness, 6), 0.0))

    built = floor if isinstance(floor, RectangularFloor) else None
    if built and built.screed_thickness:
        add(f"floating plate, {built.screed_density:g} kg/m³", built.screed_thickness)
        add(f"resilient layer {_ASSUMED}", _LAYER)
    below = built if built and built.subceiling_thickness else None
    cavity = below.cavity_depth if below else room.ceiling_depth if room.ceiling_mass else 0.0
    if isinstance(floor, Plate):
        add(f"plate, {floor.density:g} kg/m³", floor.thickness)
    elif isinstance(floor, LaminateFloor):
        for material, thickness in _laminate_layers(floor):
            add(material, thickness)
    elif isinstance(floor, ModalFloor | MeasuredMobility):
        add(f"plate like the floor, {floor.density:g} kg/m³", floor.thickness)
    else:
        assert isinstance(floor, JoistFloor)  # noqa: S101 - no other floor radiates
        add(f"sheathing, {floor.sheathing_density:g} kg/m³", floor.sheathing_thickness)
        apart = f"{1e3 * floor.joist_width:g} mm wide, {floor.spacing:g} m apart"
        add(f"joists, {apart}", floor.joist_height)
        cavity -= floor.joist_height
    if cavity > 0:
        add("cavity", cavity)
    if below:
        add(f"subceiling, {below.subceiling_density:g} kg/m³", below.subceiling_thickness)
    if room.ceiling_mass:
        add(f"ceiling, {room.ceiling_mass:g} kg/m² {_ASSUMED}", _BOARD)
    return layers


def _laminate_layers(floor: LaminateFloor) -> Iterator[tuple[str, float]]:
    """Yield material and thickness, m, of an added mass and of the layers of a laminate."""
    if floor.added_mass:
        added = f"added mass, {floor.added_mass:g} kg/m² {_ASSUMED}"
        yield added, floor.added_mass / _GRAVEL_DENSITY
    # By default the key is empty.
    for i, thickness in enumerate(floor.layer_thickness or _LAMELLAS):
        yield f"lamella, {'across' if i % 2 else 'along'}", thickness
