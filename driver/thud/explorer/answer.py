"""What the page shows of a case or of a recording, as plain data."""

from __future__ import annotations

import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from thud._schema import FLOORS, KEYS, MODELS
from thud.case import Case
from thud.checks import refuse, require_choice, require_words, shown
from thud.errors import ThudError
from thud.floors.prediction import predict_level
from thud.impact import Impact, compute
from thud.levels import get_bands
from thud.recordings.read_recording import read_recording

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import NDArray

    from thud.criteria import Criterion
    from thud.recordings.recording import Recording
    from thud.recordings.verdict import Decision

    Answer = dict[str, Any]

# Points of a curve on the page, and snapshots of an animation.
MAX_POINTS = 600
MAX_SNAPSHOTS = 60
# Samples of a record that the page asks for.
MAX_SAMPLES = 200_000
# Part of the contact that is shown after it.
MARGIN = 1.15


def new_case(values: Mapping[str, Mapping[str, object]]) -> Case:
    """Return the case of groups of values, as the page has them.

    Raise InputError, or TypeError and ValueError where values are of other types.
    """
    require_words("the case", values, known_groups())
    for part, known in (("model", MODELS), ("floor", FLOORS)):
        if part in values:
            require_choice(f"&{part}: name", values[part].get("name"), list(known))
    return Case.from_namelist(
        {
            group: {key: _listed(value) for key, value in keys.items()}
            for group, keys in values.items()
        }
    )


def known_groups() -> set[str]:
    """Return the names of the groups that a case may have."""
    return {key.group for key in KEYS} | {"model", "floor"}


def _listed(value: object) -> object:
    return tuple(value) if isinstance(value, list) else value


def answer_case(case: Case) -> Answer:
    """Return force, levels, verdict, remarks and, where asked for, motion, floor and room."""
    start = time.perf_counter()
    samples = case.sampling.sample_rate * case.sampling.duration
    if samples > MAX_SAMPLES:
        refuse(f"&sampling: {samples:g} samples are too many for the page", f"up to {MAX_SAMPLES}")
    impact = compute(case)
    found = _answer(impact, impact.time, impact.force(), impact.peak())
    found["remarks"] += impact.remarks
    found["motion"] = _motion(impact)
    if case.room is not None and case.floor is not None:
        found["room"] = _room(impact)
        further = found["room"].pop("remarks")
        found["remarks"] += [remark for remark in further if remark not in found["remarks"]]
    found["seconds"] = time.perf_counter() - start
    return found


def answer_recording(name: str, content: bytes, settings: Mapping[str, Any]) -> Answer:
    """Return the same of a recording.

    Parameters
    ----------
    name
        Name of the file, whose ending says the format.
    content
        Its bytes.
    settings
        Arguments of `read_recording`.
    """
    start = time.perf_counter()
    with TemporaryDirectory() as folder:
        ending = "".join(c for c in Path(name).suffix if c.isalnum())[:8]
        path = Path(folder, f"recording.{ending}")
        path.write_bytes(content)
        try:
            recording = read_recording(path, **settings)
            found = _answer(recording, *recording.to_force_history(), recording.peak())
        except ThudError as error:
            # The user knows neither the copy nor its place.
            sentence = str(error).replace(f"{folder}/", "").replace(path.name, shown(name))
            raise type(error)(sentence) from error
    found["seconds"] = time.perf_counter() - start
    found["drops"] = len(recording.drops)
    return found


def _answer(
    source: Impact | Recording, times: NDArray[np.float64], force: NDArray[np.float64], peak: float
) -> Answer:
    """Return what cases and recordings share."""
    shown = times <= times[0] + MARGIN * source.contact_time
    step = max(1, -(-int(shown.sum()) // MAX_POINTS))
    verdict = source.conformity()
    return {
        "force": {
            "time": _plain(1e3 * times[shown][::step]),
            "force": _plain(force[shown][::step]),
        },
        "levels": {
            bands: {
                "frequency": _plain(get_bands(bands).nominal),
                "level": _plain(source.levels(bands)),
            }
            for bands in ("octave", "third")
        },
        "criteria": [_criterion(one) for one in verdict.criteria],
        "conforms": bool(verdict.conforms),
        "verdict": verdict.verdict,
        "numbers": {
            "contact time, ms": 1e3 * source.contact_time,
            "peak force, N": float(peak),
            "restitution": float(source.restitution),
        },
        "remarks": [],
    }


def _criterion(one: Criterion | Decision) -> Answer:
    """Return a criterion; times are in ms, as on the screen."""
    scale, unit = (1e3, "ms") if one.unit == "s" else (1.0, one.unit)
    return {
        "name": one.name,
        "unit": unit,
        "value": None if np.isnan(one.value) else round(scale * one.value, 6),
        "lower": round(scale * one.lower, 6),
        "upper": round(scale * one.upper, 6),
        "conforms": bool(one.conforms),
    }


def _motion(impact: Impact) -> Answer | None:
    """Return the outer and inner surface against time, mm; of models without snapshots None."""
    until = impact.touch_time + MARGIN * impact.contact_time
    if impact.motion is None:
        shown = impact.time <= until
        return {
            "time": _plain(1e3 * impact.time[shown]),
            "deflection": _plain(1e3 * impact.deflection[shown]),
            "radius": 1e3 * impact.case.ball.outer_radius,
            "wall": 1e3 * impact.case.ball.wall_thickness,
        }
    motion = impact.motion
    last = max(1, int(np.searchsorted(motion.time, until)))
    chosen = np.unique(np.linspace(0, last - 1, min(last, MAX_SNAPSHOTS)).astype(int))
    return {
        "time": _plain(1e3 * motion.time[chosen]),
        "outer": [_rounded(line) for line in 1e3 * motion.position[chosen][:, :, -1]],
        "inner": [_rounded(line) for line in 1e3 * motion.position[chosen][:, :, 0]],
    }


def _room(impact: Impact) -> Answer:
    """Return the levels in the room below."""
    found = predict_level(impact)
    return {
        "frequency": _plain(found.frequency),
        "level": _plain(found.level),
        "rating": found.rating.rounded,
        "standardised": found.standardised_rating.rounded,
        "remarks": list(found.remarks),
    }


def _plain(values: Iterable[float]) -> list[float | None]:
    """Return numbers for JSON, which has no NaN and no infinity."""
    return [float(value) if np.isfinite(value) else None for value in values]


def _rounded(points: NDArray[np.float64]) -> list[list[float]]:
    return [[round(float(x), 2) for x in point] for point in points]
