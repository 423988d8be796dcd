"""Types of arguments: NumPy's scalars are numbers, and wrong types are refused in one line."""

from __future__ import annotations

import inspect
from decimal import Decimal
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import thud
from thud.base.key import Group
from thud.recordings.calibration import calibrate
from thud.recordings.config import Config, Instrument, Properties, ReportConfig

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

GROUPS = [
    kind
    for kind in map(thud.__getattr__, thud.__all__)
    if inspect.isclass(kind) and issubclass(kind, Group)
]
WRONG: list[Any] = [
    object(), {1: 2}, [[1, 2], [3]], 1j, b"x", float("nan"), "no such word", np.array([1.0, 2.0]),
]  # fmt: skip


def same(value: object) -> list[Any]:
    """Return what NumPy has for a value."""
    if isinstance(value, bool):
        return [np.bool_(value)]
    if isinstance(value, int):
        return [np.int32(value), np.int64(value), np.uint8(value % 256)][: 3 if value < 256 else 2]
    if isinstance(value, float):
        return [np.float64(value), np.float32(value)]
    return [np.str_(value)] if isinstance(value, str) else []


def refused(function: Callable[..., object], **words: object) -> None:
    """Call a function, which may raise an error of one line only."""
    try:
        function(**words)
    except (thud.ThudError, TypeError) as error:
        assert "\n" not in str(error)


def calls(folder: Path) -> list[tuple[Callable[..., Any], dict[str, Any]]]:
    """Return public functions with valid arguments."""
    impact = thud.solve(model="hollow_sphere")
    on_floor = thud.solve(thud.Case(floor=thud.Plate(), room=thud.Room()))
    steps = np.r_[np.zeros(5000), np.full(5000, 2.0), np.zeros(5000)]
    steps += np.random.default_rng(1).normal(0, 1e-3, 15000)
    record = folder / "steps.csv"
    np.savetxt(record, np.c_[np.arange(15000) / 1e3, steps], header="s,V", delimiter=",")
    columns = {"force": impact.force(), "sample_rate": impact.sample_rate}
    return [
        (calibrate, {"record": record, "force": 100.0, "channel": 2, "unit": "V"}),
        (thud.force_exposure_levels, columns),
        (thud.standardized_level, {"level": [50.0], "reverberation_time": [0.5], "volume": 50.0}),
        (thud.blocked_force, {"source": impact, "drop": 1}),
        (thud.listen, {"predictions": thud.predict_level(on_floor)}),
        (thud.modal_room, {"prediction": thud.predict_level(on_floor), "max_frequency": 60.0}),
        (thud.compress, {"points": 5}),
        (thud.assess_levels, {"levels": impact.levels().tolist(), "mass": 2.5, "peaks": 1}),
        (thud.solve_many, {"parameters": {"height": [1.0]}}),
        (thud.fit, {"target": impact, "parameters": ["height"], "max_steps": 1, "unknowns": ()}),
        (thud.predict_level, {"source": on_floor}),
        *((kind, {}) for kind in (Config, Instrument, Properties, ReportConfig)),
    ]


@pytest.mark.filterwarnings("ignore::thud.FitWarning")
def test_functions_take_numbers_of_numpy_and_refuse_wrong_types(tmp_path: Path) -> None:
    for function, words in calls(tmp_path):
        for name, entry in inspect.signature(function).parameters.items():
            value = words.get(name, entry.default)
            for equal in same(value):
                function(**{**words, name: equal})
            if isinstance(value, int | float | str) and not isinstance(value, bool):
                for wrong in WRONG:
                    refused(function, **{**words, name: wrong})


@pytest.mark.parametrize("kind", GROUPS, ids=lambda kind: kind.__name__)
def test_groups_take_numbers_of_numpy_and_refuse_wrong_types(kind: type[Group]) -> None:
    default = kind()
    for name, value in vars(default).items():
        for equal in same(value):
            assert kind(**{name: equal}) == kind(**{name: equal.item()})
        for wrong in WRONG:
            refused(lambda name=name, wrong=wrong: repr(kind(**{name: wrong})))
        if name in kind.keys and isinstance(value, int | float):
            # Equal to the default, but not of its type.
            with pytest.raises(TypeError):
                kind(**{name: Decimal(value)})
