"""Motion of the source for the page: its section at some instants, and stresses of elements."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base._schema import FiniteElement, HollowSphere, ModalBall, TwoMass
from thud.case.keys import number_in
from thud.explorer.series import TIME_RANGE, thin_out, to_json
from thud.impact.floor_impact import FloorImpact

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.impact.impact import Impact

    Array = NDArray[np.float64]
    Answer = dict[str, Any]

# Maximum number of instants of a motion, and of lines and rings of nodes of a mesh.
MAX_INSTANTS = 30
MAX_LINES, MAX_RINGS = 33, 5
# Decimals of positions, mm.
DECIMALS = 1
# Keys of the elasticity of the ball.
_ELASTIC = ("youngs_modulus", "poisson_ratio")


def motion_of(impact: Impact) -> Answer | None:
    """Return the motion of a source relative to the floor, and of the floor, mm, at times, ms.

    The kind is ``"section"`` (lines ``outer`` and ``inner`` at each instant), ``"sphere"`` (one
    that is flattened by its ``deflection``) or ``"masses"`` (``deflection`` of belt and rim). None
    for models without a shape. Finite elements have their ``mesh`` and the ``color`` of its
    elements.
    """
    model = impact.case.model
    end = impact.touch_time + TIME_RANGE * impact.contact_time
    times = impact.time if impact.motion is None else impact.motion.time
    chosen = thin_out(np.flatnonzero(times <= end), MAX_INSTANTS)
    floor = impact.floor_displacement if isinstance(impact, FloorImpact) else 0 * impact.time
    answer: Answer = {
        "time": to_json(1e3 * (times[chosen] - impact.touch_time)),
        "floor": to_json(1e3 * floor[chosen]) if impact.motion is None else [],
    }
    if impact.motion is not None:
        return answer | _elements(impact, chosen)
    ball = impact.case.ball
    deflection = to_json(1e3 * impact.deflection[chosen])
    if isinstance(model, HollowSphere | ModalBall):
        size = {"radius": 1e3 * ball.outer_radius, "wall": 1e3 * ball.wall_thickness}
        caption = "A sphere, flattened by the deflection of the ball."
        return answer | size | {"kind": "sphere", "deflection": deflection, "caption": caption}
    if isinstance(model, TwoMass):
        histories = impact.model_histories
        masses = {
            name: to_json(1e3 * (histories[f"{name}_displacement_m"] - floor)[chosen])
            for name in ("belt", "rim")
        }
        caption = "Belt and rim, lowered by their displacements: the model has no other shape."
        return answer | {"kind": "masses", "deflection": masses, "caption": caption}
    return None


def _elements(impact: Impact, chosen: NDArray[np.intp]) -> Answer:
    """Return section, mesh and stresses of finite elements."""
    motion, model = impact.motion, impact.case.model
    assert motion is not None  # noqa: S101 - for the type checker
    depth = motion.floor_displacement[chosen]
    position = motion.position[chosen] + np.stack([0 * depth, depth], -1)[:, None, None]
    lines = thin_out(np.arange(position.shape[1]), MAX_LINES)
    rings = thin_out(np.arange(position.shape[2]), MAX_RINGS)
    mesh = position[:, lines][:, :, rings]
    start = motion.start[lines][:, rings]
    answer = {
        "kind": "section",
        "outer": _lines(mesh[:, :, -1]),
        "inner": _lines(mesh[:, :, 0]),
        "floor": to_json(1e3 * depth),
        "mesh": {"shape": list(start.shape[:2]), "nodes": [_lines(nodes) for nodes in mesh]},
        "caption": "Computed section.",
    }
    if isinstance(model, FiniteElement):
        share = model.mooney_share if model.law == "mooney_rivlin" else 0.0
        modulus, ratio = (number_in(impact.case, key) for key in _ELASTIC)
        stress = mises_stress(start, mesh, modulus / (2 * (1 + ratio)), share)
        answer["color"] = {
            "name": "von Mises stress, elastic part",
            "unit": "kPa",
            "value": [[to_json(1e-3 * row, 3) for row in cells] for cells in stress],
        }
    return answer


def mises_stress(start: Array, position: Array, modulus: float, share: float) -> Array:
    """Return the von Mises stress at the centers of the elements of an axisymmetric mesh, Pa.

    The stress is the elastic part, that of a Mooney–Rivlin material whose fraction of the second
    invariant is `share` (0: neo-Hookean), for a shear modulus, Pa.

    Parameters
    ----------
    start : ndarray, shape (n_line, n_ring, 2)
        Positions of the nodes before the impact, distance from the axis and height, m.
    position : ndarray, shape (n_instant, n_line, n_ring, 2)
        Positions of the nodes, m.

    Returns
    -------
    ndarray, shape (n_instant, n_line - 1, n_ring - 1)
    """
    before, after = _gradients(start), _gradients(position)
    gradient = np.zeros((*after.shape[:-2], 3, 3))
    gradient[..., :2, :2] = after @ np.linalg.inv(before)
    gradient[..., 2, 2] = _centers(position)[..., 0] / _centers(start)[..., 0]
    gradient /= np.cbrt(np.linalg.det(gradient))[..., None, None]
    strain = gradient @ np.swapaxes(gradient, -1, -2)
    stress = modulus * ((1 - share) * strain - share * np.linalg.inv(strain))
    pressure = np.trace(stress, axis1=-2, axis2=-1) / 3
    deviator = stress - pressure[..., None, None] * np.eye(3)
    result: Array = np.sqrt(1.5 * (deviator**2).sum(axis=(-2, -1)))
    return result


def _gradients(position: Array) -> Array:
    """Return the derivatives of positions along both directions of the mesh at the centers."""
    along_lines = np.diff(position, axis=-3)
    along_rings = np.diff(position, axis=-2)
    return np.stack(
        [
            (along_lines[..., 1:, :] + along_lines[..., :-1, :]) / 2,
            (along_rings[..., 1:, :, :] + along_rings[..., :-1, :, :]) / 2,
        ],
        axis=-1,
    )


def _centers(position: Array) -> Array:
    """Return the centers of the elements."""
    pairs = (position[..., 1:, :, :] + position[..., :-1, :, :]) / 2
    return np.asarray((pairs[..., 1:, :] + pairs[..., :-1, :]) / 2)


def _lines(points: Array) -> list[list[list[float]]]:
    """Return lines of points, mm."""
    rounded: list[list[list[float]]] = np.round(1e3 * points, DECIMALS).tolist()
    return rounded
