"""Comparisons of an answer: finer steps and samples, other units, many drops, a hard floor."""

from __future__ import annotations

import math
from dataclasses import fields, replace
from typing import TYPE_CHECKING

import numpy as np
from edge_cases import LUMPED

import thud
from thud.base._schema import KEYS

if TYPE_CHECKING:
    import random
    from collections.abc import Callable, Iterable

    from thud.base.key import Group, Key

# Changes of contact time and restitution by steps half as long, measured up to 2e-6; of levels by
# four times as many samples, measured up to 0.19 dB where no warning tells of the rate.
STEP_CHANGE, RATE_CHANGE = 1e-5, 0.25
# Powers of mass, length and time in the units of keys.
POWERS = {"": (0, 0, 0), "m": (0, 1, 0), "kg": (1, 0, 0), "s": (0, 0, 1), "Hz": (0, 0, -1),
          "Pa": (1, -1, -2), "m/s2": (0, 1, -2), "s/m": (0, -1, 1), "N/m": (1, 0, -2),
          "N s/m": (1, 0, -1), "m/(N s)": (-1, 0, 1), "m/(N s2)": (-1, 0, 0),
          "kg/m3": (1, -3, 0)}  # fmt: skip
SCALED_FLOORS = (None, "infinite_plate", "oscillator", "measured_mobility")


def _finer_steps(impact: thud.Impact, _: random.Random) -> str:
    case = impact.case
    if isinstance(case.model, thud.FiniteElement | thud.ModalBall):
        return ""
    finer = thud.solve(_sampled(case, substeps=2 * case.sampling.substeps))
    for one, other in _pairs(impact, finer):
        changes = (one.contact_time / other.contact_time - 1, one.restitution - other.restitution)
        if max(map(abs, changes)) > STEP_CHANGE:
            return f"half the step changes contact time and restitution by {changes}"
    return ""


def is_of_step(impact: thud.Impact) -> bool:
    """Return whether a restitution above 1 raises a warning, and an error of the step."""
    excess = impact.restitution - 1
    if not any("gives energy to the source" in str(one) for one in impact.notes):
        return False
    finer = thud.solve(_sampled(impact.case, substeps=4 * impact.case.sampling.substeps))
    return abs(finer.restitution - 1) < excess / 4


def _more_samples(impact: thud.Impact, _: random.Random) -> str:
    case = impact.case
    told = any("sample_rate in Hz" in one or "1e-12" in one for one in map(str, impact.notes))
    if (
        told
        or case.model is None
        or case.model.name not in LUMPED
        or case.sampling.sample_rate > 2.5e6
    ):
        return ""
    finer = thud.solve(_sampled(case, sample_rate=4 * case.sampling.sample_rate))
    change = np.abs(impact.levels() - finer.levels()).max()
    return f"four times the samples change a level by {change} dB" if change > RATE_CHANGE else ""


def _other_units(impact: thud.Impact, chance: random.Random) -> str:
    """Compare with the same drop in other units of mass, length and time (Buckingham)."""
    case = impact.case
    scales = [
        4.0 ** chance.randint(-3, 3),
        4.0 ** chance.randint(-3, 3),
        chance.choice([0.5, 1, 2]),
    ]
    if (
        isinstance(case.model, thud.FiniteElement)
        or (case.floor and case.floor.name) not in SCALED_FLOORS
    ):
        return ""
    try:
        scaled = thud.solve(_scaled(case, scales))
    except thud.InputError:
        return ""  # a key is outside its range
    unit = _unit(scales, (1, 1, -2))
    for one, other in _pairs(impact, scaled):
        change = np.abs(one.floor_force - other.floor_force / unit).max() / one.peak_force
        if not change < 1e-6:
            return f"units scaled by {scales} change the force by {change}"
    return ""


def _scaled(case: thud.Case, scales: list[float]) -> thud.Case:
    groups = {}
    for name in ("ball", "drop", "sampling", "model", "floor"):
        group = getattr(case, name)
        if group is None:
            continue
        owner = group.name if name in ("model", "floor") else ""
        keys = {
            key.name: key for key in KEYS if key.owner == owner and (owner or key.group == name)
        }
        values = {one.name: getattr(group, one.name) for one in fields(group)}
        for word, value in values.items():
            unit = _unit(scales, _powers(group, keys[word]))
            if isinstance(value, tuple | list):
                values[word] = [unit * one for one in value]
            elif isinstance(value, float):
                values[word] = unit * value
        groups[name] = type(group)(**values)
    return replace(case, **groups)


def _powers(group: Group, key: Key) -> tuple[float, float, float]:
    """Return the powers of mass, length and time in the unit of a key."""
    if key.name == "stiffness" and isinstance(group, thud.HuntCrossley):
        return 1, 1 - group.exponent, -2
    if key.name == "carcass_stiffness" and isinstance(group, thud.TwoMass):
        return 1, 1 - group.carcass_exponent, -2  # it is stated at 20 mm
    return POWERS[key.unit]


def _unit(scales: list[float], powers: tuple[float, float, float]) -> float:
    return math.prod(scale**power for scale, power in zip(scales, powers, strict=True))


def _among_many(impact: thud.Impact, _: random.Random) -> str:
    case = impact.case
    found = thud.solve_many({"height": [case.drop.height]}, case, threads=1)
    if found.status[0] != 0:
        return f"solve_many refuses: {found.reason[0]}"
    change = abs(found.restitution[0] - impact.restitution)
    levels = np.abs(found.floor_octave[0] - impact.levels(force="floor"))
    total = 10 * np.log10(np.sum(impact.floor_force**2) / impact.sample_rate)
    counts = impact.levels(force="floor", method="exact") > total - 80
    if change > 1e-8 or (levels[counts] > 1e-5).any():
        return f"solve_many differs by {change} in restitution and {levels} dB"
    return ""


def _hard_floor(impact: thud.Impact, _: random.Random) -> str:
    case = impact.case
    if isinstance(case.model, thud.FiniteElement | thud.ModalBall | thud.MeasuredModes):
        return ""
    if impact.contact_time * impact.sample_rate * case.sampling.substeps > 2e4:
        return ""
    duration = min(case.sampling.duration, 1.5 * impact.contact_time)
    case = replace(_sampled(case, duration=duration), floor=thud.InfinitePlate(1e15))
    change = _force_change(case)
    if change is None:
        return "a floor of 1e15 N s/m counts as rigid"
    # The first order in the mobility: force times compliance of the floor over the motion.
    allowed = 10 * impact.peak_force / 1e15 / impact.impact_velocity + 1e-5
    if change < allowed:
        return ""
    # A steep force leaves an error of the step as it begins, which falls faster than its square.
    finer = _force_change(_sampled(case, substeps=2 * case.sampling.substeps))
    return (
        ""
        if finer is not None and finer < change / 4
        else f"a floor of 1e15 N s/m changes the force by {change}"
    )


def _force_change(case: thud.Case) -> float | None:
    """Return how much the force differs from that on a rigid floor, as part of its peak."""
    stopped = thud.solve(case)
    if stopped.on_floor is None:
        return None
    return (
        float(np.abs(stopped.on_floor.floor_force - stopped.floor_force).max()) / stopped.peak_force
    )


def _sampled(case: thud.Case, **values: float) -> thud.Case:
    return replace(case, sampling=replace(case.sampling, **values))


def _pairs(one: thud.Impact, other: thud.Impact) -> Iterable[tuple[thud.Impact, thud.Impact]]:
    """Return the answers on rigid floors, and on floors that move where both have one."""
    yield one, other
    if one.on_floor and other.on_floor:
        yield one.on_floor, other.on_floor


COMPARISONS: list[Callable[[thud.Impact, random.Random], str]] = [
    _finer_steps, _more_samples, _other_units, _among_many, _hard_floor,
]  # fmt: skip
