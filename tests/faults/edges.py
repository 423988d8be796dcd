"""Numbers at the edges: keys over their whole ranges; no wrong number without a word.

What `edge_cases` draws and thud does not refuse is held against `edge_laws` and, of a share,
`edge_comparisons`.
"""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np
from campaign import Finding, each
from edge_cases import LUMPED, WEIGHTS, draw_case
from edge_comparisons import COMPARISONS, is_of_step
from edge_laws import BALANCE, get_fault

import thud
from thud.case.case import case_text

if TYPE_CHECKING:
    import random
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from campaign import Check, Tries


def check_models(models: Sequence[str], weights: Sequence[int] = (1,)) -> Check:
    """Return the check of single drops of models."""
    return each(lambda chance: _try(chance.choices(models, weights)[0], chance))


def check_many(tries: Tries, _: Path) -> Iterable[Finding]:
    """Try lumped models on a rigid floor by `thud.solve_many`."""
    models = LUMPED[:2]
    cases = [draw_case(chance.choices(models, WEIGHTS[:2])[0], chance, 0) for _, chance in tries]
    found: dict[int, Finding] = {}
    for name in models:
        places = [place for place, case in enumerate(cases) if case.model.name == name]
        found |= zip(places, _many([cases[place] for place in places]), strict=True)
    return [found[place] for place in range(len(cases))]


def _many(cases: list[thud.Case]) -> Iterable[Finding]:
    """Yield what becomes of cases of one model."""
    if not cases:
        return
    groups = [(case.ball, case.drop, case.sampling, case.model) for case in cases]
    values = [{key: value for group in one for key, value in vars(group).items()} for one in groups]
    columns = {key: [one[key] for one in values] for key in values[0]}
    many = thud.solve_many(columns, thud.Case(model=type(cases[0].model)()), threads=1)
    for i, case in enumerate(cases):
        if many.status[i] != 0:
            yield Finding("refused")
            continue
        velocity = (2 * case.drop.gravity * case.drop.height) ** 0.5
        rebound = many.impulse[i] / (case.ball.mass * velocity) - 1
        numbers = (many.contact_time[i], many.peak_force[i], many.max_deflection[i])
        levels = many.floor_octave[i]
        right = (
            all(0 < number < np.inf for number in numbers)
            and many.restitution[i] >= -BALANCE
            and abs(rebound - many.restitution[i]) < 3 * BALANCE
            and many.contact_time[i] <= case.sampling.duration + 1 / case.sampling.sample_rate
            and np.isfinite(levels).all()
        )
        if right and many.restitution[i] <= 1 + BALANCE:
            yield Finding("computed")
        elif right and is_of_step(thud.solve(case)):
            yield Finding("warned")
        else:
            yield Finding("wrong", f"{many.restitution[i]}; {case_text(case).decode().split()}")


def _try(model: str, chance: random.Random) -> Finding:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            case = draw_case(model, chance)
            impact = thud.solve(case)
            wrong = get_fault(impact)
            if wrong == "rigid: restitution" and is_of_step(impact):
                wrong = ""
            if not wrong and chance.random() < (0.1 if model in LUMPED else 0.05):
                wrong = chance.choice(COMPARISONS)(impact, chance)
        except thud.ThudError as error:
            return Finding("NaN", str(error)) if "NaN" in str(error) else Finding("refused")
    if wrong:
        return Finding("wrong", f"{wrong}; {case_text(case).decode().split()} {impact.notes}")
    return Finding("warned" if impact.notes else "computed")
