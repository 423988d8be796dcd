"""Numbers at the edges: keys over their whole ranges; no wrong number without a word.

What `edge_cases` draws and thud does not refuse is held against `edge_laws` and, of a share,
`edge_comparisons`.
"""

from __future__ import annotations

import multiprocessing
import warnings
from typing import TYPE_CHECKING

from campaign import Finding
from edge_cases import LUMPED, WEIGHTS, draw_case
from edge_comparisons import COMPARISONS
from edge_laws import get_fault

import thud
from thud.case import case_text

if TYPE_CHECKING:
    import random
    from collections.abc import Iterable
    from pathlib import Path


def check_lumped(tries: list[tuple[int, random.Random]], _: Path) -> Iterable[Finding]:
    """Try lumped models."""
    return [_try(chance.choices(LUMPED, WEIGHTS)[0], chance) for _, chance in tries]


def check_modal(tries: list[tuple[int, random.Random]], _: Path) -> Iterable[Finding]:
    """Try the modal ball."""
    return [_try_in_time("modal_ball", chance, 20) for _, chance in tries]


def check_elements(tries: list[tuple[int, random.Random]], _: Path) -> Iterable[Finding]:
    """Try finite elements, with small meshes."""
    return [_try_in_time("finite_element", chance, 15) for _, chance in tries]


def _try_in_time(model: str, chance: random.Random, seconds: float) -> Finding:
    """Try in another process, which is stopped after some time."""
    context = multiprocessing.get_context("fork")
    here, there = context.Pipe(duplex=False)
    process = context.Process(target=lambda: there.send(_try(model, chance)))
    process.start()
    there.close()
    try:
        found: Finding = here.recv() if here.poll(seconds) else Finding("stopped")
    except EOFError:
        found = Finding("crashed", model)
    process.kill()
    process.join()
    return found


def _try(model: str, chance: random.Random) -> Finding:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            case = draw_case(model, chance)
            impact = thud.solve_case(case)
            wrong = get_fault(impact)
            if not wrong and chance.random() < (0.1 if model in LUMPED else 0.05):
                wrong = chance.choice(COMPARISONS)(impact, chance)
        except thud.ThudError as error:
            return Finding("NaN", str(error)) if "NaN" in str(error) else Finding("refused")
    if wrong:
        return Finding("wrong", f"{wrong}; {case_text(case).decode().split()} {impact.remarks}")
    return Finding("remarked" if impact.remarks else "computed")
