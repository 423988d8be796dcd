"""What the page shows of a case or of a recording, as plain data."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base.checks import refuse, shown
from thud.base.errors import ThudError
from thud.case.case import tables_case
from thud.case.keys import humanize
from thud.floors.prediction import predict_level
from thud.impact.compute import compute
from thud.impact.ensemble import get_cost
from thud.impact.floor_impact import FloorImpact
from thud.level.levels import get_bands
from thud.plot.impacts import contact_force
from thud.plot.style import FORCE_WORDS
from thud.recordings.read_recording import read_recording

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import NDArray

    from thud.case.case import Case
    from thud.impact.impact import Impact
    from thud.level.assessment import Criterion
    from thud.level.impact_result import ImpactResult

    Answer = dict[str, Any]

# Points of a curve on the page, and instants of an animation.
MAX_POINTS = 400
MAX_INSTANTS = 60
# Samples of a record that the page asks for.
MAX_SAMPLES = 200_000
# Estimated time above which a case is computed only when the sliders rest, s.
QUICK = 0.1
# Part of the contact that is shown after it.
MARGIN = 1.05
# Significant digits of curves.
DIGITS = 6


def new_case(values: Mapping[str, Mapping[str, object]]) -> Case:
    """Return the case of groups of values, as the page has them.

    Raise InputError, or TypeError and ValueError where values are of other types.
    """
    case = tables_case(values)
    samples = case.sampling.sample_rate * case.sampling.duration
    if samples > MAX_SAMPLES:
        refuse(f"&sampling: {samples:g} samples are too many for the page", f"up to {MAX_SAMPLES}")
    return case


def answer_quickly(case: Case) -> Answer | None:
    """Return the answer of a case that is computed while a slider moves; None of another.

    Raise InputError if it is invalid.
    """
    return answer_case(case) if get_cost(case, ()) <= QUICK else None


def answer_case(case: Case) -> Answer:
    """Return force, levels, verdict, warnings and, where there are, motion, floor and room."""
    start = time.perf_counter()
    impact = compute(case)
    force = case.levels.force
    found = _answer(impact, *contact_force(impact, force), impact.peak())
    found["force"]["words"] = FORCE_WORDS[force]
    found["warnings"] += impact.warnings
    moving = impact.on_floor
    found["motion"] = _motion(moving or impact)
    found["floor"] = None if moving is None else _floor(impact, moving)
    if case.room is not None and case.floor is not None:
        found["room"] = _room(impact)
        further = found["room"].pop("warnings")
        found["warnings"] += [warning for warning in further if warning not in found["warnings"]]
    found["seconds"] = time.perf_counter() - start
    return found


def answer_recording(path: str, name: str, settings: Mapping[str, Any]) -> Answer:
    """Return the same of a recording.

    Parameters
    ----------
    path
        Path of a copy of the file.
    name
        Its name, as the user knows it.
    settings
        Arguments of `read_recording`.
    """
    start = time.perf_counter()
    try:
        recording = read_recording(path, **settings)
        drop = recording.drop_force()
        times, force = drop.time, drop.force
        kept = (times >= 0) & (times <= MARGIN * recording.contact_time)
        curve = 1e3 * times[kept], 1e-3 * force[kept]
        found = _answer(recording, *curve, recording.peak())
    except ThudError as error:
        # The user knows neither the copy nor its place.
        raise type(error)(str(error).replace(path, shown(name))) from error
    found["seconds"] = time.perf_counter() - start
    found["drops"] = len(recording.drops)
    copy = Path(path).name
    # The page says whose the warnings are.
    found["warnings"] += [
        warning.removeprefix(f"{copy}: ").replace(copy, name) for warning in recording.warnings
    ]
    return found


def _answer(
    source: ImpactResult, times: NDArray[np.float64], force: NDArray[np.float64], peak: float
) -> Answer:
    """Return what cases and recordings share; times in ms, the force in kN."""
    verdict = source.assess()
    return {
        "force": _curve(times, 1e3 * force),
        "levels": {
            "frequency": _plain(get_bands().nominal),
            "level": _plain(source.levels()),
        },
        "criteria": [_criterion(one) for one in verdict.criteria],
        "conforms": bool(verdict.conforms),
        "verdict": verdict.result,
        "numbers": [
            ["peak", float(peak), "N"],
            ["contact", 1e3 * source.contact_time, "ms"],
            ["restitution", *_plain([source.restitution]), ""],
        ],
        "warnings": [],
    }


def _criterion(one: Criterion) -> Answer:
    """Return a criterion; times are in ms, as on the screen."""
    scale, unit = (1e3, "ms") if one.unit == "s" else (1.0, one.unit)
    name, band = one.name.rpartition("octave_")[1:]
    expanded = scale * one.estimate.expanded
    return {
        "name": f"{band.replace('_', '.')} Hz" if name else humanize(band),
        "band": bool(name),
        "unit": unit,
        "value": None if np.isnan(one.value) else round(scale * one.value, 6),
        "uncertainty": expanded if 0 < expanded < np.inf else None,
        "lower": round(scale * one.lower, 6),
        "upper": round(scale * one.upper, 6),
        "verdict": one.result,
    }


def _motion(impact: Impact) -> Answer | None:
    """Return the surfaces of the ball over the floor, and the floor, against time, mm and ms.

    None of models that have no shape. The shell of the paper is a sphere that its deflection
    flattens.
    """
    until = impact.touch_time + MARGIN * impact.contact_time
    motion = impact.motion
    if motion is None and "shell_force" not in impact.parts:
        return None
    times = impact.time if motion is None else motion.time
    chosen = _some(np.flatnonzero(times <= until), MAX_INSTANTS)
    found: Answer = {"time": _plain(1e3 * (times[chosen] - impact.touch_time))}
    if motion is not None:
        depth = motion.floor_displacement[chosen]
        over = motion.position[chosen] + np.stack([0 * depth, depth], -1)[:, None, None]
        found["outer"], found["inner"] = (
            [[[round(float(x), 2) for x in point] for point in line] for line in 1e3 * surface]
            for surface in (over[:, :, -1], over[:, :, 0])
        )
    else:
        moving = impact.floor_displacement if isinstance(impact, FloorImpact) else 0 * impact.time
        depth = moving[chosen]
        ball = impact.case.ball
        found["deflection"] = _plain(1e3 * impact.deflection[chosen])
        found |= {"radius": 1e3 * ball.outer_radius, "wall": 1e3 * ball.wall_thickness}
    found["floor"] = _plain(1e3 * depth)
    return found


def _floor(impact: Impact, moving: FloorImpact) -> Answer:
    """Return force and velocity on a floor that moves, and what it changes in octaves."""
    shown = np.flatnonzero(moving.time <= moving.touch_time + 2 * moving.contact_time)
    times = 1e3 * (moving.time - moving.touch_time)
    contact = contact_force(moving, "floor")
    head, *rows = moving.rows()
    return {
        "name": humanize(moving.floor.name),
        "force": _curve(contact[0], 1e3 * contact[1]),
        "velocity": _curve(times[shown], 1e3 * moving.floor_velocity[shown]),
        "numbers": [
            [
                "peak force relative to rigid floor",
                20 * np.log10(moving.peak_force / impact.peak_force),
                "dB",
            ],
            ["restitution", moving.restitution, ""],
            ["maximum displacement", 1e3 * moving.floor_displacement.max(), "mm"],
            ["energy into the floor", moving.floor_work, "J"],
        ],
        "head": head,
        "rows": rows,
    }


def _room(impact: Impact) -> Answer:
    """Return the levels in the room below."""
    found = predict_level(impact)
    return {
        "frequency": _plain(found.frequency),
        "level": _plain(found.level),
        "rating": found.rating.rounded,
        "standardised": found.standardised_rating.rounded,
        "warnings": list(found.warnings),
    }


def _curve(times: NDArray[np.float64], values: NDArray[np.float64]) -> Answer:
    """Return some points of a curve, the last among them."""
    chosen = _some(np.arange(len(times)), MAX_POINTS)
    return {"time": _plain(times[chosen]), "value": _plain(values[chosen])}


def _some(places: NDArray[np.intp], count: int) -> NDArray[np.intp]:
    """Return at most so many of some places, evenly, the first and the last among them."""
    even = np.linspace(0, len(places) - 1, min(len(places), count)).astype(int)
    found: NDArray[np.intp] = places[np.unique(even)]
    return found


def _plain(values: Iterable[float]) -> list[float | None]:
    """Return numbers for JSON, which has no NaN and no infinity."""
    return [float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None for value in values]
