"""Arrays of a caller that change after a call: what it returned stays as it was, bit by bit."""

from __future__ import annotations

import pickle
from contextlib import suppress
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from campaign import Finding
from public_calls import PLATE, ROOM, quiet

import thud
from thud.recordings.signal import Signal

if TYPE_CHECKING:
    import random
    from collections.abc import Callable, Iterable
    from pathlib import Path


class Call(NamedTuple):
    """A public call: the arrays that it is given, as lists, and what it returns for them."""

    arrays: list[Any]
    make: Callable[..., object]


@cache
def calls() -> dict[str, Call]:
    """Return calls that take arrays, by name."""
    impact = thud.solve()
    light = thud.solve(floor=thud.InfinitePlate(1600.0))
    pressed = thud.compress(model="modal_ball", points=9)
    record = np.pad(impact.floor_force, 4000)
    record += np.random.default_rng(1).normal(scale=0.5, size=record.size)
    bands = [63.0, 125.0, 250.0, 500.0]
    levels = [65.0, 64.0, 58.0, 56.0]
    modes = [60.0, 110.0], [0.05, 0.05], [1.5, 1.0]
    return {
        "case": Call([*modes], lambda *given: thud.Case(model=thud.MeasuredModes(*given))),
        "solve": Call([*modes], lambda *given: thud.solve(model=thud.MeasuredModes(*given))),
        "points of a floor": Call(
            [[1.0, 2.0], [0.5, 1.5]],
            lambda x, y: thud.solve(floor=thud.Plate(point_x=x, point_y=y)),
        ),
        "solve_many": Call([[0.9, 1.0, 1.1]], lambda height: thud.solve_many({"height": height})),
        "force_exposure_levels": Call(
            [impact.floor_force], lambda force: thud.force_exposure_levels(force, 44100.0)
        ),
        "rating": Call([levels], thud.rating),
        "standardized_level": Call([levels], lambda x: thud.standardized_level(x, 0.6, 40.0)),
        "room levels": Call(
            [bands, [levels, levels], [30.0] * 4, [0.5] * 4],
            lambda *given: thud.RoomLevels("room", "octave", *given, 40.0),
        ),
        "ball_impedance": Call([[1e4, 1e5]], lambda floors: thud.ball_impedance(light, floors)),
        "mobility": Call([[25.0, 100.0]], lambda frequency: thud.mobility(PLATE, frequency).values),
        "fit_mobility": Call(
            [[20.0, 30.0, 40.0, 50.0], [1e-5, 2e-5, 2e-5, 1e-5]],
            lambda *table: thud.fit_mobility(thud.Mobility(*table), order=1),
        ),
        "modal_room": Call(
            [[[1.0, 1.5]], [[1.0, 1.0, 1.0], [2.0, 1.0, 1.2]]],
            lambda balls, microphones: thud.modal_room(
                thud.predict_level(impact, PLATE, ROOM), balls=balls, microphones=microphones
            ),
        ),
        "press": Call([pressed.deflection, pressed.force], thud.CompressionTarget),
        "recording": Call(
            [record],
            lambda force: thud.read_recording(
                Signal.from_array(force, 44100.0), height=1.0, mass=2.5
            ),
        ),
        "fit": Call([levels], lambda target: thud.LevelTarget(target, 1.0, frequencies=bands)),
        "force target": Call(
            [impact.time, impact.floor_force], lambda *given: thud.ForceTarget(given)
        ),
        "parameter": Call([levels], lambda values: thud.Parameter(values=values)),
    }


def check_aliasing(tries: list[tuple[int, random.Random]], _: Path) -> Iterable[Finding]:
    """Change the arrays of a call, and those that its result hands out."""
    quiet()
    for _number, chance in tries:
        name = chance.choice(list(calls()))
        arrays = [np.array(values, dtype=np.float64) for values in calls()[name].arrays]
        result = calls()[name].make(*arrays)
        handed = list(getattr(result, "__dict__", {}).values())
        if callable(levels := getattr(result, "levels", None)):
            handed.append(levels())
        before = pickle.dumps(result)
        for array in (*arrays, *handed):
            with suppress(TypeError, ValueError):  # no numbers, or read-only
                if isinstance(array, np.ndarray):
                    _change(array, chance)
        yield Finding(name if pickle.dumps(result) == before else "wrong", f"{name} has changed")


def _change(array: np.ndarray[Any, Any], chance: random.Random) -> None:
    """Change all values of an array, or one."""
    if chance.random() < 0.5:
        array *= chance.choice([1.1, 0.0, np.nan])
    else:
        array.flat[chance.randrange(array.size)] += 1.0
