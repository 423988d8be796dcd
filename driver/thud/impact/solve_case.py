"""Computation of a drop by keywords."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import TYPE_CHECKING

from thud.base._schema import Ball, Drop, Sampling
from thud.base.checks import refuse
from thud.base.errors import PlausibilityWarning
from thud.case.case import Case, new_model
from thud.case.constructions import with_floor
from thud.impact.compute import compute

if TYPE_CHECKING:
    from thud.base._schema import FloorOptions, ModelName, ModelOptions, Room
    from thud.case.constructions import Construction
    from thud.impact.impact import Impact


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
        without any other argument but `verify`.
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
        Compute again at a finer resolution, for `Impact.finer`; also with a case.
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
        if settings or options or any(value is not None for value in (drop, model, floor, room)):
            refuse("solve() has other arguments in addition to a case", "solve(case)")
        case = ball
        if verify:
            case = replace(case, sampling=replace(case.sampling, verify=True))
    else:
        case = Case(
            ball=Ball() if ball is None else ball,
            drop=Drop() if drop is None else drop,
            model=new_model(model, options),
            sampling=Sampling(**settings, verify=verify),  # type: ignore[arg-type]
            room=room,
        )
        case = with_floor(case, floor)
    impact = compute(case)
    for note in impact.notes:
        warnings.warn(PlausibilityWarning(note), stacklevel=2)
    return impact
