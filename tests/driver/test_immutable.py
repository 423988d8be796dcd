"""Every public type: its arrays do not change; inputs are compared by value."""

from __future__ import annotations

import dataclasses
import inspect
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from conftest import recorded
from test_display import RESULTS, impact, made, press

import thud
from thud.base import immutable

if TYPE_CHECKING:
    from collections.abc import Iterator


def walk(value: object, path: str, seen: dict[int, object]) -> Iterator[tuple[str, object]]:
    """Return the places and values of all that an object holds, but for what is private."""
    if id(value) in seen:
        return
    seen[id(value)] = value
    yield path, value
    if isinstance(value, dict):
        parts = {f"[{key!r}]": entry for key, entry in value.items()}
    elif isinstance(value, list | tuple):
        parts = {f"[{i}]": entry for i, entry in enumerate(value)}
    elif type(value).__module__.startswith("thud") and not inspect.isclass(value):
        held = getattr(value, "__dict__", {})
        parts = {f".{name}": one for name, one in held.items() if not name.startswith("_")}
    else:
        return
    for name, part in parts.items():
        yield from walk(part, path + name, seen)


@pytest.fixture(scope="module")
def held() -> dict[str, object]:
    """Return all that results and inputs hold, by place."""
    mesh: dict[str, Any] = {"radial_elements": 2, "polar_elements": 16}
    moving = thud.solve(model="finite_element", snapshot_interval=1e-3, **mesh)
    inputs = [
        moving, thud.construction("concrete 180"), thud.read_study({"height": [0.5, 1.0]}),
        thud.JoistFloor(), thud.LaminateFloor(), thud.ModalFloor(), thud.Oscillator(), thud.Rigid(),
        thud.MeasuredModes(frequency=[30.0]), thud.Modes(), thud.TwoMass(),
        thud.CompressionTarget(press().deflection, press().force), thud.ForceTarget(impact()),
        thud.LevelTarget([39.0, 31.0, 23.0, 17.0, 12.0]),
        thud.Unknowns(key=["mass"], low=[2.4], high=[2.6], reason=["not weighed"]),
    ]  # fmt: skip
    return dict(walk([*map(made, RESULTS), *inputs], "", {}))


@pytest.fixture(scope="module")
def examples(held: dict[str, object]) -> dict[type, Any]:
    """Return an object of each public type that is no mere base of others."""
    public = [getattr(thud, name) for name in thud.__all__]
    return {
        kind: next(one for one in held.values() if isinstance(one, kind))
        for kind in public
        if inspect.isclass(kind) and dataclasses.is_dataclass(kind)
        if kind is not thud.RectangularFloor
    }


def test_no_array_of_a_public_object_is_writeable(held: dict[str, object]) -> None:
    arrays = {place: one for place, one in held.items() if isinstance(one, np.ndarray)}
    assert len(arrays) > 100
    assert [place for place, one in arrays.items() if one.flags.writeable] == []


def test_what_is_handed_out_changes_nothing(held: dict[str, object]) -> None:
    for place, one in held.items():
        if not isinstance(one, immutable.Immutable):
            continue
        arrays = [part for _, part in walk(one, "", {}) if isinstance(part, np.ndarray)]
        for name, member in inspect.getmembers(type(one)):
            maker = getattr(member, "fget", None) or getattr(member, "func", member)
            if name.startswith("_") or not inspect.isfunction(maker):
                continue
            wanted = list(inspect.signature(maker).parameters.values())[1:]
            made = str(maker.__annotations__.get("return", ""))
            if "NDArray" not in made or any(p.default is p.empty for p in wanted):
                continue
            try:
                first, second = (getattr(one, name) for _ in range(2))
                if callable(first):
                    first, second = first(), second()
            except (AttributeError, thud.InputError):  # this model has no such thing
                continue
            for array in [part for _, part in walk(first, "", {}) if isinstance(part, np.ndarray)]:
                others = [part for _, part in walk(second, "", {}) if isinstance(part, np.ndarray)]
                shared = any(np.shares_memory(array, other) for other in [*arrays, *others])
                assert not (shared and array.flags.writeable), (place, name)


def test_no_public_object_shares_memory_with_its_caller(examples: dict[type, Any]) -> None:
    checked = 0
    for kind, one in examples.items():
        arrays = {
            field.name: getattr(one, field.name).copy()
            for field in dataclasses.fields(one)
            if field.init and isinstance(getattr(one, field.name), np.ndarray)
        }
        other = dataclasses.replace(one, **arrays)
        for name, array in arrays.items():
            checked += 1
            assert array.flags.writeable, (kind, name)
            assert not np.shares_memory(array, getattr(other, name)), (kind, name)
    assert checked > 50


def test_case_says_the_modes_that_were_computed() -> None:
    others = {"damping_ratio": (0.05, 0.05), "effective_mass": (1.5, 1.0)}
    frequency = np.array([60.0, 110.0])
    model = thud.MeasuredModes(frequency=frequency, **others)
    impact = thud.solve(model=model)
    frequency *= 1.1
    assert impact.case.model == thud.MeasuredModes(frequency=[60.0, 110.0], **others)
    assert (thud.solve(impact.case).floor_force == impact.floor_force).all()
    assert hash(model) == hash(thud.MeasuredModes(frequency=(60, 110), **others))


def test_arrays_of_results_are_copied_once() -> None:
    many = thud.solve_many({"height": [0.5, 1.0]}, forces=True)
    assert many.elastic_force.base is many.floor_force.base
    other = dataclasses.replace(many)
    assert other.floor_force is many.floor_force
    assert dataclasses.replace(many, floor_force=many.floor_force[:, 1:]).floor_force.base is (
        many.floor_force.base
    )


def test_changed_levels_change_no_verdict() -> None:
    recording = recorded(thud.solve(), height=1.0, mass=2.5)
    before = repr(recording.assess())
    levels = recording.levels()
    levels -= 1
    drop = recording.drops[0].force
    force = thud.blocked_force(recording).force
    for array in (recording.average().level, drop, force):
        with pytest.raises(ValueError, match="read-only"):
            np.subtract(array, 1, out=array)
    assert repr(recording.assess()) == before


def test_changed_dataset_changes_no_impact() -> None:
    impact = thud.solve()
    before = impact.floor_force.copy()
    impact.to_xarray()["floor_force"].values[:] = 0.0
    assert (impact.floor_force == before).all()
