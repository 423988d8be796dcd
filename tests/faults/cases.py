"""Cases whose keys, some or all, are log-uniform over their whole ranges."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import fields, replace
from typing import TYPE_CHECKING

import thud
from thud.base._schema import FLOORS, KEYS, MODELS

if TYPE_CHECKING:
    import random

    from thud.base.key import Group, Key

LUMPED = {"hollow_sphere": 4, "hunt_crossley": 3, "two_mass": 1, "measured_modes": 2}
# Of 1000 tries so many drop on each floor too.
FLOOR_SHARE = {"infinite_plate": 80, "oscillator": 60, "measured_mobility": 30, "joist_floor": 15,
               "plate": 8, "laminate_floor": 3}  # fmt: skip
# Samples of a record, and steps, on a rigid floor, on a small receiver, and on one of many modes.
MAX_STEPS = {"": 20_000, "infinite_plate": 1500, "oscillator": 1500, "measured_mobility": 1500}
FEW_STEPS = 300
# Steps of a tyre, which chooses them itself.
TYRE_STEPS = 1e5


def draw_case(model: str, chance: random.Random) -> thud.Case:
    """Return a case that takes no long time."""
    while True:
        # Ends of ranges may be excluded.
        with suppress(thud.InputError):
            case = _any_case(model, chance)
            if not isinstance(case.model, thud.TwoMass) or _tyre_steps(case) < TYRE_STEPS:
                return case


def _tyre_steps(case: thud.Case) -> float:
    """Return about how many steps a tyre takes."""
    tyre = case.model
    assert isinstance(tyre, thud.TwoMass)
    stiffness = tyre.inflation_pressure * tyre.contact_width + tyre.carcass_stiffness
    rate = 2 * math.pi * tyre.belt_frequency * max(1, 2 * tyre.belt_damping)
    rate /= math.sqrt(1 - tyre.belt_mass / case.ball.mass)
    sampling = case.sampling
    steps = math.hypot(rate, math.sqrt(stiffness / tyre.belt_mass)) / 0.02 + sampling.sample_rate
    return sampling.substeps * sampling.duration * steps


def _any_case(model: str, chance: random.Random) -> thud.Case:
    """Return a case; keys that are not drawn from their whole range are near their defaults."""
    part = chance.choice([0.1, 0.2, 0.4, 1.0] if model in LUMPED else [0.0, 0.05, 0.1, 0.3])
    standard = thud.Case(model=MODELS[model]()).resolved()
    ball = vary(standard.ball, "", "ball", chance, part)
    if ball.wall_thickness >= ball.outer_radius:
        ball = replace(ball, wall_thickness=ball.outer_radius * chance.random())
    drop = vary(thud.Drop(), "", "drop", chance, part)
    options = _options(vary(standard.model, model, "", chance, part), ball, chance)
    floor = None
    if model != "measured_modes" and chance.random() * 1000 < sum(FLOOR_SHARE.values()):
        name = chance.choices(list(FLOOR_SHARE), list(FLOOR_SHARE.values()))[0]
        floor = vary(FLOORS[name](), name, "", chance, part)
        if name == "measured_mobility":
            # A few poles, passive.
            count, end = range(chance.randint(1, 3)), log_uniform
            floor = replace(
                floor,
                pole_frequency=[end(chance, 1e-6, 1e7) for _ in count],
                damping_ratio=[end(chance, 1e-4, 1) for _ in count],
                residue_real=[end(chance, 1e-6, 1e3) for _ in count],
                residue_imaginary=[0.0 for _ in count],
            )
    case = thud.Case(ball=ball, drop=drop, model=options, floor=floor)
    return replace(case, sampling=_sampling(case, chance))


def vary(group: Group, owner: str, name: str, chance: random.Random, part: float) -> Group:
    """Return a group with a part of its keys, but for lists and texts, drawn from their ranges."""
    values = {one.name: getattr(group, one.name) for one in fields(group)}
    keys = [key for key in KEYS if key.owner == owner and name in {"", key.group}]
    for key in keys:
        if key.kind in {"list", "text", "texts"}:
            continue
        if chance.random() < part:
            values[key.name] = draw(key, values, chance)
        elif key.kind == "real" and chance.random() < 0.5:
            low, high = _ends(key, values)
            near = values[key.name] * math.exp(chance.gauss(0, 0.5))
            values[key.name] = min(max(near, low), high)
    return type(group)(**values)


def draw(key: Key, values: dict[str, object], chance: random.Random) -> object:
    """Return a value from the whole range of a key; `values` are those of its group."""
    if key.kind == "choice":
        return chance.choice(key.choices)
    if key.kind == "flag":
        return chance.random() < 0.5
    low, high = _ends(key, values)
    if chance.random() < 0.05:
        return round(high) if key.whole else high
    value = (
        log_uniform(chance, max(low, 1e-12 * high), high) if low >= 0 else chance.uniform(low, high)
    )
    return min(max(round(value), math.ceil(low)), math.floor(high)) if key.whole else value


def _ends(key: Key, values: dict[str, object]) -> tuple[float, float]:
    """Return the ends of a range; a text is the key whose value it is."""
    ends = (values[end] if isinstance(end, str) else end for end in (key.lower, key.upper))
    low, high = (float(str(end)) for end in ends)
    return low, high


def log_uniform(chance: random.Random, low: float, high: float) -> float:
    """Return a number whose logarithm is uniform."""
    return math.exp(chance.uniform(math.log(low), math.log(high)))


def _options(options: Group, ball: thud.Ball, chance: random.Random) -> Group:
    """Return options that do not contradict each other, and take seconds at most as a rule."""
    if isinstance(options, thud.HuntCrossley):
        if chance.random() < 0.5:
            keys = {"contact_time": 0.0, "stiffness": log_uniform(chance, 1e-3, 1e15)}
        else:
            keys = {"contact_time": log_uniform(chance, 1e-4, 10), "stiffness": 0.0}
        loss = chance.random() < 0.5
        keys |= {"damping": 0.0, "restitution": chance.uniform(0.01, 1)} if loss else {}
        return replace(options, **({"restitution": 0.0} | keys))
    if isinstance(options, thud.TwoMass):
        return replace(options, belt_mass=ball.mass * chance.uniform(0.01, 0.99))
    if isinstance(options, thud.MeasuredModes):
        share = [log_uniform(chance, 1e-3, 1) for _ in range(chance.choice([1, 1, 2, 3, 5]))]
        highest = chance.choice([500, 1e6])
        return thud.MeasuredModes(
            [log_uniform(chance, min(10, highest / 1e9), highest) for _ in share],
            [chance.choice([0.0, 0.3, 0.9999]) * chance.random() for _ in share],
            [ball.mass * one / sum(share) for one in share],
        )
    if isinstance(options, thud.FiniteElement):
        count = chance.randint(1, 3) if options.viscosity == "prony" else 0
        return replace(
            options, bounces=1, flight_before=0.0, flight_after=0.0, snapshot_interval=0.0,
            step_safety=0.85,
            radial_elements=chance.randint(2, 4), polar_elements=chance.randint(8, 24),
            prony_share=[log_uniform(chance, 1e-3, 1000) for _ in range(count)],
            prony_time=[log_uniform(chance, 1e-9, 1000) for _ in range(count)],
        )  # fmt: skip
    if isinstance(options, thud.ModalBall) and chance.random() < 0.8:
        return replace(
            options, rings=chance.choice([0, chance.randint(2, 130)]),
            highest_frequency=chance.choice([0.0, log_uniform(chance, 50, 4000)]),
        )  # fmt: skip
    return options


def _sampling(case: thud.Case, chance: random.Random) -> thud.Sampling:
    """Return a sampling: as a rule one that suits the contact, of a few samples to many."""
    most = MAX_STEPS.get(case.floor.name if case.floor else "", FEW_STEPS)
    if chance.random() < 0.1:
        rate, duration = log_uniform(chance, 2000, 1e7), log_uniform(chance, 1e-3, 10)
    else:
        contact = _rough_contact_time(case)
        rate = min(max(log_uniform(chance, 8, min(3000, most)) / contact, 2000.0), 1e7)
        duration = min(max(contact * log_uniform(chance, 1.2, 20), 1e-3), 10.0)
    if isinstance(case.model, thud.FiniteElement):
        rate, duration = min(max(rate, 16000.0), 1e5), min(duration, 0.2)
    duration = max(min(duration, most / rate), 1e-3)
    steps = int(min(100, max(1, most / (rate * duration))))
    return thud.Sampling(rate, duration, chance.randint(1, steps) if chance.random() < 0.3 else 1)


def _rough_contact_time(case: thud.Case) -> float:
    ball, model = case.resolved().ball, case.model
    if isinstance(model, thud.MeasuredModes):
        return 0.5 / min(model.frequency)
    if isinstance(model, thud.HuntCrossley):
        if model.contact_time > 0:
            return model.contact_time
        velocity = math.sqrt(2 * case.drop.gravity * case.drop.height)
        length = (ball.mass * velocity**2 / model.stiffness) ** (1 / (model.exponent + 1))
        return 3 * length / velocity
    if isinstance(model, thud.TwoMass):
        stiffness = model.inflation_pressure * model.contact_width + model.carcass_stiffness
        return 4 * math.sqrt(ball.mass / stiffness)
    shell = 8 * ball.youngs_modulus * ball.wall_thickness**2 / ball.outer_radius / 3
    gas = 2 * math.pi * ball.outer_radius * ball.gauge_pressure
    return math.pi * math.sqrt(ball.mass / (shell + gas))
