"""Motion of the source on a rigid floor for the page: its section at some instants."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base._schema import HollowSphere, ModalBall
from thud.explorer.series import TIME_RANGE, thin_out, to_json

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.impact.impact import Impact

    Answer = dict[str, Any]

# Maximum number of instants of a motion, and of points of a line.
MAX_INSTANTS = 20
MAX_POINTS = 25
# Decimals of positions, mm.
DECIMALS = 1


def motion_of(impact: Impact) -> Answer | None:
    """Return the outer and inner line of a source on a rigid floor, mm, at times, ms.

    They are computed by finite elements, and else those of a sphere that is flattened by the
    deflection. None for models that are no ball.
    """
    motion = impact.motion
    if motion is None and not isinstance(impact.case.model, HollowSphere | ModalBall):
        return None
    end = impact.touch_time + TIME_RANGE * impact.contact_time
    times = impact.time if motion is None else motion.time
    chosen = thin_out(np.flatnonzero(times <= end), MAX_INSTANTS)
    lines = _flattened(impact, chosen)
    if motion is not None:
        points = thin_out(np.arange(motion.position.shape[1]), MAX_POINTS)
        lines = motion.position[chosen][:, points][:, :, [-1, 0]].swapaxes(1, 2)
    outer, inner = np.round(1e3 * lines, DECIMALS).swapaxes(0, 1).tolist()
    return {
        "time": to_json(1e3 * (times[chosen] - impact.touch_time)),
        "outer": outer,
        "inner": inner,
        "is_computed": motion is not None,
    }


def _flattened(impact: Impact, chosen: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return outer and inner line, m, of a hollow sphere flattened at the chosen instants."""
    ball = impact.case.ball
    deflection = np.maximum(impact.deflection[chosen], 0.0)[:, None, None]
    walls = np.array([0.0, ball.wall_thickness])[:, None]
    angles = np.linspace(0.0, np.pi, MAX_POINTS)
    radius = ball.outer_radius - walls
    height = np.maximum(walls, ball.outer_radius - deflection - radius * np.cos(angles))
    return np.stack(np.broadcast_arrays(radius * np.sin(angles), height), axis=-1)
