"""Sketches of floors that move, and of the room below."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.patches import Circle, Rectangle
from sketch import BLUE, GREEN, INK, RED, SOLID, arrow, block, floor, measure, panels, spring, text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def ball(axes: Axes, x: float, y: float, radius: float = 0.3) -> None:
    """Draw the ball, by its middle."""
    axes.add_patch(Circle((x, y), radius, facecolor=SOLID, edgecolor=INK, zorder=3))
    axes.add_patch(Circle((x, y), 0.64 * radius, facecolor="white", edgecolor=INK, zorder=3))


def bent_plate(axes: Axes, left: float, right: float, depth: float) -> None:
    """Draw a plate that gives way below the ball, from its place at rest."""
    x = np.linspace(left, right, 100)
    y = -depth * np.sin(np.pi * (x - left) / (right - left)) ** 2
    axes.fill_between(x, y - 0.14, y, facecolor=SOLID, edgecolor=INK, zorder=2)
    axes.plot([left, right], [0, 0], color="0.5", linewidth=0.7, linestyle=":")


def floors() -> Figure:
    """Draw the ball on a floor that moves, and what the floors are made of."""
    figure, (moving, *kinds) = panels(
        [(-2.0, 2.0, -1.15, 1.35)] + [(-1.0, 1.0, -1.15, 1.35)] * 3, 2.0
    )
    bent_plate(moving, -1.5, 1.5, 0.3)
    ball(moving, 0, -0.02, 0.3)
    for side, upper, lower, name, colour in (
        (-1, 0.3, -0.02, "$z$", BLUE),
        (1, 0, -0.3, "$w$", INK),
    ):
        for height in (upper, lower):
            moving.plot([0, 1.75 * side], [height, height], color="0.6", linewidth=0.5, zorder=1)
        arrow(moving, (1.65 * side, upper), (1.65 * side, lower), colour, mutation_scale=7)
        text(moving, 1.82 * side, (upper + lower) / 2, name, color=colour)
    arrow(moving, (0, -0.36), (0, -0.8), RED)
    text(moving, 0.16, -0.7, "$F$", color=RED, ha="left")
    text(moving, 0.1, 1.2, "$\\delta = z - w$,   $V = w'$")
    text(moving, 0.1, -1.05, "$Y(s) = V/F = d + \\Sigma\\,r/(s - p)$")

    plate, floating, joists = kinds
    for axes, name in zip(kinds, ("plate", "floating floor", "joist floor"), strict=True):
        text(axes, 0, 1.2, name)
        ball(axes, 0, 0.3)
    block(plate, (-0.9, -0.24), (1.8, 0.24), "$B',\\ m''$")
    for x in (-0.9, 0.9):
        plate.plot([x, x - 0.09, x + 0.09, x], [-0.24, -0.42, -0.42, -0.24], color=INK, linewidth=1)
    text(plate, 0, -0.75, "infinite:\n$Z = 8\\sqrt{B' m''}$")
    block(floating, (-0.9, -0.16), (1.8, 0.16))
    for x in np.linspace(-0.75, 0.75, 6):
        spring(floating, x, -0.42, -0.16, 0.05)
    block(floating, (-0.9, -0.66), (1.8, 0.24))
    text(floating, 0, -0.9, "layer: $s'$")
    block(joists, (-0.9, -0.1), (1.8, 0.1))
    for x in (-0.7, 0.0, 0.7):
        block(joists, (x - 0.07, -0.55), (0.14, 0.45))
    measure(joists, (-0.7, -0.68), (0.0, -0.68), "$a$", dy=-0.17)
    return figure


def room() -> Figure:
    """Draw the energies of floor, walls, ceiling and room."""
    figure, (house, chain) = panels([(-2.3, 2.3, -2.5, 1.2), (-0.3, 3.4, -2.5, 1.2)], 2.9)
    house.add_patch(Rectangle((-1.8, -2.2), 3.6, 2.0, facecolor="white", edgecolor="none"))
    block(house, (-2.0, -0.2), (4.0, 0.24), "")
    text(house, -1.2, -0.08, "$E_1$: floor")
    for x in (-2.0, 1.76):
        block(house, (x, -2.2), (0.24, 2.0))
    house.plot([-1.76, 1.76], [-0.52, -0.52], color=INK, linewidth=1.2, linestyle=(0, (6, 2)))
    text(house, 1.05, -0.68, "ceiling: $m$, $d$", fontsize=8)
    floor(house, -2.2, 2.2, top=-2.2)
    ball(house, 0, 0.34)
    arrow(house, (0.55, 0.75), (0.55, 0.1), RED)
    text(house, 0.68, 0.5, "$E = 10^{L_{FE}/10}\\;\\mathrm{Re}\\,Y$", color=RED, ha="left")
    for x in (-0.9, -0.4, 0.1):
        arrow(house, (x, -0.24), (x, -1.0), GREEN, mutation_scale=7)
    text(house, 0, -1.25, "$E_2$: room, $V$, $T$")
    arrow(house, (-1.88, -0.3), (-1.88, -1.2), BLUE, mutation_scale=7, zorder=6)
    arrow(house, (-1.7, -1.35), (-1.1, -1.35), GREEN, mutation_scale=7)
    text(house, -1.62, -0.85, "$K$", color=BLUE, ha="left")
    house.plot([1.0, 1.0], [-2.2, -1.75], color=INK, linewidth=1)
    house.add_patch(Circle((1.0, -1.7), 0.06, facecolor=INK, zorder=4))
    text(house, 0.85, -1.72, "$p^2$", ha="right")

    rows = [
        ("into the floor", "$L_{FE}$, $\\mathrm{Re}\\,Y$"),
        ("lost by the floor", "$\\omega\\,\\eta$"),
        ("radiated into the room", "$\\rho_0 c_0\\,\\sigma/m''$"),
        ("lost in the room", "$6 \\ln 10/T$"),
        ("pressure", "$p^2 = \\rho_0 c_0^2 E_2/V$"),
        ("detector, Fast", "$y' = 8\\,\\mathrm{s}^{-1}(p^2 - y)$"),
    ]
    for i, (words, formula) in enumerate(rows):
        y = 0.95 - 0.58 * i
        text(chain, 0, y, words, ha="left")
        text(chain, 3.35, y, formula, ha="right", color=BLUE)
        if i:
            arrow(chain, (-0.2, y + 0.45), (-0.2, y + 0.1), mutation_scale=7)
    text(chain, 0, -2.4, "$L_{i,Fmax} = 10\\,\\lg(\\max y/p_0^2)$", ha="left", color=RED)
    return figure
