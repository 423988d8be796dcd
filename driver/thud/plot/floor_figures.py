"""Drops on mobile floors, mobilities and impedances of floors, modes of plates."""

from __future__ import annotations

from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.colors import to_rgba
from matplotlib.patches import Rectangle

from thud.base.bridge import ask
from thud.base.checks import refuse, require_whole
from thud.case.case import Case, case_text
from thud.floors.mobility import mobility
from thud.level.levels import BANDWIDTHS, get_bands, low_pass
from thud.plot.impact_figures import TIME_LABEL
from thud.plot.style import (
    COLORS,
    WIDTH,
    add_colorbar,
    add_curves,
    band_axis,
    curve_style,
    escape_label,
    figure_of,
    finish,
    frequency_axis,
    legend_above,
    new_figure,
    own_or,
    own_panels,
    own_style,
    panel_grid,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from thud.base._schema import FloorOptions
    from thud.case.constructions import Layer
    from thud.floors.impedance import BallImpedance
    from thud.floors.mobility import Mobility
    from thud.floors.mobility_fit import MobilityFit
    from thud.impact.floor_impact import FloorEnergy, FloorImpact


THIRDS = BANDWIDTHS[1]
# Length of the drawn piece of a section and of its scale bar, m; of the piece on paper, inch.
_PIECE, _BAR, _DRAWN = 0.8, 0.2, 1.2
# Height of a label beside a section, inch, of each further line of it, and the maximum number of
# characters in one line.
_LABEL_HEIGHT, _LINE, _LABEL = 0.23, 0.12, 30
# Drawn time, as a multiple of the contact time.
_SHOWN = 1.5
# Maximum density of a layer that is air, kg/m3.
_MAX_AIR = 2.0
# Maximum number of mode shapes, and points along a side of the plate.
MAX_SHAPES, POINTS = 30, 60
# Frequencies per octave in plots of a mobility: peaks of lightly damped floors are narrow.
_DENSITY = 400


@own_style()
def draw_section(layers: Sequence[Layer], title: str = "") -> Figure:
    """Draw the section through layers to scale: a piece of `_PIECE` m.

    Members a distance apart, as joists, stand at this distance; layers of air are white.
    """
    total = sum(layer.thickness for layer in layers)
    scale = _DRAWN / _PIECE
    below = 0.17
    labels = [escape_label(fill(str(layer), _LABEL)) for layer in layers]
    sizes = np.array([_LABEL_HEIGHT + _LINE * label.count("\n") for label in labels])
    height = max(total * scale, sizes.sum()) + below + 0.2 * bool(title)
    figure = new_figure(height)
    figure.set_layout_engine("none")
    axes = figure.add_axes((0, 0, 1, 1))
    # Both axes in inches.
    axes.set(xlim=(-0.02, WIDTH - 0.02), ylim=(height - 0.2 * bool(title), -0.2 * bool(title)))
    axes.set_axis_off()
    if title:
        axes.text(0, -0.08, escape_label(title), va="center")
    materials = list(dict.fromkeys(layer.material for layer in layers))
    # The shorter of drawing and labels is in the middle of the other.
    room = height - below - 0.2 * bool(title)
    top = (room - total * scale) / 2 + 0.02
    positions = (np.cumsum(sizes) - sizes / 2) * (room / sizes.sum())
    for layer, label, position in zip(layers, labels, positions, strict=True):
        color = COLORS[materials.index(layer.material) % len(COLORS)]
        thickness = layer.thickness * scale
        members = _members(layer)
        for left, right in members:
            axes.add_patch(
                Rectangle(
                    (scale * left, top), scale * (right - left), thickness, linewidth=0.5,
                    facecolor="white" if 0 < layer.density < _MAX_AIR else to_rgba(color, 0.5),
                    edgecolor="black",
                )
            )  # fmt: skip
        axes.plot(
            [scale * members[-1][1], _DRAWN + 0.02, _DRAWN + 0.15],
            [top + thickness / 2, top + thickness / 2, position],
            color="black", linewidth=0.4,
        )  # fmt: skip
        axes.text(_DRAWN + 0.2, position, label, va="center", fontsize="small")
        top += thickness
    bar = top + 0.08
    axes.plot([0, scale * _BAR], [bar, bar], color="black", linewidth=1.5, solid_capstyle="butt")
    axes.text(scale * _BAR + 0.06, bar, f"{1e3 * _BAR:g} mm", va="center", fontsize="small")
    return figure


def _members(layer: Layer) -> list[tuple[float, float]]:
    """Return the ends of the parts of a layer along the drawn piece, m."""
    if not layer.spacing:
        return [(0.0, _PIECE)]
    axes = np.arange(_PIECE / 4 % layer.spacing, _PIECE, layer.spacing)
    half = layer.width / 2
    return [(max(x - half, 0.0), min(x + half, _PIECE)) for x in axes]


@own_style()
def draw_floor(impact: FloorImpact, ax: Axes | None = None) -> Figure:
    """Draw force and floor velocity, the change of the levels, the energy, and the mobility.

    The axes of a user show the forces.
    """
    history, *others = own_panels(ax, 6.4, 5)
    time = 1e3 * (impact.time - impact.touch_time)
    shown = (time >= 0) & (time <= 1e3 * _SHOWN * impact.contact_time)
    forces = {"blocked force": impact.blocked_force, "contact force": impact.floor_force}
    recorded = {
        name: (time[shown], 1e-3 * low_pass(force, impact.sample_rate)[shown])
        for name, force in forces.items()
    }
    add_curves(history, recorded)
    history.set_ylabel("Force on the\nfloor, kN")
    history.margins(x=0)
    title = "Forces are low-passed at 1.25 kHz"
    if not others:
        history.set_xlabel(TIME_LABEL)
        return finish(history, ax, title)
    motion, change, energy, mobilities = others
    motion.plot(time[shown], 1e3 * impact.floor_velocity[shown], color=COLORS[2], linewidth=1)
    motion.set_ylabel("Velocity of\nthe floor, mm/s")
    motion.set_xlabel(TIME_LABEL)
    motion.sharex(history)
    history.tick_params(labelbottom=False)
    change.bar(
        np.arange(len(get_bands(THIRDS).nominal)), impact.difference(THIRDS), color=COLORS[0],
        width=0.7,
    )  # fmt: skip
    change.axhline(0, color="black", linewidth=0.6)
    change.set_ylabel("Contact −\nblocked, dB")
    draw_energy(impact.injected_energy(THIRDS), energy)
    energy.sharex(change)
    change.tick_params(labelbottom=False)
    bands = get_bands(THIRDS)
    low, high = bands.lower[0], bands.upper[-1]
    frequency = np.geomspace(low, high, int(_DENSITY * np.log2(high / low)))
    _add_mobility(mobilities, mobility(impact.floor, frequency))
    figure = figure_of(history)
    figure.align_ylabels()
    legend_above(history, motion, mobilities, title=title)
    return figure


@own_style()
def draw_energy(injected: FloorEnergy, ax: Axes | None = None) -> Figure:
    """Draw the energy that a force transfers to a floor against its bands."""
    axes = own_or(ax, 2.0)
    axes.set_yscale("log")
    axes.plot(1e3 * injected.energy, **curve_style(0))
    axes.set_ylabel("Energy into\nthe floor, mJ")
    is_third = len(injected.frequency) == len(get_bands(THIRDS).nominal)
    band_axis(axes, THIRDS if is_third else "octave")
    return finish(axes, ax)


@own_style()
def draw_mobility(mobility: Mobility, ax: Axes | None = None) -> Figure:
    """Draw magnitude and real part of a mobility against frequency."""
    axes = own_or(ax, 2.4)
    _add_mobility(axes, mobility)
    return finish(axes, ax)


def _add_mobility(axes: Axes, drawn: Mobility) -> None:
    # A thin line on a thick one: the mobility of an infinite plate is real.
    axes.loglog(drawn.frequency, abs(drawn.values), label="$|Y|$", color="0.7", linewidth=2.4)
    axes.loglog(
        drawn.frequency, drawn.values.real, label=r"$\mathrm{Re}\,Y$", color="black",
        linewidth=0.8,
    )  # fmt: skip
    axes.set_ylabel("Mobility $Y$,\nm/(N s)")
    axes.set_xlim(drawn.frequency[0], drawn.frequency[-1])
    frequency_axis(axes)


@own_style()
def plate_modes(floor: FloorOptions, count: int = 6, columns: int = 3) -> Figure:
    """Draw the lowest mode shapes of the plate of a floor that radiates into the room below.

    Parameters
    ----------
    floor
        A floor of rectangular plates.
    count
        Number of shapes.
    columns
        Shapes side by side.
    """
    require_whole("count", count, 1, MAX_SHAPES)
    require_whole("columns", columns, 1, MAX_SHAPES)
    grid = np.meshgrid(*[np.linspace(0, 1, POINTS)] * 2)
    x, y = (coordinate.ravel() for coordinate in grid)
    case = case_text(Case(floor=floor))
    modes = ask("floor_modes", case=case, highest=1e6, count=float(count), x=x, y=y)
    frequency = modes["frequency"]
    if not len(frequency):
        refuse(f"floor: no mode lies below {modes['limit']:.0f} Hz", "a floor with modes")
    length, width = modes["length"], modes["width"]
    columns = min(columns, len(frequency))
    height = WIDTH / columns * width / length + 0.25
    figure, panels = panel_grid(len(frequency), columns, height)
    for axes, natural, values in zip(panels, frequency, modes["shape"], strict=True):
        shape = values.reshape(POINTS, POINTS) / values[np.argmax(abs(values))]
        drawn = axes.pcolormesh(
            length * grid[0], width * grid[1], shape, cmap="RdBu_r", vmin=-1, vmax=1,
            rasterized=True,
        )  # fmt: skip
        axes.set_axis_off()
        axes.set_aspect("equal")
        axes.set_title(f"{natural:.1f} Hz")
    add_colorbar(figure, panels, drawn, "Displacement relative to its maximum")
    return figure


@own_style()
def draw_mobility_fit(fit: MobilityFit, ax: Axes | None = None) -> Figure:
    """Draw magnitude and phase of measurement and fit against frequency."""
    upper, *lower = panels = own_panels(ax, 3.6, 2, sharex=True)
    measured = fit.measured
    fitted = mobility(fit.floor, np.geomspace(measured.frequency[0], measured.frequency[-1], 2000))
    label = f"fitted: relative error {100 * fit.error:.2g} %"
    for drawn, style in (
        (measured, {"linestyle": "none", "marker": ".", "color": "0.55", "markersize": 2.5,
                    "label": "measured"}),
        (fitted, {"color": COLORS[0], "label": label}),
    ):  # fmt: skip
        upper.loglog(drawn.frequency, abs(drawn.values), **style)
        for axes in lower:
            axes.plot(drawn.frequency, np.degrees(np.angle(drawn.values)), **style)
            axes.set_ylabel("Phase, degrees")
            axes.set_yticks([-90, 0, 90])
    upper.set_ylabel("Mobility, m/(N s)")
    frequency_axis(panels[-1])
    return finish(upper, ax)


@own_style()
def ball_impedances(
    sources: Mapping[str, BallImpedance], floors: Mapping[str, FloorOptions], ax: Axes | None = None
) -> Figure:
    """Draw the impedances of sources as filled markers, and of floors as lines.

    Floors below the open markers change the level of the force by more than 1 dB.
    """
    axes = own_or(ax, 2.8)
    bands = get_bands("third").center
    impedances = {name: (bands, 1 / band_mobility(floor, bands)) for name, floor in floors.items()}
    add_curves(axes, impedances)
    for i, (name, source) in enumerate(sources.items()):
        # Markers side by side: equal impedances stay visible.
        x = source.frequency * 1.08 ** (i - (len(sources) - 1) / 2)
        style = {**curve_style(i, 4), "color": "black", "linestyle": "none"}
        axes.plot(x, np.abs(source.impedance), label=escape_label(name) or "source", **style)
        label = "open: limit of 1 dB" if i == len(sources) - 1 else None
        axes.plot(x, source.limit(), fillstyle="none", label=label, **style)
    axes.set_yscale("log")
    frequency_axis(axes)
    axes.set_ylabel("Impedance, N s/m")
    return finish(axes, ax)


def band_mobility(floor: FloorOptions, bands: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the root mean square of a floor's mobility in one-third octaves around `bands`, Hz."""
    frequency = np.multiply.outer(bands, np.geomspace(2 ** (-1 / 6), 2 ** (1 / 6), 61))
    values = mobility(floor, frequency.ravel()).values.reshape(frequency.shape)
    squares: NDArray[np.float64] = np.mean(np.abs(values) ** 2, axis=1)
    return np.sqrt(squares)
