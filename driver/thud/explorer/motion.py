"""Motion of the source for the page: its section at some instants, and stresses of elements."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.signal import lfilter

from thud.base._schema import Ball, FiniteElement, HollowSphere, ModalBall, Modes, TwoMass
from thud.base.bridge import ask
from thud.case.case import Case, case_text
from thud.case.keys import number_in, value_in
from thud.explorer.series import TIME_RANGE, thin_out, to_json
from thud.impact.floor_impact import FloorImpact
from thud.impact.free_modes import new_modes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from thud.impact.free_modes import FreeModes
    from thud.impact.impact import Impact

    Array = NDArray[np.float64]
    Answer = dict[str, Any]

# Maximum number of instants of a motion, and of lines and rings of nodes of a mesh.
MAX_INSTANTS = 30
MAX_LINES, MAX_RINGS = 33, 5
# Decimals of positions, mm.
DECIMALS = 1
# Free modes of the section of a modal ball.
MODES = 12
# Minimum amplitude of the lowest point of an excited mode, relative to its maximum.
MIN_AMPLITUDE = 1e-6
# Keys of the elasticity of the ball.
_ELASTIC = ("youngs_modulus", "poisson_ratio")
# Number of contact radii for which the forces on the modes are tabulated.
RADII = 24


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
    if isinstance(model, ModalBall):
        return answer | _modal_section(impact, chosen)
    ball = impact.case.ball
    deflection = to_json(1e3 * impact.deflection[chosen])
    if isinstance(model, HollowSphere):
        size = {"radius": 1e3 * ball.outer_radius, "wall": 1e3 * ball.wall_thickness}
        caption = "Shape that the model assumes: a sphere, flattened by its deflection."
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


@lru_cache(maxsize=8)
def _modes(radius: float, wall: float, mass: float, modulus: float, ratio: float) -> FreeModes:
    # Without the warnings on free modes, which the page does not show.
    case = Case(ball=Ball(radius, wall, mass, modulus, ratio), model=None, modes=Modes(MODES))
    return new_modes(case.ball, ask("solve", case=case_text(case)))


def _modal_section(impact: Impact, chosen: NDArray[np.intp]) -> Answer:
    """Return the section of a modal ball: its first free modes under the computed force.

    The force is spread over the computed contact radius as Hertz's pressure. What faster modes add,
    a local flattening, is replaced by that of the floor.
    """
    ball, model = impact.case.ball, impact.case.model
    assert isinstance(model, ModalBall)  # noqa: S101 - for the type checker
    modes = _modes(
        ball.outer_radius,
        ball.wall_thickness,
        ball.mass,
        *(number_in(impact.case, key) for key in _ELASTIC),
    )
    pole = modes.shape[:, 0, -1, 1]
    # Shapes of unit modal mass; a mode whose lowest point rests is not excited.
    moves = np.abs(pole) > MIN_AMPLITUDE
    scale = np.sqrt(modes.participation / ball.mass) / np.where(moves, pole, np.inf)
    shapes = modes.shape * scale[:, None, None, None]
    loads = _loads(modes.start[:, -1, 0], shapes[:, :, -1, 1], impact, ball.outer_radius)
    omega = 2 * math.pi * modes.frequency
    damping = np.minimum(_loss_factors(impact.case, modes.frequency) / 2, 0.99)
    amplitudes = np.array(
        [
            _response(load, w, z, 1 / impact.sample_rate)[chosen]
            for load, w, z in zip(loads, omega, damping, strict=True)
        ]
    )
    center = ball.outer_radius - impact.deflection[chosen]
    sections = []
    lines = thin_out(np.arange(len(modes.start)), MAX_LINES)
    contact_radius = impact.model_histories["contact_radius_m"][chosen]
    lower = slice(None, len(lines) // 2)
    for ring in (-1, 0):
        start, shape = modes.start[lines, ring], shapes[:, lines, ring]
        line = start + np.einsum("ki,klc->ilc", amplitudes, shape)
        line[..., 1] = np.maximum(line[..., 1] + center[:, None], 0.0)
        if ring == -1:
            line[:, lower, 1] *= line[:, lower, 0] > contact_radius[:, None]
        sections.append(_lines(line))
    caption = f"{MODES} free modes of the ball under the computed force, flattened by the floor."
    return {"kind": "section", "outer": sections[0], "inner": sections[1], "caption": caption}


def _loss_factors(case: Case, frequency: Array) -> Array:
    """Return the loss factor of the modes of a modal ball."""
    order = {"constant": 0.0, "rising": 1.0}.get(
        str(value_in(case, "damping_law")), number_in(case, "fractional_order")
    )
    loss, reference = number_in(case, "loss_factor"), number_in(case, "loss_frequency")
    result: Array = loss * (frequency / reference) ** order
    return result


def _loads(distance: Array, upward: Array, impact: Impact, radius: float) -> Array:
    """Return the force on each mode, N/sqrt(kg), shape (n_mode, n_sample).

    `distance` is that of the nodes of the outer surface from the axis, from the lowest point on,
    and `upward` their displacement upwards, shape (n_mode, n_line).
    """
    lower = slice(None, int(np.argmax(distance)) + 1)
    radii = np.linspace(0.0, radius * math.sin(math.pi / 3), RADII)
    # Midpoints of rings of equal force below Hertz's pressure.
    fractions = (np.arange(16) + 0.5) / 16
    rings = np.sqrt(1 - (1 - fractions) ** (2 / 3))
    points = np.outer(radii, rings)
    table = [np.interp(points, distance[lower], row[lower]).mean(axis=1) for row in upward]
    contact = impact.model_histories["contact_radius_m"]
    return np.array([impact.floor_force * np.interp(contact, radii, row) for row in table])


def _response(force: Array, omega: float, damping: float, step: float) -> Array:
    """Return the amplitude of a mode of unit mass under a force that is constant in each step."""
    damped = omega * math.sqrt(1 - damping**2)
    decay = math.exp(-damping * omega * step)
    cosine, sine = math.cos(damped * step), math.sin(damped * step)
    sine_part = damping * omega / damped * sine
    first = (1 - decay * (cosine + sine_part)) / omega**2
    second = (decay**2 - decay * (cosine - sine_part)) / omega**2
    return np.asarray(lfilter([0, first, second], [1, -2 * decay * cosine, decay**2], force))


def _lines(points: Array) -> list[list[list[float]]]:
    """Return lines of points, mm."""
    rounded: list[list[list[float]]] = np.round(1e3 * points, DECIMALS).tolist()
    return rounded
