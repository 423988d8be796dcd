"""Level in the room below an impact, by transient statistical energy analysis."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from thud.base._schema import Room
from thud.base.arguments import check_arguments
from thud.base.bridge import ask
from thud.base.checks import refuse, require_kind
from thud.base.display import Displayed
from thud.case.case import Case, case_text
from thud.floors.constructions import Construction
from thud.floors.survey import RoomLevels
from thud.impact.compute import compute
from thud.impact.floor_impact import FloorImpact, new_floor_impact
from thud.impact.room_level import RoomLevel, new_room_level
from thud.level.impact_result import ImpactResult
from thud.level.levels import BANDWIDTHS, SOURCES, force_exposure_levels
from thud.level.rating import (
    Rating,
    Requirement,
    class_range,
    range_text,
    rating,
    standardized_level,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from thud.base._schema import FloorOptions, RoomRequiredRating

    Array = NDArray[np.float64]

BANDS = BANDWIDTHS[1]
# Maximum change of the peak force by the floor, dB, for which the blocked force raises no warning.
MAX_CHANGE = 0.1
# A-weighted level below which other paths than those of the prediction dominate in a building, dB.
MIN_PLAUSIBLE = 30.0


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class RoomPrediction(RoomLevel, Displayed):
    """Level that an impact causes in the room below.

    Attributes are those of `RoomLevel` and the following.

    Attributes
    ----------
    floor, room : Plate and Room
        Floor and room of the prediction.
    source : Impact or Recording
        Impact or recording whose force is used.
    force : str
        ``"contact"``: the force on the mobile floor is used; ``"blocked"``: the force on a rigid
        floor, which is the only force of recordings and measured modes.
    force_change : float
        Change of the peak force by the floor, dB. If the force is blocked: the change for a linear
        source with the mass and the contact time of the impact.
    source_warnings : tuple of str
        Sentences on a source that does not conform to the standards.
    """

    floor: FloorOptions
    room: Room
    source: ImpactResult
    force: Literal["contact", "blocked"]
    force_change: float
    source_warnings: tuple[str, ...]

    @property
    def rating(self) -> Rating:
        """Single-number rating of the statistical levels in the room."""
        return rating(self.level, BANDS)

    @property
    def modal_rating(self) -> Rating:
        """Single-number rating of the levels by the modes of floor and room."""
        return rating(self.modal_level, BANDS)

    @property
    def has_edges(self) -> bool:
        """Whether levels by modes are known for simply supported and for clamped edges."""
        return self.n_modal > 0 and hasattr(self.floor, "support")

    @property
    def rated_text(self) -> str:
        """Mean rating of both predictions with its interval, such as ``"57 dB (55 to 60)"``."""
        return self._text_of("thirds")

    @property
    def is_ball(self) -> bool:
        """Whether the source is the rubber ball, for which the standards define L_iA,Fmax."""
        return self.source.limits_source in {None, SOURCES[0]}

    @property
    def rated_name(self) -> str:
        """Name of the rating: ``"L_iA,Fmax"``; of the tyre ``"A-weighted level"``."""
        return "L_iA,Fmax" if self.is_ball else "A-weighted level"

    @property
    def standards(self) -> tuple[str, str, str]:
        """Standards of `rated`, `octave_rating` and `standardized_rating`; empty for the tyre."""
        names = " (ISO 717-2)", " (KS F 2863-2)", " (ISO 16283-2)"
        return names if self.is_ball else ("", "", "")

    @property
    def source_note(self) -> str:
        """``"the source does not conform"``, which belongs beside each rating, or empty."""
        return "the source does not conform" if self.source_warnings else ""

    @property
    def octave_text(self) -> str:
        """Mean rating of octaves with its interval, such as ``"59 dB (56 to 61)"``."""
        return self._text_of("octaves")

    @property
    def standardized_text(self) -> str:
        """Mean rating of standardized bands with its interval."""
        return self._text_of("standardized")

    def _text_of(self, name: RoomRequiredRating) -> str:
        return range_text(self.rated_of(name), self.interval_of(name))

    @property
    def class_text(self) -> str:
        """Class of the mean rating of octaves, and the classes of its interval.

        Instead the reason if the source does not conform; empty for the tyre.
        """
        if not self.is_ball:
            return ""
        if self.source_note:
            return f"class not stated: {self.source_note}"
        return class_range(self.rated_of("octaves"), self.interval_of("octaves"))

    @property
    def radiated_share(self) -> Array:
        """Fraction of the energy loss of the floor that is radiated into the room, shape (12,)."""
        air = self.room.air_density * self.room.sound_speed
        omega = 2 * np.pi * self.frequency
        radiated = air * self.radiation_factor / (self.mass_per_area * omega)
        # The loss is at least the internal loss plus the radiation to both sides.
        internal = getattr(self.floor, "loss_factor", 0.0)
        return radiated / np.maximum(self.loss_factor, internal + 2 * radiated)

    @property
    def rated_shares(self) -> Array:
        """Fractions of the A-weighted energy from the floor and from each wall, (1 + n_wall,).

        The energy from the floor is that which it radiates directly or through the ceiling. The
        levels are the statistical ones.
        """
        # A path without energy is silent, 300 dB below the others.
        paths = 10 * np.log10(np.maximum(self.path_shares, 1e-30)).T
        ratings = np.array([rating(self.level + path, BANDS).a_weighted for path in paths])
        return np.asarray(10 ** ((ratings - self.rating.a_weighted) / 10))

    @property
    def octave_rating(self) -> Rating:
        """Single-number rating of the statistical octave levels, with the Korean class."""
        return rating(self.octave_level, BANDWIDTHS[0])

    @property
    def ratings(self) -> dict[RoomRequiredRating, Rating]:
        """Statistical ratings by name, one for each standard."""
        return {
            "octaves": self.octave_rating,
            "thirds": self.rating,
            "standardized": self.standardized_rating,
        }

    @property
    def modal_ratings(self) -> dict[RoomRequiredRating, Rating]:
        """Ratings by the modes of floor and room, by name."""
        standardized = standardized_level(self.modal_level, self.reverberation_time, self.volume)
        return {
            "octaves": rating(self.modal_octave_level, BANDWIDTHS[0]),
            "thirds": self.modal_rating,
            "standardized": rating(standardized, BANDS),
        }

    @property
    def requirement(self) -> Requirement | None:
        """Verdict on the requirement of the room (its key `required`); None without one."""
        room = self.room
        if not room.required:
            return None
        name = room.required_rating
        return Requirement(
            name, room.required, self.rated_of(name), self.interval_of(name),
            self.source.limits_source or SOURCES[0], not self.source_warnings,
        )  # fmt: skip

    @property
    def standardized(self) -> Array:
        """Standardized levels L'_i,Fmax,V,T, dB, shape (12,) (ISO 16283-2)."""
        return standardized_level(self.level, self.reverberation_time, self.volume)

    @property
    def standardized_rating(self) -> Rating:
        """Single-number rating of the standardized levels."""
        return rating(self.standardized, BANDS)

    @property
    def model_difference(self) -> Array:
        """Level by modes − statistical level, dB, shape (12,): uncertainty of the model.

        NaN above the modal bands.
        """
        modal = np.arange(len(self.level)) < self.n_modal
        return np.where(modal, self.modal_level - self.level, np.nan)

    @property
    def has_few_modes(self) -> NDArray[np.bool_]:
        """Whether a band has fewer than `few_modes` of floor or room, shape (12,)."""
        return np.minimum(self.floor_modes, self.room_modes) < self.few_modes

    @property
    def warnings(self) -> tuple[str, ...]:
        """Sentences on the validity of the prediction."""
        few = self.has_few_modes
        result = [*self.floor_warnings]
        if few.any():
            bands = ", ".join(f"{f:g}" for f in self.frequency[few])
            result.append(
                f"fewer than {self.few_modes:g} modes of floor or room at {bands} Hz: levels there "
                "are means over many floors and rooms; levels at single positions are expected to "
                f"have a standard deviation of {self.spread[few].max():.1f} to "
                f"{self.spread[few].min():.1f} dB"
            )
        if not self.n_modal:
            result.append(
                "there is no prediction by modes: the rating is that of the statistical one, and "
                "its interval contains neither the edges nor the model"
            )
        if self.rated < MIN_PLAUSIBLE:
            result.append(
                f"the rating is below {MIN_PLAUSIBLE:g} dB: in a building, flanking paths, gaps "
                "and bridges that are not in the prediction are expected to be louder"
            )
        if self.force == "blocked" and abs(self.force_change) > MAX_CHANGE:
            result.append(
                f"the floor is not rigid: its motion would change the peak force by about "
                f"{self.force_change:.1f} dB, but the force on a rigid floor is used"
            )
        elif self.force == "blocked" and (model := self.source.case.model) is not None:
            result.append(
                f"the model {model.name} has no force on a mobile floor: that on a rigid floor is "
                f"used, whose peak the floor would change by at most {MAX_CHANGE:g} dB"
            )
        return (*result, *self.source_warnings)

    def difference(self, measured: RoomLevels) -> Array:
        """Return measured − predicted level, dB, shape (12,), without standardization.

        Raise InputError if the measured levels are not in one-third-octave bands.
        """
        require_kind("measured", measured, RoomLevels)
        if measured.bands != BANDS:
            refuse("measured: the bands of the levels are octaves", "one-third-octave bands")
        rated = np.isin(measured.frequency, self.frequency)
        return np.asarray(measured.level[rated] - self.level)

    def rows(self) -> list[tuple[str, ...]]:
        """Return the header and a row of text for each band."""
        header = (
            "band, Hz", "statistical, dB", "modal, dB", "simply supported, dB", "clamped, dB",
            "standardized, dB", "spread, dB", "energy, mJ", "floor modes",
        )  # fmt: skip
        columns = (
            self.level, self.modal_level, self.simple_level, self.clamped_level, self.standardized,
            self.spread, 1e3 * self.energy, self.floor_modes,
        )  # fmt: skip
        forms = (".1f", ".1f", ".1f", ".1f", ".1f", ".1f", ".3g", ".1f")
        cells = [
            [f"{value:{form}}" for value in column]
            for column, form in zip(columns, forms, strict=True)
        ]
        # Columns by modes, where the sound is modal.
        for i, count in ((1, self.n_modal), *((i, self.n_modal * self.has_edges) for i in (2, 3))):
            cells[i][count:] = ["–"] * (len(self.frequency) - count)
        return [header, *zip((f"{f:g}" for f in self.frequency), *cells, strict=True)]

    def plot(self, measured: RoomLevels | None = None) -> Figure:
        """Draw force, energy, floor and levels in the room, with measured levels if stated."""
        from thud.plot.room_figures import draw_prediction

        return draw_prediction(self, measured)

    def __repr__(self) -> str:
        """Return the single-number ratings."""
        required = self.requirement
        iso_717, korean, iso_16283 = self.standards
        note, classes = (
            f", {text}" if text else "" for text in (self.source_note, self.class_text)
        )
        modal = f"modal {self.modal_rating.rounded} dB" if self.n_modal else "no modal prediction"
        return (
            f"<RoomPrediction: {self.rated_name}{iso_717} {self.rated_text}{note}; "
            f"statistical {self.rating.rounded} dB, {modal}; "
            f"of octaves{korean} {self.octave_text}{classes}; "
            f"standardized{iso_16283} {self.standardized_text}"
            f"{f'; {required}' if required else ''}>"
        )


@check_arguments
def predict_level(
    source: ImpactResult | None = None,
    floor: FloorOptions | Construction | None = None,
    room: Room | None = None,
) -> RoomPrediction:
    """Predict the level that an impact causes in the room below.

    Transient statistical energy analysis: the floor absorbs the energy that an infinite plate would
    absorb, and loses and radiates it according to ISO 12354-1. The energy in the room decays with
    the reverberation time. The level is the maximum of the Fast detector. The force is that on the
    floor, or that on a rigid floor if the model has no other; it is computed again if `floor` is
    not the floor of the impact.

    Parameters
    ----------
    source
        Impact of any model, or a recording; by default that of `Case(floor=floor, room=room)`, the
        standard ball.
    floor, room
        Floor and room; by default those of the impact's case, else `Room()`, as large as the floor
        and 2.5 m high. A construction also describes the ceiling of the room.

    Raises
    ------
    InputError
        If the floor is missing, or floor or room are out of range.
    """
    require_kind("source", source, ImpactResult | None)
    case = Case() if source is None else source.case
    room = room or case.room or Room()
    if isinstance(floor, Construction):
        case = floor.case(replace(case, room=room))
        floor, room = case.floor, case.room
    floor = floor or case.floor
    if floor is None or room is None:
        refuse("floor is missing", "a floor, such as Plate")
    if source is None:
        source = compute(Case(floor=floor, room=room))
    case = source.case
    floor_case = replace(case, modes=None, floor=floor, room=room)
    impact, level = _on_floor(source, floor_case)
    if (floor, room) == (case.floor, case.room):
        level = source.room_level or level
    if level is None:
        force = (impact or source).mean_force()
        answer = ask(
            "room_level", case=case_text(floor_case), force=force, sample_rate=source.sample_rate
        )
        level = new_room_level(answer)
        assert level is not None  # noqa: S101 - the answer of this question has a room
    if impact:
        blocked = (
            source.blocked_force.max() if isinstance(source, FloorImpact) else source.peak("floor")
        )
        change = 20 * math.log10(impact.peak("floor") / blocked)
    else:
        change = _force_change(source.mass, source.contact_time, 1 / level.conductance.max())
    return RoomPrediction(
        **vars(level),
        floor=floor,
        room=room,
        source=impact or source,
        force="contact" if impact else "blocked",
        force_change=change,
        source_warnings=_source_warnings(source),
    )


def _source_warnings(source: ImpactResult) -> tuple[str, ...]:
    """Return a warning if octave levels of the force on a rigid floor do not conform."""
    levels = (
        force_exposure_levels(source.blocked_force, source.sample_rate)
        if isinstance(source, FloorImpact)
        else source.levels(BANDWIDTHS[0], force="floor")
    )
    octaves = [c for c in source.assess(force="floor").criteria if c.name.startswith("octave_")]
    outside = [
        f"{octave.quantity.title} {level - (octave.lower + octave.upper) / 2:.1f} dB"
        for octave, level in zip(octaves, levels, strict=True)
        if not octave.lower <= level <= octave.upper
    ]
    if not outside:
        return ()
    warning = (
        f"the source does not conform ({', '.join(outside)} from the nominal levels): the level in "
        "the room is not that of a standard source"
    )
    return (warning,)


def _on_floor(source: ImpactResult, case: Case) -> tuple[FloorImpact | None, RoomLevel | None]:
    """Return the impact on the floor of a case; None if only the blocked force is known.

    Also return the level in its room if the impact is computed again.
    """
    existing = source if isinstance(source, FloorImpact) else source.on_floor
    known = source.case
    if known.model is None or (known.floor, _air(known)) == (case.floor, _air(case)):
        return existing, None
    plain = replace(case, compression=None)
    blocked = source.blocked_force if isinstance(source, FloorImpact) else source.force("floor")
    answer = ask("floor_impact", case=case_text(plain))
    return new_floor_impact(case, answer, blocked), new_room_level(answer)


def _air(case: Case) -> tuple[float, float]:
    """Return density, kg/m3, and speed of sound, m/s, of the air around the floor of a case."""
    room = case.room or Room()
    return room.air_density, room.sound_speed


def _force_change(mass: float, contact_time: float, resistance: float) -> float:
    """Return the change of the peak force of a linear source by a resistive floor, dB.

    F'' + (k/Z) F' + (k/M) F = 0 with F(0) = 0 and F'(0) = k v0. The ratio of the peak to that on a
    rigid floor is exp(-b arctan(w/b)/w) with b = k/(2 Z), w**2 = k/M - b**2; if the force does not
    oscillate, exp(-b artanh(w/b)/w) with w**2 = b**2 - k/M.
    """
    stiffness = mass * (math.pi / contact_time) ** 2
    decay = stiffness / (2 * resistance)
    square = stiffness / mass - decay**2
    rate = math.sqrt(abs(square))
    # ln((b + w)/(b - w))/2 without cancellation: b**2 - w**2 = k/M.
    angle = (
        math.atan2(rate, decay)
        if square > 0
        else math.log((decay + rate) / math.sqrt(stiffness / mass))
    )
    return -20 / math.log(10) * (decay / rate * angle if rate > 0 else 1.0)
