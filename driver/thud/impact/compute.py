"""Drops of a source by keywords or cases, and impacts from the answers of the library."""

from __future__ import annotations

import math
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base._schema import IMPACT_QUANTITIES, RATINGS, Ball, Drop, Sampling
from thud.base.bridge import ask, notes, without_units
from thud.base.checks import refuse, require_kind
from thud.base.errors import NumericalError, PlausibilityWarning
from thud.case.case import Case, case_text, impact_only, new_model
from thud.case.constructions import with_floor
from thud.impact.floor_impact import FloorImpact
from thud.impact.impact import Impact
from thud.impact.motion import new_motion
from thud.impact.room_level import RoomLevel
from thud.level.rating import PredictedRating

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.base._schema import FloorOptions, ModelName, ModelOptions, Room
    from thud.base.bridge import Bundle
    from thud.case.constructions import Construction

# Columns of every history; components of the force follow the motion, which are the first ones.
_COLUMNS = ("time", "deflection", "velocity", "elastic_force", "floor_force")
_N_MOTION = 3


def solve(  # noqa: PLR0913 - the keywords are the keys of two namelist groups
    ball: Ball | Case | None = None,
    drop: Drop | None = None,
    model: ModelName | ModelOptions | None = None,
    *,
    sample_rate: float | None = None,
    duration: float | None = None,
    substeps: int | None = None,
    floor: FloorOptions | Construction | str | None = None,
    room: Room | None = None,
    verify: bool = False,
    **options: object,
) -> Impact:
    """Drop a ball on a floor.

    Parameters
    ----------
    ball, drop
        Ball and drop, by default the standard rubber ball from 1 m. `ball` may instead be a `Case`,
        without any other argument.
    model
        ``"modal_ball"`` (the default), ``"finite_element"``, ``"hollow_sphere"`` (the analytical
        model of the paper), ``"measured_modes"``, ``"hunt_crossley"`` or ``"two_mass"``; or an
        object of the classes below, which holds the options.
    sample_rate
        Samples per second, Hz.
    duration
        Length of the record, s; longer than the contact.
    substeps
        Integration steps per sampling interval.
    floor
        Floor on which the ball is dropped in addition to a rigid floor, on which the standards
        assess the force. An object of `Rigid`, `InfinitePlate`, `Oscillator`, `Plate`,
        `LaminateFloor`, `JoistFloor`, `MeasuredMobility` or `ModalFloor`; or a construction or the
        name of one, which has a room.
    room
        Room below the floor, for `Impact.room_level`.
    verify
        Compute again at a finer resolution, for the numbers ``"finer_..."`` of
        `Impact.model_quantities`.
    **options
        Options of the model, such as ``momentum_flux="retarding"``; see `HollowSphere`,
        `ModalBall`, `FiniteElement`, `MeasuredModes`, `HuntCrossley` and `TwoMass`.

    Returns
    -------
    Impact
        Force, motion and scalar results.

    Raises
    ------
    InputError
        If the input is invalid; the message names group, key, value and allowed range.
    NumericalError
        If the drop leaves the range of the model or the time steps are too long.

    Warns
    -----
    PlausibilityWarning
        For each entry of `Impact.notes`.
    """
    sampling = {"sample_rate": sample_rate, "duration": duration, "substeps": substeps}
    settings = {name: value for name, value in sampling.items() if value is not None}
    if isinstance(ball, Case):
        others = drop, model, floor, room
        if settings or options or verify or any(value is not None for value in others):
            refuse("solve() has other arguments in addition to a case", "solve(case)")
        case = ball
    else:
        case = Case(
            ball=Ball() if ball is None else ball,
            drop=Drop() if drop is None else drop,
            model=new_model(model, options),
            sampling=Sampling(**settings, verify=verify),  # type: ignore[arg-type]
            room=room,
        )
        case = case if floor is None else with_floor(case, floor)
    impact = compute(case)
    for note in impact.notes:
        warnings.warn(PlausibilityWarning(note), stacklevel=2)
    return impact


def compute(case: Case) -> Impact:
    """Compute the impact of a case without raising its warnings."""
    require_kind("case", case, Case)
    if case.model is None:
        refuse("&model is missing", "a case with a source model")
    return new_impact(case, ask("solve", case=case_text(impact_only(case))))


def new_impact(case: Case, answer: Bundle) -> Impact:
    """Return the impact from a bundle of the library."""
    fields = _fields(case, answer)
    return Impact(
        **fields,
        notes=notes(answer["warnings"]) if "warnings" in answer else (),
        on_floor=(new_floor_impact(case, answer, fields["floor_force"]) if case.floor else None),
        room_level=new_room_level(answer) if "room" in answer else None,
    )


def new_floor_impact(
    case: Case, answer: Bundle, blocked_force: NDArray[np.float64]
) -> FloorImpact | None:
    """Return the impact on a mobile floor from an answer of the library; None if it has none."""
    if "floor_force" not in answer:
        return None
    columns = without_units(answer["floor_force"])
    return FloorImpact(
        **_fields(case, answer, "floor_"),
        notes=(),
        blocked_force=blocked_force,
        floor_displacement=columns["floor_displacement"],
        floor_velocity=columns["floor_velocity"],
        floor_work=answer["floor_summary"]["floor_work"],
    )


def new_room_level(answer: Bundle) -> RoomLevel:
    """Return the level from a bundle of the library that has one."""
    bands, room = without_units(answer["room_levels"]), answer["room"]
    frequency = bands.pop("nominal")
    shares = [bands.pop(name) for name in list(bands) if name.endswith("_share")]
    if not np.isfinite(bands["level"]).all():
        message = "&room: a value of the floor or the room is too extreme for a finite level"
        raise NumericalError(message)
    summary = answer["room_summary"]
    names = summary["contribution"].split("\n")
    contributed = zip(names, summary["contributed"].tolist(), strict=True)
    contributions = dict(sorted(contributed, key=lambda entry: -entry[1]))
    length, width, height = room["sides"].tolist()
    return RoomLevel(
        frequency=frequency,
        **bands,
        octave_level=answer["room_octaves"]["level_dB"],
        path_shares=np.stack(shares, axis=-1),
        mass_per_area=room["surface_mass"],
        volume=room["volume"],
        size=(length, width, height),
        n_modal=int(room["n_modal"]),
        ratings={
            name: PredictedRating(name, float(level), summary["uncertainty"], contributions)
            for name, level in zip(RATINGS, summary["level"], strict=True)
        },
        probability=summary.get("probability", np.nan),
        verdict=summary.get("verdict", ""),
        floor_notes=notes(answer.get("room_warnings", {})),
    )


def _fields(case: Case, answer: Bundle, prefix: str = "") -> dict[str, Any]:
    """Return fields of `Impact` from groups of the library, whose names begin with a prefix."""
    columns = without_units(answer[f"{prefix}force"])
    names = list(columns)
    histories = answer.get(f"{prefix}model_histories", {})
    snapshots = answer.get(f"{prefix}snapshots")
    summary = answer[f"{prefix}summary"]
    return {
        "case": case,
        **{name: columns[name] for name in _COLUMNS},
        "components": {
            name: columns[name] for name in names[_N_MOTION : names.index("elastic_force")]
        },
        "model_histories": {name: values for name, values in histories.items() if name != "time_s"},
        "model_quantities": dict(answer.get(f"{prefix}model_quantities", {})),
        "motion": new_motion(without_units(snapshots)) if snapshots else None,
        # Files have no unknown errors.
        **{
            name: summary.get(name, math.nan) if name.endswith("_error") else summary[name]
            for name in IMPACT_QUANTITIES
        },
    }
