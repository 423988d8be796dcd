"""Estimated times of random cases of the page beside the measured ones.

Prints the share of estimates within a factor of three, and the worst ones:

    .venv/bin/python tests/bench/cost.py [cases]
"""

from __future__ import annotations

import math
import random
import sys
import time
from typing import Any

from thud.base._schema import FLOORS
from thud.base.errors import ThudError
from thud.explorer.answer import MAX_SAMPLES, answer_case, new_case
from thud.explorer.form import form
from thud.impact.ensemble import get_cost

# Models that need no measured values, and how often each is drawn.
MODELS = {"hollow_sphere": 3, "modal_ball": 6, "two_mass": 2, "finite_element": 2}
FACTOR, SHARE = 3.0, 0.95
# Estimated time beyond which a case is not computed, s.
LONGEST = 5.0
# Time that the page's own numbers take, in all and of each sample, s.
PAGE, PAGE_SAMPLE = 2e-3, 1e-7
# Chance that a key is drawn.
CHANCE = 0.3
# Floors that need a measurement or a file.
GIVEN = ("measured_mobility", "modal_floor")


def random_value(field: dict[str, Any], chance: random.Random) -> object:
    """Return a value of a key: one of its choices, or one on its slider."""
    if field["choices"]:
        return chance.choice(list(field["choices"]))
    slider = field.get("slider")
    if not slider:
        return field["default"]
    low, high = (end * 10 ** field["power"] for end in slider["ends"])
    if slider["log"]:
        value = math.exp(chance.uniform(math.log(low), math.log(high)))
    else:
        value = chance.uniform(low, high)
    return round(value) if field["kind"] == "whole" else value


def random_values(chance: random.Random) -> dict[str, dict[str, Any]]:
    """Return a case as the page has it; records and steps vary by more than the sliders do."""
    model = chance.choices(list(MODELS), list(MODELS.values()))[0]
    floor = chance.choice([None, *(name for name in FLOORS if name not in GIVEN)])
    values: dict[str, dict[str, Any]] = {"model": {"name": model}}
    if floor:
        values["floor"] = {"name": floor}
    for group in form():
        if group["name"] not in ("ball", "drop", "levels", model, floor):
            continue
        for field in group["fields"]:
            if chance.random() < CHANCE:
                keys = values.setdefault(field["group"], {})
                keys[field["name"]] = random_value(field, chance)
    rate = math.exp(chance.uniform(math.log(16e3), math.log(200e3)))
    duration = math.exp(chance.uniform(math.log(0.03), math.log(MAX_SAMPLES / rate)))
    substeps = round(2 ** chance.uniform(0, 6))
    values["sampling"] = {"sample_rate": rate, "duration": duration, "substeps": substeps}
    return values


def main() -> int:
    """Print the share and the worst estimates; return 1 where too few are good."""
    chance = random.Random(1)  # noqa: S311 - no secret
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    ratios = []
    answer_case(new_case({}))
    while len(ratios) < count:
        values = random_values(chance)
        try:
            case = new_case(values)
            samples = case.sampling.sample_rate * case.sampling.duration
            expected = get_cost(case, ()) + PAGE + PAGE_SAMPLE * samples
            if expected > LONGEST:
                continue
            start = time.process_time()
            answer_case(case)
        except ThudError:
            continue
        taken = time.process_time() - start
        ratios.append((taken / expected, taken, values))
    good = sum(1 / FACTOR <= ratio <= FACTOR for ratio, *_ in ratios) / count
    for ratio, taken, values in sorted(ratios, key=lambda one: abs(math.log(one[0])))[-5:]:
        print(f"measured {taken:.3f} s, {ratio:.2f} times the estimate: {values}")
    print(f"{good:.1%} of {count} estimates within a factor of {FACTOR:g}, required {SHARE:.0%}")
    return int(good < SHARE)


if __name__ == "__main__":
    sys.exit(main())
