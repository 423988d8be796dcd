"""Sketches of the source models, with the symbols of their pages."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.patches import Polygon
from numpy.polynomial import legendre
from sketch import (
    BLUE,
    GREEN,
    INK,
    RED,
    SOLID,
    arrow,
    block,
    dashpot,
    floor,
    measure,
    panels,
    spring,
    text,
)

import thud

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def ring(axes: Axes, outer: np.ndarray, inner: np.ndarray) -> None:
    """Draw what lies between two closed curves."""
    axes.add_patch(Polygon(np.concatenate([outer, inner[::-1]]), facecolor=SOLID, zorder=1))
    for curve in (outer, inner):
        axes.plot(*curve.T, color=INK, linewidth=1.1, zorder=2)


def circle(radius: float, depth: float, turns: np.ndarray) -> np.ndarray:
    """Return points of a circle about (0, 1 - depth), none below the floor."""
    x, y = radius * np.sin(turns), 1 - depth - radius * np.cos(turns)
    return np.stack([x, np.maximum(y, 1 - radius)], 1)


def hollow_sphere() -> Figure:
    """Draw the shell before and during the contact, and the forces on cap and shell."""
    figure, (before, after) = panels([(-2.35, 2.65, -0.25, 2.45)], [(-2.35, 2.65, -0.5, 2.15)])
    turns = np.linspace(0, 2 * np.pi, 400)
    ring(before, circle(1, 0, turns), circle(0.64, 0, turns))
    floor(before, -1.5, 1.5)
    arrow(before, (0, 1.0), (0.5, 1.86), arrowstyle="-|>")
    text(before, 0.08, 1.4, "$R$")
    measure(before, (-1.0, 1.0), (-0.64, 1.0), "$h$", dy=0.17)
    arrow(before, (1.35, 1.6), (1.35, 0.9), BLUE)
    text(before, 1.35, 1.78, "$v_0$", color=BLUE)
    text(before, 0, 0.82, "gas: $p_a + p_g$")
    text(before, 0, 2.3, "first touch, $\\delta = 0$")

    depth = 0.33
    ring(after, circle(1, depth, turns), circle(0.64, depth, turns))
    floor(after, -2.1, 2.1)
    half = np.sqrt(1 - (1 - depth) ** 2)
    cap = np.linspace(-np.arccos(1 - depth), np.arccos(1 - depth), 60)
    after.plot(np.sin(cap), 1 - depth - np.cos(cap), color=INK, linewidth=0.8, linestyle=":")
    after.plot([-half, half], [0.015, 0.015], color=RED, linewidth=3, zorder=4)
    measure(after, (1.0, 0), (1.0, -depth), "$\\delta$", dx=0.16, dy=-0.1)
    after.plot([0.1, 1.05], [-depth, -depth], color="0.5", linewidth=0.5)
    arrow(after, (-1.25, 1.35), (-1.25, 0.7), BLUE)
    text(after, -1.25, 1.52, "$\\delta'$", color=BLUE)
    arrow(after, (0, 0.05), (0, 0.55), RED, linewidth=1.6)
    text(after, 0, 0.75, "$F_B + F_G$", color=RED, ha="center")
    text(after, 1.05, 1.45, "moves with $\\delta'$:\n$m = M\\,(1 - \\delta/2R)$", ha="left")
    text(after, 1.25, 0.68, "flat cap,\nat rest:\n$M\\,\\delta/2R$", ha="left", color=RED)
    arrow(after, (1.22, 0.45), (half + 0.02, 0.03), RED, linewidth=0.8, mutation_scale=6)
    for side in (-1, 1):
        arrow(after, (side * 0.86, 0.36), (side * 0.79, 0.04), GREEN, mutation_scale=7)
    text(after, -1.55, 0.3, "flux\n$(M/2R)\\,\\delta'^2$", color=GREEN)
    text(after, 0, 1.9, "contact")
    return figure


def mode(harmonic: int, amplitude: float) -> np.ndarray:
    """Return the outline of a sphere in one mode, pole down, as points about its middle."""
    turns = np.linspace(0, 2 * np.pi, 300)
    shape = legendre.Legendre.basis(harmonic)
    slope = -np.sin(turns) * shape.deriv()(np.cos(turns))
    radial, along = amplitude * shape(np.cos(turns)), 0.3 * amplitude * slope
    x = (1 + radial) * np.sin(turns) + along * np.cos(turns)
    y = -(1 + radial) * np.cos(turns) + along * np.sin(turns)
    return np.stack([x, y], 1)


def modal_ball() -> Figure:
    """Draw three modes, and the rings that may touch the floor."""
    figure, axes = panels(
        [(-1.35, 1.35, -1.3, 1.3)] * 2, [(-1.35, 1.35, -1.35, 1.5), (-1.3, 1.85, -1.35, 1.5)]
    )
    still = mode(2, 0.0)
    for harmonic, panel in zip((2, 3, 4), axes, strict=False):
        panel.plot(*still.T, color="0.6", linewidth=0.8, linestyle=":")
        for sign, style in ((1, "-"), (-1, "--")):
            panel.plot(*mode(harmonic, 0.17 * sign).T, color=BLUE, linewidth=1.1, linestyle=style)
        text(panel, 0, 0, f"$n = {harmonic}$\n$U\\,P_n$\n$V\\,dP_n/d\\theta$", linespacing=1.6)
    last = axes[3]
    outline = mode(2, -0.05)
    last.plot(*outline.T, color=INK, linewidth=1.1)
    floor(last, -1.2, 1.3, top=-1.02)
    last.plot([0, 0], [0, -0.95], color="0.5", linewidth=0.6)
    for angle in np.radians([0, 12, 24, 36, 48, 60]):
        point = outline[np.argmin(abs(np.linspace(0, 2 * np.pi, 300) - angle))]
        last.plot(*point, "o", color=RED, markersize=3.5)
        touching = angle < np.radians(20)
        if touching:
            arrow(last, (point[0], point[1]), (point[0], point[1] + 0.3), RED, mutation_scale=7)
    last.plot([0, point[0]], [0, point[1]], color="0.5", linewidth=0.6)
    text(last, 0.22, -0.4, "$\\theta_i$")
    gap = ((point[0], point[1] - 0.05), (point[0], -1.02))
    measure(last, *gap, "$g_i \\geq 0$", dx=0.12, ha="left")
    text(last, -0.13, -0.42, "$p_i \\geq 0$", color=RED, ha="right")
    text(last, 0.1, 1.3, "rings: $p_i\\,g_i = 0$")
    return figure


def finite_elements() -> Figure:
    """Draw the mesh of the standard ball at rest and at its largest deflection, and what acts."""
    impact = thud.solve(
        model="finite_element", radial_elements=4, polar_elements=32, snapshot_interval=1e-3
    )
    motion = impact.motion
    i = int(np.argmin(abs(motion.time - impact.time[np.argmax(impact.deflection)])))
    # Half sections in units of the radius.
    start, now = (motion.position[k] / 0.089 for k in (0, i))
    figure, axes = panels([(-0.2, 1.75, -0.2, 2.4), (-0.2, 2.45, -0.2, 2.4)])
    for panel, place in zip(axes, (start, now), strict=True):
        for lines in (place, np.swapaxes(place, 0, 1)):
            for line in lines:
                panel.plot(*line.T, color=BLUE, linewidth=0.5, zorder=2)
        panel.plot([0, 0], [-0.1, 2.15], color="0.5", linewidth=0.7, linestyle="-.")
        floor(panel, -0.1, 1.6)
    first, second = axes
    text(first, 0.1, 2.26, "first touch", ha="left")
    measure(first, (0.0, 1.0), (1.0, 1.0), "", dy=0.1)
    text(first, 0.32, 1.14, "$R$")
    text(first, 0.3, 0.8, "gas, $V$")
    arrow(first, (1.35, 1.6), (1.35, 1.0), BLUE)
    text(first, 1.35, 1.72, "$v_0$", color=BLUE)
    text(second, 0.1, 2.26, "largest deflection", ha="left")
    for x in (0.06, 0.2, 0.34, 0.48):
        arrow(second, (x, -0.02), (x, 0.24), RED, mutation_scale=7, zorder=6)
    text(second, 1.3, 0.65, "contact at\nthe nodes:\npressure,\nfriction", color=RED, ha="left")
    arrow(second, (1.26, 0.5), (0.56, 0.14), RED, linewidth=0.8, mutation_scale=6)
    arrow(second, (1.62, 1.75), (1.62, 1.35), GREEN)
    text(second, 1.62, 1.87, "$g$", color=GREEN)
    text(second, 0.3, 0.75, "$p(V)$")
    return figure


def mass_on_spring(
    axes: Axes, place: tuple[float, float], mass: str, elastic: str, damping: str
) -> None:
    """Draw a mass on a spring beside a dashpot, by the middle of their foot."""
    x, base = place
    spring(axes, x - 0.25, base, base + 0.75)
    dashpot(axes, x + 0.25, base, base + 0.75)
    block(axes, (x - 0.55, base + 0.75), (1.1, 0.42), mass)
    text(axes, x - 0.45, base + 0.37, elastic, ha="right")
    text(axes, x + 0.42, base + 0.37, damping, ha="left")


def displacement(axes: Axes, x: float, y: float, words: str) -> None:
    """Draw a displacement towards the floor."""
    axes.plot([x - 0.1, x + 0.1], [y, y], color=BLUE, linewidth=0.9)
    arrow(axes, (x, y), (x, y - 0.36), BLUE, mutation_scale=7)
    text(axes, x + 0.09, y - 0.2, words, ha="left", color=BLUE)


def lumped_models() -> Figure:
    """Draw one mass, belt and rim, and measured modes."""
    figure, (one, two, modes) = panels(
        [(-1.35, 4.25, -0.25, 1.75)], [(-1.65, 3.95, -0.25, 2.6)], [(-1.0, 4.6, -0.25, 2.45)]
    )
    for axes, right in ((one, 1.1), (two, 1.2), (modes, 3.2)):
        floor(axes, -0.9, right)
    mass_on_spring(one, (0, 0), "$M$", "$k\\,\\delta^n$", "$\\alpha$")
    displacement(one, 0.78, 1.1, "$z = \\delta$")
    text(one, 1.6, 1.3, "hunt_crossley", family="monospace", ha="left")
    force = "$F = k\\,\\delta^n\\,(1 + \\frac{3}{2}\\,\\alpha\\,\\delta')$"
    text(one, 1.6, 0.6, force, color=RED, ha="left")

    mass_on_spring(two, (0, 0), "belt $m_1$", "$p\\,w\\,\\delta$,\n$c$, $n$", "$a$")
    mass_on_spring(two, (0, 1.17), "rim $m_2$", "frequency", "damping ratio")
    displacement(two, 0.72, 1.1, "$\\delta$")
    text(two, 1.3, 2.2, "two_mass", family="monospace", ha="left")
    patch = "$F = (p\\,w\\,\\delta + c\\,\\delta\\,(\\delta/\\delta_0)^{n-1})$"
    text(two, 1.15, 0.95, patch, color=RED, ha="left")
    text(two, 1.6, 0.5, "$\\times\\;(1 + a\\,\\delta')$", color=RED, ha="left")

    for x, index in ((0.0, "1"), (1.9, "2")):
        names = (f"$M_{index}$", f"$\\omega_{index}$", f"$\\zeta_{index}$")
        mass_on_spring(modes, (x, 0), *names)
        displacement(modes, x + 0.78, 1.1, f"$d_{index}$")
    text(modes, 3.35, 0.95, "…")
    text(modes, -0.9, 2.1, "measured_modes", family="monospace", ha="left")
    force = "$F = \\Sigma\\,M_n\\,(\\omega_n^2 d_n + 2\\,\\zeta_n\\omega_n d_n')$"
    text(modes, -0.9, 1.6, force, color=RED, ha="left")
    return figure
