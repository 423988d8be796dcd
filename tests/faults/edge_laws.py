"""Laws that every answer keeps, and warnings that answers outside a theory must have."""

from __future__ import annotations

import math

import numpy as np

import thud

# What balances may miss: of lumped sources, and of finite elements.
BALANCE, FE_BALANCE = 1e-6, 0.005


def get_fault(impact: thud.Impact) -> str:
    """Return which law an answer breaks; empty for none."""
    for one in filter(None, (impact, impact.on_floor)):
        broken = [law for law, holds in _laws(one).items() if not holds]
        if broken:
            return f"{'on floor' if one is impact.on_floor else 'rigid'}: {', '.join(broken)}"
    missing = [words for words, outside in _outside(impact).items()
               if outside and not any(words in str(note) for note in impact.notes)]  # fmt: skip
    return f"no warning on {', '.join(missing)}" if missing else ""


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
        spread = step * (
            np.abs(np.diff(power, prepend=0, append=0)).sum() + 2 * np.abs(power).max()
        )
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


def _outside(impact: thud.Impact) -> dict[str, bool]:
    """Return which warnings an answer must have."""
    case = impact.case
    ball = case.resolved().ball
    rate, radius = case.sampling.sample_rate, ball.outer_radius
    wall = case.model is not None and case.model.name in (
        "hollow_sphere",
        "modal_ball",
        "finite_element",
    )
    linear = wall and not isinstance(case.model, thud.FiniteElement)
    free = isinstance(case.model, thud.FiniteElement) or getattr(
        case.model, "contact_gravity", False
    )
    on_floor = impact.on_floor
    density = ball.mass / (4 / 3 * math.pi * (radius**3 - (radius - ball.wall_thickness) ** 3))
    fall = case.drop.gravity * impact.contact_time / impact.impact_velocity
    deep = 1.001 * impact.max_deflection
    total = 10 * np.log10(np.sum(impact.floor_force**2) / impact.sample_rate)
    lowest = float(impact.levels(method="exact", force="floor").min())
    return {
        "density of the wall": wall and not 799 < density < 2201,
        "youngs_modulus in Pa": wall and not 1e4 <= ball.youngs_modulus <= 3e9,
        "poisson_ratio": wall and ball.poisson_ratio < 0.45,
        "sample_rate in Hz": rate < 8000,
        # Unknown errors are NaN.
        "numerical error": not np.max(
            [shown.level_error for shown in (impact, on_floor) if shown is not None]
        ) <= 0.2,
        "gravity times contact time": not free and fall > 0.201,
        "wall thickness over outer radius": isinstance(case.model, thud.HollowSphere)
        and ball.wall_thickness > 0.401 * radius,
        "deflection over outer radius": linear and deep > 0.502 * radius,
        "deflection over wall thickness": linear
        and deep > (0.505 if ball.wall_thickness < 0.3 * radius else 2.01) * ball.wall_thickness,
        "check the units of the input": not 3.9 < total < 92.1,
        "smallest fraction of the energy in an octave": lowest < total - 120.1,
        "&floor: restitution is": on_floor is not None and on_floor.restitution < -1e-5,
        "&model: restitution minus 1 is": on_floor is not None and on_floor.restitution > 1 + 1e-5,
    }  # fmt: skip
