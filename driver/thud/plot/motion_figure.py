"""The deforming ball: instants of the impact (paper, figure 5), and an animation."""

import os
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.quiver import Quiver, QuiverKey
from numpy.typing import NDArray

from thud.base.checks import require_kind
from thud.base.errors import InputError
from thud.base.files import replace_file
from thud.impact.impact import Impact
from thud.impact.motion import Motion
from thud.plot.documentation_impacts import solve_chipboard, solve_published
from thud.plot.half_section import add_colour_bar, draw_section, require_panels
from thud.plot.style import SIZE, WIDTH, new_figure, own_style

# Instants of the paper's figure 5.
INSTANTS = 9
# Nodes between two arrows, from pole to pole and through the wall.
ARROWS = (6, 4)
FRAMES_PER_SECOND = 12
LABEL = "Displacement of the material, mm"


@own_style()
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
        Half sections on the floor where it is; displacement since first touch in mm, time in ms.

    Raises
    ------
    InputError
        Where the impact has no snapshots, or there are too many instants.
    """
    shown = _snapshots(impact)
    require_panels("instants", instants)
    wanted = impact.touch_time + np.linspace(0, impact.contact_time, instants)
    # Fewer panels where there are fewer snapshots.
    chosen = sorted({int(np.argmin(np.abs(shown.time - time))) for time in wanted})
    rows = -(-len(chosen) // 3)
    figure = new_figure(0.6 + 1.6 * rows)
    panels = figure.subplots(rows, 3, squeeze=False).ravel()
    scale = _scale(shown, chosen)
    depth = shown.floor_displacement[chosen].max()
    for axes, i in zip(panels, chosen, strict=False):
        arrows = _draw_instant(axes, impact, i, scale, depth)
    for axes in panels:
        axes.set_axis_off()
    add_colour_bar(figure, panels, scale, LABEL)
    _add_key(panels[0], arrows, impact)
    return figure


@own_style()
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
    count = len(shown.time)
    scale = _scale(shown, range(count))
    add_colour_bar(figure, [axes], scale, LABEL)

    def draw(i: int) -> list[Any]:
        axes.clear()
        depth = shown.floor_displacement.max()
        _add_key(axes, _draw_instant(axes, impact, i, scale, depth), impact)
        axes.set_axis_off()
        return []

    animation = FuncAnimation(figure, draw, frames=count, blit=False)
    with TemporaryDirectory() as folder:
        whole = Path(folder, "motion.gif")
        animation.save(whole, writer=PillowWriter(fps=FRAMES_PER_SECOND))
        replace_file(path, whole.read_bytes())


def _snapshots(impact: Impact) -> Motion:
    """Return the snapshots of an impact; raise InputError where it has none."""
    require_kind("impact", impact, Impact)
    if impact.motion is None:
        message = (
            "the impact has no snapshots; allowed: a model with snapshots, snapshot_interval > 0"
        )
        raise InputError(message)
    return impact.motion


def _scale(shown: Motion, chosen: list[int] | range) -> Normalize:
    """Return the scale of the colours of some snapshots, mm."""
    return Normalize(0, 1e3 * max(_displacement(shown, i).max() for i in chosen))


def _displacement(shown: Motion, i: int) -> NDArray[np.float64]:
    """Return the displacements since first touch, m, shape (n_line, n_ring)."""
    touching = shown.start - [0, shown.start[..., 1].min()]
    length: NDArray[np.float64] = np.hypot(*(shown.position[i] - touching).T).T
    return length


def _draw_instant(axes: Axes, impact: Impact, i: int, scale: Normalize, depth: float) -> Quiver:
    """Draw the ball, its velocities and the floor at one instant; return the arrows.

    The floor is shown down to a depth in m, and a little further.
    """
    radius = impact.case.ball.outer_radius
    shown = _snapshots(impact)
    place = shown.position[i]
    floor = -shown.floor_displacement[i]
    draw_section(axes, place, 1e3 * _displacement(shown, i), scale)
    some = (slice(None, None, ARROWS[0]), slice(None, None, ARROWS[1]))
    start, velocity = (field[some].reshape(-1, 2) for field in (place, shown.velocity[i]))
    # At first touch an arrow is as long as a third of the radius.
    unit = 3 * impact.impact_velocity / radius
    above = start[:, 1] + velocity[:, 1] / unit >= floor
    arrows = axes.quiver(
        *start[above].T,
        *velocity[above].T,
        angles="xy",
        scale_units="xy",
        scale=unit,
        width=0.014,
        color="0.1",
        # A light edge shows arrows on dark colours.
        path_effects=[withStroke(linewidth=1, foreground="white")],
    )
    lowest = -depth - 0.12 * radius
    axes.fill_between([-0.05 * radius, 1.4 * radius], lowest, floor, color="0.6", linewidth=0)
    since = 1e3 * (shown.time[i] - impact.touch_time)
    axes.set_title(f"{since:.1f} ms", fontsize=SIZE, pad=2)
    axes.set_xlim(-0.05 * radius, 1.4 * radius)
    axes.set_ylim(lowest - 0.03 * radius, 2.4 * radius)
    axes.set_aspect("equal")
    return arrows


def _add_key(axes: Axes, arrows: Quiver, impact: Impact) -> None:
    """Show the size of a round velocity beside the label of the colours."""
    velocity = float(f"{impact.impact_velocity:.1g}")
    figure = axes.get_figure(root=True)
    assert figure is not None  # noqa: S101 - the axes are new
    # In parts of the figure: a key in inches would be lost where notebooks crop the figure.
    x, y = np.array([WIDTH - 0.52, 0.11]) / figure.get_size_inches()
    key = QuiverKey(
        arrows, x, y, velocity, f"{velocity:g} m/s", labelpos="E", coordinates="figure",
        fontproperties={"size": SIZE},
    )  # fmt: skip
    axes.add_artist(key)


def _draw(impact: Impact | None) -> Figure | None:
    """Draw the motion of an impact that has snapshots."""
    return motion(impact) if impact and impact.motion else None


IMPACT_FIGURES = {"motion": _draw, "floor_motion": lambda impact: _draw(impact.on_floor)}
DOCUMENTATION_FIGURES = {
    "figure5_motion": lambda: motion(solve_published()),
    "floor_motion": lambda: _draw(solve_chipboard().on_floor),
}
