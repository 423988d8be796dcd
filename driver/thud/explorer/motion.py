"""Motion of the source on a rigid floor for the page: its section at some instants."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base._schema import HollowSphere, ModalBall, TwoMass
from thud.explorer.series import TIME_RANGE, thin_out, to_json

if TYPE_CHECKING:
    from thud.impact.impact import Impact

    Answer = dict[str, Any]

# Maximum number of instants of a motion, and of points of a line.
MAX_INSTANTS = 30
MAX_POINTS = 33
# Decimals of positions, mm.
DECIMALS = 1


def motion_of(impact: Impact) -> Answer | None:
    """Return the motion of a source on a rigid floor, mm, at times, ms.

    The kind is ``"section"`` (lines ``outer`` and ``inner`` at each instant), ``"sphere"`` (one
    that is flattened by its ``deflection``) or ``"masses"`` (``deflection`` of belt and rim). None
    for models without a shape.
    """
    model, ball = impact.case.model, impact.case.ball
    end = impact.touch_time + TIME_RANGE * impact.contact_time
    times = impact.time if impact.motion is None else impact.motion.time
    chosen = thin_out(np.flatnonzero(times <= end), MAX_INSTANTS)
    answer: Answer = {"time": to_json(1e3 * (times[chosen] - impact.touch_time))}
    if impact.motion is not None:
        position = impact.motion.position[chosen]
        points = thin_out(np.arange(position.shape[1]), MAX_POINTS)
        lines = {
            name: np.round(1e3 * position[:, points, ring], DECIMALS).tolist()
            for name, ring in (("outer", -1), ("inner", 0))
        }
        return answer | lines | {"kind": "section", "caption": "Computed section."}
    if isinstance(model, HollowSphere | ModalBall):
        size = {"radius": 1e3 * ball.outer_radius, "wall": 1e3 * ball.wall_thickness}
        deflection = to_json(1e3 * impact.deflection[chosen])
        caption = "A sphere, flattened by the deflection of the ball."
        return answer | size | {"kind": "sphere", "deflection": deflection, "caption": caption}
    if isinstance(model, TwoMass):
        masses = {
            name: to_json(1e3 * impact.model_histories[f"{name}_displacement_m"][chosen])
            for name in ("belt", "rim")
        }
        caption = "Belt and rim, lowered by their displacements: the model has no other shape."
        return answer | {"kind": "masses", "deflection": masses, "caption": caption}
    return None
