"""Level in the room below an impact, by the modes of floor and room and statistically above."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from thud.base._schema import LIMITS, VERDICTS, Room
from thud.base.bridge import ask
from thud.base.checks import refuse, require_kind
from thud.base.display import Tabulated
from thud.base.note import Note
from thud.case.case import Case, case_text, impact_only
from thud.case.constructions import Construction, with_floor
from thud.floors.description import rating_text, rating_title
from thud.floors.survey import RoomLevels
from thud.impact.compute import compute, new_floor_impact, new_room_level
from thud.impact.floor_impact import FloorImpact
from thud.impact.room_level import RoomLevel
from thud.level.assessment import ImpactOrRecording, criterion_quantity
from thud.level.levels import BANDWIDTHS, SOURCES
from thud.level.rating import PredictedRating, class_of, rating, standardized_level

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from thud.base._schema import FloorOptions
    from thud.base.display import Columns
    from thud.recordings.recording import ImpactResult

    Array = NDArray[np.float64]

BANDS = BANDWIDTHS[1]
# Maximum change of the peak force by the floor, dB, for which the blocked force raises no warning.
MAX_CHANGE = 0.1
# A-weighted level below which other paths than those of the prediction dominate in a building, dB.
MIN_PLAUSIBLE = 30.0


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class RoomPrediction(RoomLevel, Tabulated):
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
    source_notes : tuple of Note
        Warning on a source that does not conform to the standards; the verdict is undecided.
    """

    floor: FloorOptions
    room: Room
    source: ImpactResult
    force: Literal["contact", "blocked"]
    force_change: float
    source_notes: tuple[Note, ...]

    @property
    def rating(self) -> PredictedRating:
        """The rating that the room asks for by its key `rating`."""
        return self.ratings[self.room.rating]

    @property
    def is_ball(self) -> bool:
        """Whether the source is the rubber ball, for which the standards define L_iA,Fmax."""
        return self.source.limits_source in {None, SOURCES[0]}

    @property
    def korean_class(self) -> int | None:
        """Class of the rating of octaves (KS F 2863-2), 0 for none; None unless a ball conforms."""
        if not self.is_ball or self.source_notes:
            return None
        return class_of(self.ratings["octaves"].level)

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
    def weighted_shares(self) -> Array:
        """Fractions of the A-weighted energy from the floor and from each wall, (1 + n_wall,).

        The energy from the floor is that which it radiates directly or through the ceiling.
        """
        # A path without energy is silent, 300 dB below the others.
        paths = 10 * np.log10(np.maximum(self.path_shares, 1e-30)).T
        levels = np.array([rating(self.level + path, BANDS).a_weighted for path in paths])
        return np.asarray(10 ** ((levels - self.ratings["thirds"].level) / 10))

    @property
    def standardized(self) -> Array:
        """Standardized levels L'_i,Fmax,V,T, dB, shape (12,) (ISO 16283-2)."""
        return standardized_level(self.level, self.reverberation_time, self.volume)

    @property
    def notes(self) -> tuple[Note, ...]:
        """Warnings on the validity of the prediction."""
        result = [*self.floor_notes]
        level = self.ratings["thirds"].level
        if level < MIN_PLAUSIBLE:
            result.append(Note("level_below_paths", "room", level, high=MIN_PLAUSIBLE, unit="dB"))
        change, model = self.force_change, self.source.case.model
        if self.force == "blocked" and abs(change) > MAX_CHANGE:
            result.append(Note("blocked_force", "floor", change, high=MAX_CHANGE, unit="dB"))
        elif self.force == "blocked" and model is not None:
            others = {"model": model.name}
            result.append(
                Note("blocked_model", "floor", change, high=MAX_CHANGE, unit="dB", others=others)
            )
        return (*result, *self.source_notes)

    def difference(self, measured: RoomLevels) -> Array:
        """Return measured − predicted level, dB, shape (12,), without standardization.

        Raise InputError if the measured levels are not in one-third-octave bands.
        """
        require_kind("measured", measured, RoomLevels)
        if measured.bands != BANDS:
            refuse("measured: the bands of the levels are octaves", "one-third-octave bands")
        rated = np.isin(measured.frequency, self.frequency)
        return np.asarray(measured.level[rated] - self.level)

    def columns(self) -> Columns:
        """Return the levels in bands."""
        return {
            "band, Hz": (self.frequency, "g"),
            "level, dB": (self.level, ".1f"),
            "standard uncertainty, dB": (self.uncertainty, ".1f"),
            "simply supported, dB": (self.simple_level, ".1f"),
            "clamped, dB": (self.clamped_level, ".1f"),
            "standardized, dB": (self.standardized, ".1f"),
            "energy, mJ": (1e3 * self.energy, ".3g"),
        }

    def plot(self, ax: Axes | None = None, measured: RoomLevels | None = None) -> Figure:
        """Draw levels, also measured ones, and what they follow from; in axes the levels alone."""
        from thud.plot.room_figures import draw_levels, draw_prediction

        return draw_levels(self, measured, ax) if ax else draw_prediction(self, measured)

    def __repr__(self) -> str:
        """Return rating, requirement and what is wrong with the source."""
        title = rating_title(self, self.room.rating)
        return f"<RoomPrediction: {title} {rating_text(self)}>"


def predict_level(
    source: ImpactResult | None = None,
    floor: FloorOptions | Construction | str | None = None,
    room: Room | None = None,
) -> RoomPrediction:
    """Predict the level that an impact causes in the room below.

    Up to the crossover, where three modes of the room overlap, floor and room move in their modes;
    if the support of the floor is unknown, the level is the energy mean of those with simply
    supported and clamped edges. Above it transient statistical energy analysis is used: the floor
    loses and radiates the energy of the impact according to ISO 12354-1, and that in the room
    decays with the reverberation time. The level is the maximum of the Fast detector. The force is
    that on the floor, or that on a rigid floor if the model has no other; it is computed again if
    `floor` is not the floor of the impact.

    Parameters
    ----------
    source
        Impact of any model, or a recording; by default that of `Case(floor=floor, room=room)`, the
        standard ball.
    floor, room
        Floor and room; by default those of the impact's case, else `Room()`, as large as the floor
        and 2.5 m high. A construction, or its name, also describes the ceiling of the room.

    Raises
    ------
    InputError
        If the floor is missing, or floor or room are out of range.
    """
    require_kind("source", source, ImpactOrRecording | None)
    case = Case() if source is None else source.case
    require_kind("room", room, Room | None)
    room = room or case.room or Room()
    case = with_floor(replace(case, room=room), case.floor if floor is None else floor)
    floor, room = case.floor, case.room
    if floor is None or room is None:
        refuse("&floor is missing", "a floor, such as Plate, or the name of a construction")
    if source is None:
        source = compute(Case(floor=floor, room=room))
    case = source.case
    floor_case = replace(impact_only(case), floor=floor, room=room)
    impact, level = _on_floor(source, floor_case, room)
    if (floor, room) == (case.floor, case.room):
        level = source.room_level or level
    if level is None:
        force = (impact or source).mean_force()
        answer = ask(
            "room_level", case=case_text(floor_case), force=force, sample_rate=source.sample_rate
        )
        level = new_room_level(answer)
    if impact:
        blocked = (
            source.blocked_force.max() if isinstance(source, FloorImpact) else source.peak_force
        )
        change = 20 * math.log10(impact.peak_force / blocked)
    else:
        change = _force_change(source.mass, source.contact_time, 1 / level.conductance.max())
    if (notes := _source_notes(source)) and room.required:
        level = replace(level, verdict=VERDICTS[2])
    return RoomPrediction(
        **vars(level),
        floor=floor,
        room=room,
        source=impact or source,
        force="contact" if impact else "blocked",
        force_change=change,
        source_notes=notes,
    )


def _source_notes(source: ImpactResult) -> tuple[Note, ...]:
    """Return a note if octave levels of the force on a rigid floor do not conform to standards."""
    levels = (
        source.blocked_levels() if isinstance(source, FloorImpact) else source.levels(force="floor")
    )
    # The octaves are the first criteria.
    octaves = zip(LIMITS[source.limits_source or SOURCES[0]], levels, strict=False)
    outside = [
        f"{criterion_quantity(name).title} {level - (lower + upper) / 2:.1f} dB"
        for (name, _, lower, upper), level in octaves
        if not lower <= level <= upper
    ]
    if not outside:
        return ()
    return (Note("source_not_conforming", "room", others={"octaves": ", ".join(outside)}),)


def _on_floor(
    source: ImpactResult, case: Case, room: Room
) -> tuple[FloorImpact | None, RoomLevel | None]:
    """Return the impact on the floor of a case; None if only the blocked force is known.

    Also return the level in its room if the impact is computed again.
    """
    existing = source if isinstance(source, FloorImpact) else source.on_floor
    known, air = source.case, source.case.room or Room()
    state = case.floor, room.air_density, room.sound_speed
    if known.model is None or state == (known.floor, air.air_density, air.sound_speed):
        return existing, None
    blocked = source.blocked_force if isinstance(source, FloorImpact) else source.force("floor")
    answer = ask("floor_impact", case=case_text(case))
    return new_floor_impact(case, answer, blocked), new_room_level(answer)


def _force_change(mass: float, contact_time: float, resistance: float) -> float:
    """Return the change of the peak force of a linear source by a resistive floor, dB.

    F'' + (k/Z) F' + (k/M) F = 0 with F(0) = 0 and F'(0) = k v0. The ratio of the peak to that on a
    rigid floor is exp(-b ln((b + s)/w)/s) with b = k/(2 Z), w**2 = k/M and s**2 = b**2 - w**2,
    which is imaginary if the force oscillates.
    """
    stiffness = mass * (math.pi / contact_time) ** 2
    decay, natural = stiffness / (2 * resistance), math.sqrt(stiffness / mass)
    root = cmath.sqrt(decay**2 - natural**2)
    exponent = decay * (cmath.log((decay + root) / natural) / root).real if root else 1.0
    return -20 / math.log(10) * exponent
