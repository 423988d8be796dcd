"""Computation of the impact of a case."""

from __future__ import annotations

from typing import TYPE_CHECKING

from thud.base.bridge import ask, notes
from thud.base.checks import refuse, require_kind
from thud.case.case import Case, case_text, impact_only
from thud.impact.floor_impact import new_floor_impact
from thud.impact.impact import Impact, impact_fields
from thud.impact.room_level import new_room_level

if TYPE_CHECKING:
    from thud.base.bridge import Bundle


def compute(case: Case) -> Impact:
    """Compute the impact of a case without raising its warnings."""
    require_kind("case", case, Case)
    if case.model is None:
        refuse("&model is missing", "a case with a source model")
    return new_impact(case, ask("solve", case=case_text(impact_only(case))))


def new_impact(case: Case, answer: Bundle) -> Impact:
    """Return the impact from a bundle of the library."""
    common = impact_fields(case, answer)
    return Impact(
        **common,
        notes=notes(answer.get("warnings", {})),
        on_floor=new_floor_impact(case, answer, common["floor_force"]),
        room_level=new_room_level(answer),
    )
