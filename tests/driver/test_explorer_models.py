"""What the page says of models, floors and keys, its errors and its headlines."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

import thud
from thud.base._schema import FLOORS, GROUPS, KEYS, MODELS, RATINGS
from thud.base.immutable import plain
from thud.explorer.answer import answer_case, new_case
from thud.explorer.form import form
from thud.explorer.messages import describe_error
from thud.explorer.models import FLOOR_FACTS, MODEL_FACTS, SHOWN, floor_facts, model_facts, users_of
from thud.floors.description import CONTRIBUTIONS
from thud.impact.compute import compute

FIELDS = {(field["group"], field["name"]): field for group in form() for field in group["fields"]}
# Values of keys that all models have, other than the defaults and allowed for all of them.
OTHERS: dict[str, dict[str, Any]] = {
    "ball": {
        "outer_radius": 0.09, "wall_thickness": 0.031, "mass": 7.2, "youngs_modulus": 1.9e6,
        "poisson_ratio": 0.47, "gauge_pressure": 2000.0, "ambient_pressure": 9e4,
        "heat_capacity_ratio": 1.3,
    },
    "drop": {"height": 0.9, "gravity": 9.7},
    "sampling": {"sample_rate": 48000.0, "substeps": 8},
}  # fmt: skip


def values_of(name: str) -> dict[str, Any]:
    """Return the values with which the page begins with a model."""
    values = next(facts["values"] for facts in model_facts() if facts["name"] == name)
    return {"model": {"name": name}, **values}  # type: ignore[dict-item]


def error_of(values: dict[str, Any]) -> dict[str, Any]:
    """Return what the page shows of the error of a case."""
    with pytest.raises(thud.ThudError) as caught:
        compute(new_case(values))
    return describe_error(caught.value)


@pytest.mark.parametrize("name", MODELS)
def test_every_model_begins_with_values_that_compute(name: str) -> None:
    answer = answer_case(new_case(values_of(name)))
    assert answer["warnings"] == []
    json.dumps(answer, allow_nan=False)


@pytest.mark.parametrize("name", FLOORS)
def test_every_floor_begins_with_values_that_compute(name: str) -> None:
    (facts,) = (facts for facts in floor_facts() if facts["name"] == name)
    case = {"model": {"name": "hollow_sphere"}, "floor": {"name": name}, **facts["values"]}  # type: ignore[dict-item]
    answer = answer_case(new_case(case))
    assert (answer["floor"] is None) == (name == "rigid")
    json.dumps(answer, allow_nan=False)
    # Those that radiate have a room.
    room = {**case, "room": {"volume": 50.0}}
    if facts["has_room"]:
        assert answer_case(new_case(room))["room"]["result"] == "level"
    else:
        assert "has no plate" in error_of(room)["error"]


def test_facts_name_models_floors_and_keys_of_the_library() -> None:
    assert MODEL_FACTS.keys() == MODELS.keys()
    assert FLOOR_FACTS.keys() == FLOORS.keys()
    keys = {(key.owner or key.group, key.name) for key in KEYS}
    shown = {(owner, name) for owner, names in SHOWN.items() for name in names}
    assert shown <= keys


@pytest.mark.parametrize("model", MODELS)
def test_keys_that_a_model_ignores_have_no_effect(model: str) -> None:
    base = values_of(model)
    if model == "finite_element":
        base["mesh"] = {"radial_elements": 4, "polar_elements": 32}
    expected = compute(new_case(base)).floor_force
    for group, others in OTHERS.items():
        for name, value in others.items():
            (key,) = (
                key for key in KEYS if not key.owner and (key.group, key.name) == (group, name)
            )
            users = users_of(key)
            is_used = users is None or model in users
            changed: dict[str, Any] = {**base, group: {**base.get(group, {}), name: value}}
            if model == "measured_modes":
                changed[model] = {**base[model], "allow_mass_mismatch": True}
            if name == "gauge_pressure" and model == "finite_element":
                assert not is_used
                assert error_of(changed)["field"] == "ball.gauge_pressure"
                continue
            force = compute(new_case(changed)).floor_force
            is_equal = len(force) == len(expected) and np.allclose(force, expected, 1e-12, 0)
            # The mass of measured modes is assessed, not computed with.
            if (model, name) != ("measured_modes", "mass"):
                assert is_equal != is_used, name


# Values that switch other keys on.
SWITCHES: dict[str, Any] = {
    "screed_thickness": 0.05, "subceiling_thickness": 0.0125, "covering_stiffness": 1e7,
    "support": "elastic", "ceiling_mass": 10.0, "wall_lengths": (4.0,), "wall_junction": "index",
}  # fmt: skip


@pytest.mark.parametrize("kind", [thud.Plate, thud.LaminateFloor, thud.JoistFloor, thud.Room])
def test_keys_of_floor_and_room_have_an_effect_only_with_their_switch(kind: type[Any]) -> None:
    impact = thud.solve(model="hollow_sphere")

    def result(values: dict[str, Any]) -> list[float]:
        if kind is thud.Room:
            return list(thud.predict_level(impact, thud.Plate(), kind(**values)).level)
        # A small floor has few modes.
        floor = kind(length=2.5, width=2.0, **values)
        return list(thud.mobility(floor, [20.0, 50.0, 100.0]).values)

    off: dict[str, Any] = {}
    before: dict[str, list[float]] = {}
    for key in (key for key in kind.keys.values() if key.needs):
        (switch, *_), default = key.needs, np.asarray(getattr(kind(), key.name) or [1e6])
        on = {switch: SWITCHES[switch]}
        if switch in {"wall_junction", "support"}:
            on |= {"wall_lengths": (4.0,)} if kind is thud.Room else {"support_stiffness": 1e7}
        value = plain(0.9 * default) if key.kind != "choice" else key.choices[1]
        if switch != "support":
            off[key.name] = value
        assert not key.has_effect(kind())
        assert key.has_effect(kind(**on))
        expected = before.setdefault(str(on), result(on))
        assert result(on | {key.name: value}) != expected, key.name
    assert result(off) == result({})


def test_keys_of_conditions_have_no_effect_without_their_choice() -> None:
    for key in (key for key in KEYS if key.needs and key.owner in MODELS):
        owner, (other, *choices) = key.owner, key.needs
        (switch,) = (entry for entry in KEYS if entry.owner == owner and entry.name == other)
        assert set(choices) <= set(switch.choices)
        assert FIELDS[key.group, key.name]["condition"] == key.needs
        value: Any = 91.0 if key.name == "loss_frequency" else 0.37
        value = [0.2] if key.kind == "list" else value
        for choice in switch.choices:
            base: dict[str, Any] = {"model": {"name": owner}, switch.group: {other: choice}}
            if choice == "prony":
                base[switch.group] |= {"prony_share": [0.1], "prony_time": [0.01]}
            if owner == "finite_element":
                base["mesh"] = {"radial_elements": 4, "polar_elements": 32}
            changed = {**base, key.group: {**base.get(key.group, {}), key.name: value}}
            if key.name.startswith("prony_") and choice not in choices:
                assert "do nothing" in error_of(changed)["error"]
                continue
            forces = [compute(new_case(case)).floor_force for case in (base, changed)]
            assert np.array_equal(*forces) != (choice in choices), (owner, key.name, choice)


SLAB: dict[str, Any] = {
    "model": {"name": "modal_ball"}, "floor": {"name": "plate"}, "room": {},
    "plate": vars(thud.construction("concrete 180").floor),
}  # fmt: skip


def test_headline_of_a_room_is_the_level_with_its_range() -> None:
    room = answer_case(new_case(SLAB))["room"]
    prediction = thud.predict_level(floor=thud.construction("concrete 180").floor, room=thud.Room())
    rating = prediction.rating
    assert (room["result"], room["rounded"]) == ("level", rating.rounded)
    assert room["uncertainty_of_rating"] == rating.uncertainty
    assert [level for _, level in room["octaves"]] == prediction.octave_level.tolist()
    ratings = [[rating.level, rating.uncertainty] for rating in prediction.ratings.values()]
    assert [numbers for _, *numbers in room["ratings"]] == ratings
    assert room["contributions"] == [
        [CONTRIBUTIONS[name].title, pytest.approx(value)]
        for name, value in prediction.rating.contributions.items()
    ]
    assert room["uncertainty"] == pytest.approx(prediction.uncertainty, abs=1e-4)


@pytest.mark.parametrize(
    ("required", "rating", "model", "result"),
    [
        (40.0, "thirds", "modal_ball", "does_not_conform"),
        (58.0, "thirds", "modal_ball", "undecided"),
        (80.0, "standardized", "modal_ball", "conforms"),
        # A source that does not conform.
        (49.0, "octaves", "hollow_sphere", "undecided"),
    ],
)
def test_verdict_names_its_rating(required: float, rating: str, model: str, result: str) -> None:
    values = SLAB | {"model": {"name": model}, "room": {"required": required, "rating": rating}}
    room = answer_case(new_case(values))["room"]
    assert room["result"] == result
    assert RATINGS[rating] in room["detail"]
    # The choices of the field are the standards of the ratings.
    assert FIELDS["room", "rating"]["choices"][rating] in RATINGS[rating]


def test_steps_of_fields_are_powers_of_ten() -> None:
    expected = {
        ("ball", "wall_thickness"): 1, ("ball", "mass"): 0.1, ("ball", "youngs_modulus"): 0.1,
        ("drop", "height"): 0.01, ("plate", "thickness"): 10, ("modal_ball", "loss_factor"): 0.01,
        ("sampling", "substeps"): 1, ("plate", "screed_thickness"): 10, ("room", "length"): 0.1,
    }  # fmt: skip
    assert {key: FIELDS[key]["step"] for key in expected} == pytest.approx(expected)
    assert all(field["advanced"] for (group, _), field in FIELDS.items() if group == "mesh")
    assert GROUPS.keys() >= {group for group in SHOWN if group not in {*MODELS, *FLOORS, "room"}}


@pytest.mark.parametrize(
    ("name", "is_computed"),
    [("hollow_sphere", False), ("modal_ball", False), ("finite_element", True), ("two_mass", None)],
)
def test_section_of_a_ball_is_flattened_and_returns(name: str, *, is_computed: bool | None) -> None:
    motion = answer_case(new_case(values_of(name)))["motion"]
    if is_computed is None:
        assert motion is None
        return
    assert motion["is_computed"] is is_computed
    outer, inner = np.array(motion["outer"]), np.array(motion["inner"])
    assert outer.shape == inner.shape == (len(motion["time"]), 25, 2)
    assert len(motion["time"]) > 15
    assert motion["time"][0] == 0
    # The radius and the wall of the standard ball, mm, before the impact and on the floor.
    assert outer[0, :, 0].max() == pytest.approx(89, abs=1)
    assert outer[0, -1, 1] - inner[0, -1, 1] == pytest.approx(32, abs=1)
    half = int(np.argmin(np.abs(np.array(motion["time"]) - 10)))
    assert outer[half, :, 1].min() == pytest.approx(0, abs=0.1)
    assert 30 < outer[half][outer[half, :, 1] < 1, 0].max() < 70
    assert outer[half, -1, 1] < outer[0, -1, 1] - 15
