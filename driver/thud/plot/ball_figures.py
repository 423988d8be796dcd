"""The ball itself: its motion, free modes, material and quasi-static compression."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from thud.base.checks import refuse, require_kind, require_mapping
from thud.base.files import replace_file, require_ending
from thud.impact.compression import CompressionCurve
from thud.impact.free_modes import FreeModes
from thud.impact.impact import Impact
from thud.plot.style import (
    WIDTH,
    add_colorbar,
    add_curves,
    empty_axes,
    finish,
    own_or,
    own_style,
    panel_grid,
)

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from thud.impact.motion import Motion

# Instants of the paper's figure 5, and panels side by side.
INSTANTS = 9
COLUMNS = 3
FRAMES_PER_SECOND = 12
DISPLACEMENT = "Displacement, mm"
# Maximum displacement of a mode in its figure, as a fraction of the radius.
AMPLITUDE = 0.3


def _draw_section(
    axes: Axes, position: NDArray[np.float64], value: NDArray[np.float64], scale: Normalize
) -> None:
    """Draw a half section in colors, with the mesh lines of its surfaces and poles."""
    axes.pcolormesh(
        *np.moveaxis(position, -1, 0), value, shading="gouraud", norm=scale, rasterized=True
    )
    edge = np.concatenate([position[:, 0], position[::-1, -1], position[:1, 0]])
    axes.plot(*edge.T, color="0.1", linewidth=0.6)


@own_style()
def motion(impact: Impact) -> Figure:
    """Draw nine instants of the impact, from first touch to release (paper, figure 5).

    Half sections above the floor show the displacement since first touch, mm, by color. Raise
    InputError if the impact has no snapshots.
    """
    snapshots = _snapshots(impact)
    times = impact.touch_time + np.linspace(0, impact.contact_time, INSTANTS)
    # There are fewer panels if there are fewer snapshots than instants.
    chosen = sorted({int(np.argmin(np.abs(snapshots.time - time))) for time in times})
    figure, panels = panel_grid(len(chosen), COLUMNS, 1.6)
    scale = _scale(snapshots, chosen)
    depth = snapshots.floor_displacement[chosen].max()
    for axes, i in zip(panels, chosen, strict=True):
        _draw_instant(axes, impact, i, scale, depth)
    add_colorbar(figure, panels, ScalarMappable(scale), DISPLACEMENT)
    return figure


@own_style()
def animate(impact: Impact, path: str | os.PathLike[str]) -> None:
    """Save the motion of the ball as an animated GIF, one picture for each snapshot.

    Raise InputError if the impact has no snapshots, or the path does not end with ``.gif``, and
    OSError if the file cannot be written.
    """
    require_ending(path, ".gif")
    snapshots = _snapshots(impact)
    figure, axes = empty_axes(WIDTH)
    count = len(snapshots.time)
    scale = _scale(snapshots, range(count))
    add_colorbar(figure, [axes], ScalarMappable(scale), DISPLACEMENT)

    def draw(i: int) -> list[Any]:
        axes.clear()
        depth = snapshots.floor_displacement.max()
        _draw_instant(axes, impact, i, scale, depth)
        return []

    animation = FuncAnimation(figure, draw, frames=count, blit=False)
    with TemporaryDirectory() as folder:
        file = Path(folder, "motion.gif")
        animation.save(file, dpi=120, writer=PillowWriter(fps=FRAMES_PER_SECOND))
        replace_file(path, file.read_bytes())


def _snapshots(impact: Impact) -> Motion:
    """Return the snapshots of an impact; raise InputError if it has none."""
    require_kind("impact", impact, Impact)
    if impact.motion is None:
        refuse("the impact has no snapshots", "a model with snapshots, snapshot_interval > 0")
    return impact.motion


def _scale(snapshots: Motion, chosen: list[int] | range) -> Normalize:
    """Return the color scale of some snapshots, mm."""
    return Normalize(0, 1e3 * max(_displacement(snapshots, i).max() for i in chosen))


def _displacement(snapshots: Motion, i: int) -> NDArray[np.float64]:
    """Return the displacements since first touch, m, shape (n_line, n_ring)."""
    touch_position = snapshots.start - [0, snapshots.start[..., 1].min()]
    distance: NDArray[np.float64] = np.hypot(*(snapshots.position[i] - touch_position).T).T
    return distance


def _draw_instant(axes: Axes, impact: Impact, i: int, scale: Normalize, depth: float) -> None:
    """Draw the ball and the floor, down to a depth, m."""
    radius = impact.case.ball.outer_radius
    snapshots = _snapshots(impact)
    position = snapshots.position[i]
    floor = -snapshots.floor_displacement[i]
    _draw_section(axes, position, 1e3 * _displacement(snapshots, i), scale)
    lowest = -depth - 0.12 * radius
    axes.fill_between([-0.05 * radius, 1.4 * radius], lowest, floor, color="0.6", linewidth=0)
    elapsed = 1e3 * (snapshots.time[i] - impact.touch_time)
    # Below the floor: above the ball it would be nearer to the floor of the panel above.
    axes.set_title(f"{elapsed:.1f} ms", y=0, pad=-2, verticalalignment="top")
    axes.set_xlim(-0.05 * radius, 1.4 * radius)
    axes.set_ylim(lowest - 0.03 * radius, 2.4 * radius)
    axes.set_aspect("equal")
    axes.set_axis_off()


@own_style()
def mode_shapes(modes: FreeModes, ax: Axes | None = None) -> Figure:
    """Draw mode shapes as half sections, with the outline of the ball at rest (paper, figure 4).

    The color is the displacement divided by its maximum. The axes of a user show the lowest mode.
    """
    require_kind("modes", modes, FreeModes)
    figure, panels = panel_grid(len(modes.frequency), COLUMNS, 1.75, ax=ax)
    radius = modes.ball.outer_radius
    scale = Normalize(0, 1)
    for axes, frequency, harmonic, shape in zip(
        panels, modes.frequency, modes.harmonic, modes.shape, strict=ax is None
    ):
        _draw_section(axes, modes.start + AMPLITUDE * radius * shape, np.hypot(*shape.T).T, scale)
        for surface in (0, -1):
            axes.plot(*modes.start[:, surface].T, color="0.35", linestyle="--", linewidth=0.6)
        axes.set_title(f"{frequency:.1f} Hz, n = {harmonic}")
        axes.set_xlim(-0.05 * radius, 1.35 * radius)
        axes.set_ylim(-1.35 * radius, 1.35 * radius)
        axes.set_axis_off()
        axes.set_aspect("equal")
    add_colorbar(figure, panels, ScalarMappable(scale), "Displacement relative to its maximum")
    return figure


@own_style()
def compression(
    curves: CompressionCurve | Mapping[str, CompressionCurve], ax: Axes | None = None
) -> Figure:
    """Draw forces, N, against the approach of the plates, mm, by their names in the legend.

    They are drawn in a new figure or the stated axes. Raise InputError if there are no curves.
    """
    curves = {"": curves} if isinstance(curves, CompressionCurve) else curves
    require_mapping("curves", curves, "curves")
    for name, curve in curves.items():
        require_kind(name, curve, CompressionCurve)
    axes = own_or(ax, 2.5)
    add_curves(
        axes, {name: (1e3 * curve.deflection, curve.force) for name, curve in curves.items()}
    )
    axes.set_xlim(left=0)
    axes.set_ylim(bottom=0)
    axes.set_xlabel("Approach of the plates, mm")
    axes.set_ylabel("Force, N")
    return finish(axes, ax)
