"""Figures of the finite elements: mode shapes, the deforming ball, loss factors."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

from thud.checks import replace_file, require_kind
from thud.errors import InputError
from thud.free_modes import FreeModes, loss_factors
from thud.impact import Impact
from thud.plot import SIZE, WIDTH, add_curves, empty_axes

if TYPE_CHECKING:
    import os

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from thud.models import FiniteElement
    from thud.motion import Motion

# A map that grows in lightness only, for any colour vision and for print.
COLOURS = "cividis"
# Part of the radius that the largest displacement of a mode is drawn with.
AMPLITUDE = 0.3
# Instants of the paper's figure 5.
INSTANTS = 9
# Nodes between two arrows, from pole to pole and through the wall.
ARROWS = (4, 4)
FRAMES_PER_SECOND = 12
# More would not be readable at column width.
MAX_PANELS = 30


def mode_shapes(modes: FreeModes, columns: int = 3) -> Figure:
    """Draw mode shapes as half sections over the outline of the ball at rest (paper, figure 4).

    Parameters
    ----------
    modes
        The modes.
    columns
        Shapes side by side.

    Returns
    -------
    Figure
        One half section for each mode; the colour is the displacement over its largest.
    """
    require_kind("modes", modes, FreeModes)
    _require_count("columns", columns)
    count = len(modes.frequency)
    rows = -(-count // columns)
    # More than three side by side need more than a column.
    width = WIDTH * max(1, columns / 3)
    figure = Figure(figsize=(width, 0.45 + 1.75 * rows), dpi=300, layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    radius = modes.ball.outer_radius
    scale = Normalize(0, 1)
    for axes, frequency, harmonic, shape in zip(
        panels, modes.frequency, modes.harmonic, modes.shape, strict=False
    ):
        _draw_section(axes, modes.start + AMPLITUDE * radius * shape, np.hypot(*shape.T).T, scale)
        _draw_outline(axes, modes.start)
        axes.set_title(f"{frequency:.1f} Hz, n = {harmonic}", fontsize=SIZE, pad=2)
        axes.set_xlim(-0.05 * radius, 1.35 * radius)
        axes.set_ylim(-1.35 * radius, 1.35 * radius)
    for axes in panels:
        axes.set_axis_off()
        axes.set_aspect("equal")
    _add_colour_bar(figure, panels, scale, "Displacement over its largest")
    return figure


def motion(impact: Impact, instants: int = INSTANTS) -> Figure:
    """Draw instants of the impact: displacement by colour, velocity by arrows (paper, figure 5).

    Parameters
    ----------
    impact
        An impact with snapshots.
    instants
        Number of instants, at even times from first touch to release.

    Returns
    -------
    Figure
        Half sections on the floor; displacement since first touch in mm, time in ms.
    """
    shown = _snapshots(impact)
    _require_count("instants", instants)
    wanted = impact.touch_time + np.linspace(0, impact.contact_time, instants)
    # Fewer panels where there are fewer snapshots.
    chosen = sorted({int(np.argmin(np.abs(shown.time - time))) for time in wanted})
    rows = -(-len(chosen) // 3)
    figure = Figure(figsize=(WIDTH, 0.6 + 1.6 * rows), dpi=300, layout="constrained")
    panels = figure.subplots(rows, 3, squeeze=False).ravel()
    scale = Normalize(0, 1e3 * max(_displacement(shown, i).max() for i in chosen))
    for axes, i in zip(panels, chosen, strict=False):
        _draw_instant(axes, impact, shown, i, scale)
    for axes in panels:
        axes.set_axis_off()
    _add_colour_bar(figure, panels, scale, _motion_label(impact))
    return figure


def animate(impact: Impact, path: str | os.PathLike[str]) -> None:
    """Save the motion of the ball as an animated GIF, one picture for each snapshot.

    Parameters
    ----------
    impact
        An impact with snapshots.
    path
        Path of the file, which ends with ``.gif``.

    Raises
    ------
    InputError
        Where the impact has no snapshots or the path another ending.
    OSError
        Where the file cannot be written.
    """
    if Path(path).suffix.lower() != ".gif":
        message = f"{path}: this ending is not known; allowed: .gif"
        raise InputError(message)
    shown = _snapshots(impact)
    figure = Figure(figsize=(WIDTH, WIDTH), dpi=120, layout="constrained")
    axes = figure.subplots()
    scale = Normalize(0, 1e3 * max(_displacement(shown, i).max() for i in range(len(shown.time))))
    _add_colour_bar(figure, [axes], scale, _motion_label(impact))

    def draw(i: int) -> list[Any]:
        axes.clear()
        _draw_instant(axes, impact, shown, i, scale)
        axes.set_axis_off()
        return []

    animation = FuncAnimation(figure, draw, frames=len(shown.time), blit=False)
    part = Path(path).with_name(f".{Path(path).name}.part.gif")
    try:
        animation.save(part, writer=PillowWriter(fps=FRAMES_PER_SECOND))
        replace_file(path, part.read_bytes())
    finally:
        part.unlink(missing_ok=True)


def loss_factor(models: Mapping[str, FiniteElement]) -> Figure:
    """Draw the loss factor of materials against frequency.

    Parameters
    ----------
    models
        Finite-element models by their names in the legend.

    Returns
    -------
    Figure
        Frequency in Hz and loss factor, both logarithmic.
    """
    if not isinstance(models, Mapping) or not models:
        message = "models are not given; allowed: a mapping of names to models, at least one"
        raise InputError(message)
    figure, axes = empty_axes(2.5)
    frequency = np.geomspace(10, 1000, 200)
    add_curves(axes, {name: (frequency, loss_factors(m, frequency)) for name, m in models.items()})
    axes.set_xscale("log")
    axes.set_yscale("log")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter("{x:g}")
    axes.set_xlabel("Frequency, Hz", fontsize=SIZE)
    axes.set_ylabel("Loss factor", fontsize=SIZE)
    axes.legend(fontsize=SIZE, frameon=False)
    return figure


def _require_count(name: str, value: object) -> None:
    """Complain about a number of panels that no figure has."""
    if not isinstance(value, int) or not 1 <= value <= MAX_PANELS:
        message = f"{name} = {value!r} is not allowed; allowed: 1 to {MAX_PANELS}"
        raise InputError(message)


def _motion_label(impact: Impact) -> str:
    """Return what colours and arrows mean."""
    return f"Displacement, mm (arrows: a third of the radius is {impact.impact_velocity:.1f} m/s)"


def _snapshots(impact: Impact) -> Motion:
    """Return the snapshots of an impact that has some."""
    require_kind("impact", impact, Impact)
    if impact.motion is None:
        message = "the impact has no snapshots; allowed: finite_element with snapshot_interval > 0"
        raise InputError(message)
    return impact.motion


def _displacement(shown: Motion, i: int) -> NDArray[np.float64]:
    """Return the displacements since first touch, m, shape (n_line, n_ring)."""
    touching = shown.start - [0, shown.start[..., 1].min()]
    length: NDArray[np.float64] = np.hypot(*(shown.position[i] - touching).T).T
    return length


def _draw_instant(axes: Axes, impact: Impact, shown: Motion, i: int, scale: Normalize) -> None:
    """Draw the ball at one instant, its velocities and the floor."""
    radius = impact.case.ball.outer_radius
    place = shown.position[i]
    _draw_section(axes, place, 1e3 * _displacement(shown, i), scale)
    some = (slice(None, None, ARROWS[0]), slice(None, None, ARROWS[1]))
    axes.quiver(
        *place[some].reshape(-1, 2).T,
        *shown.velocity[i][some].reshape(-1, 2).T,
        angles="xy",
        scale_units="xy",
        # At first touch an arrow is as long as a third of the radius.
        scale=3 * impact.impact_velocity / radius,
        width=0.008,
        color="0.1",
    )
    axes.fill_between([-0.05 * radius, 1.4 * radius], -0.12 * radius, 0, color="0.6", linewidth=0)
    since = 1e3 * (shown.time[i] - impact.touch_time)
    axes.set_title(f"{since:.1f} ms", fontsize=SIZE, pad=2)
    axes.set_xlim(-0.05 * radius, 1.4 * radius)
    axes.set_ylim(-0.4 * radius, 2.6 * radius)
    axes.set_aspect("equal")


def _draw_section(
    axes: Axes, place: NDArray[np.float64], value: NDArray[np.float64], scale: Normalize
) -> None:
    """Draw a half section in colours, with the mesh lines of its surfaces and poles."""
    lines, rings = value.shape
    number = np.arange(lines * rings).reshape(lines, rings)
    corners = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
    a, b, c, d = (corner.ravel() for corner in corners)
    triangles = np.concatenate([np.stack((a, b, c), 1), np.stack((a, c, d), 1)])
    r, z = place.reshape(-1, 2).T
    mesh = Triangulation(r, z, triangles)
    axes.tripcolor(
        mesh, value.ravel(), shading="gouraud", cmap=COLOURS, norm=scale, rasterized=True
    )
    edge = np.concatenate([place[:, 0], place[::-1, -1], place[:1, 0]])
    axes.plot(*edge.T, color="0.1", linewidth=0.6)


def _draw_outline(axes: Axes, place: NDArray[np.float64]) -> None:
    """Draw the outline of the ball at rest."""
    surfaces = LineCollection(
        [place[:, 0], place[:, -1]], colors="0.35", linestyles="--", linewidths=0.6
    )
    axes.add_collection(surfaces)


def _add_colour_bar(figure: Figure, panels: Any, scale: Normalize, label: str) -> None:  # noqa: ANN401 - axes or an array of them
    """Add the scale of the colours below the panels."""
    colours = mpl.cm.ScalarMappable(scale, COLOURS)
    bar = figure.colorbar(colours, ax=panels, location="bottom", shrink=0.7, aspect=30, pad=0.02)
    bar.set_label(label, fontsize=SIZE)
    bar.ax.tick_params(labelsize=SIZE)
