"""Numbers at the edges: keys over their whole ranges; no wrong number without a word.

What `cases` draws and thud does not refuse keeps laws; a share is compared with finer steps.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from cases import draw_case

import thud
from thud.case.case import case_text

if TYPE_CHECKING:
    import random

# What balances may miss: of lumped sources, and of finite elements.
BALANCE, FE_BALANCE = 1e-6, 0.005
# Changes of contact time and restitution by steps half as long, measured up to 2e-6.
STEP_CHANGE = 1e-5


def attempt(models: dict[str, int], chance: random.Random) -> tuple[str, str]:
    """Try a drop of a model, by their weights."""
    try:
        case = draw_case(chance.choices(list(models), list(models.values()))[0], chance)
        impact = thud.solve(case)
        wrong = get_fault(impact)
        if wrong == "rigid: restitution" and is_of_step(impact):
            wrong = ""
        if not wrong and chance.random() < 0.1:
            wrong = _finer_steps(impact)
    except thud.ThudError as error:
        return ("NaN", str(error)) if "NaN" in str(error) else ("refused", "")
    if wrong:
        return "wrong", f"{wrong}; {case_text(case).decode().split()} {impact.notes}"
    return ("warned" if impact.notes else "computed"), ""


def get_fault(impact: thud.Impact) -> str:
    """Return which law an answer breaks; empty for none."""
    for one in filter(None, (impact, impact.on_floor)):
        broken = [law for law, holds in _laws(one).items() if not holds]
        if broken:
            return f"{'on floor' if one is impact.on_floor else 'rigid'}: {', '.join(broken)}"
    return ""


def _laws(impact: thud.Impact) -> dict[str, bool]:
    """Return which laws an answer keeps."""
    case, force = impact.case, impact.floor_force
    elements = isinstance(case.model, thud.FiniteElement)
    gravity = elements or getattr(case.model, "contact_gravity", False)
    velocity, step = impact.impact_velocity, 1 / impact.sample_rate
    momentum, energy = case.ball.mass * velocity, case.ball.mass * velocity**2 / 2
    balance = FE_BALANCE if elements else BALANCE
    moves = isinstance(impact, thud.FloorImpact)
    feeds = getattr(case.model, "momentum_flux", "") == "none" and moves
    third = [impact.levels("third", force=kind) for kind in ("elastic", "floor")]
    octave = [impact.levels("octave", force=kind) for kind in ("elastic", "floor")]
    arrays = (force, impact.elastic_force, impact.deflection, impact.velocity, *third, *octave)
    total = 10 * np.log10(np.sum(force**2) * step)
    # A ball that leaves the floor before it is round again is lower than at first touch.
    fall = case.ball.mass * case.drop.gravity * impact.max_deflection + balance * energy
    laws = {
        "numbers are finite": all(np.isfinite(values).all() for values in arrays),
        "thirds hold no more than all": _energy(third[1]) <= total + 1e-6,
        "an octave of exact bands is its thirds": impact.case.levels.method != "exact"
        or abs(_energy(third[1][3:12]) - _energy(octave[1][1:4])) < 1e-3
        or _energy(octave[1][1:4]) < total - 110,
        "impulse is the change of momentum": gravity
        or abs(impact.impulse - momentum * (1 + impact.restitution)) <= 3 * balance * momentum,
        "samples hold the impulse": abs(force.sum() * step / impact.impulse - 1) <= 0.02,
        "balances close": max(impact.impulse_residual, impact.energy_residual) <= balance,
        "restitution": (-1 if moves else 0) - 1e-6 <= impact.restitution <= 1 + 1e-6 or feeds
        or (gravity and energy * (impact.restitution**2 - 1) <= fall),
        "contact lasts": 0 < impact.contact_time <= case.sampling.duration + step,
        "no sample exceeds the peak": elements or force.max() <= impact.peak_force * (1 + 1e-9),
        "no sample exceeds the deflection": impact.deflection.max()
        <= impact.max_deflection * (1 + 1e-9),
    }  # fmt: skip
    if isinstance(impact, thud.FloorImpact):
        power = force * impact.floor_velocity
        # Contact takes or gives some energy within the steps of the modal ball.
        missing = balance * energy + abs(impact.model_quantities.get("contact_loss", 0.0))
        changes = np.abs(np.diff(power, prepend=0, append=0)).sum()
        spread = step * (changes + 2 * np.abs(power).max())
        laws |= {
            "the floor takes energy": -missing <= impact.floor_work
            <= energy + missing or gravity,
            "samples hold the work": abs(power.sum() * step - impact.floor_work)
            <= spread + balance * energy,
        }  # fmt: skip
    return laws


def _energy(levels: np.ndarray) -> float:
    """Return the level of all bands together, dB."""
    return float(10 * np.log10(np.sum(10 ** (levels / 10))))


def _finer(impact: thud.Impact, factor: int) -> thud.Impact:
    """Return the same drop in steps as many times shorter."""
    sampling = impact.case.sampling
    finer = replace(sampling, substeps=factor * sampling.substeps)
    return thud.solve(replace(impact.case, sampling=finer))


def _finer_steps(impact: thud.Impact) -> str:
    if isinstance(impact.case.model, thud.FiniteElement | thud.ModalBall):
        return ""
    finer = _finer(impact, 2)
    for one, other in ((impact, finer), (impact.on_floor, finer.on_floor)):
        if not one or not other:
            continue
        changes = (one.contact_time / other.contact_time - 1, one.restitution - other.restitution)
        if max(map(abs, changes)) > STEP_CHANGE:
            return f"half the step changes contact time and restitution by {changes}"
    return ""


def is_of_step(impact: thud.Impact) -> bool:
    """Return whether a restitution above 1 raises a warning, and an error of the step."""
    excess = impact.restitution - 1
    is_noted = any(math.isclose(note.value, excess) for note in impact.notes)
    return is_noted and abs(_finer(impact, 4).restitution - 1) < excess / 4
