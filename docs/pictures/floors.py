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
    figure, (moving, *kinds) = panels([(-2.0, 3.2, -1.35, 0.75)], [(-1.0, 1.0, -1.2, 1.2)] * 3)
    bent_plate(moving, -1.5, 1.5, 0.3)
    ball(moving, 0, -0.02, 0.3)
    for side, upper, lower, name, colour in (
        (-1, 0.3, -0.02, "$z$", BLUE),
        (1, 0, -0.3, "$w$", INK),
    ):
        for height in (upper, lower):
            moving.plot([0, 1.7 * side], [height, height], color="0.6", linewidth=0.5, zorder=1)
        arrow(moving, (1.6 * side, upper), (1.6 * side, lower), colour, mutation_scale=7)
        text(moving, 1.85 * side, (upper + lower) / 2, name, color=colour)
    arrow(moving, (0, -0.36), (0, -0.8), RED)
    text(moving, 0.12, -0.68, "$F$", color=RED, ha="left")
    text(moving, 2.6, 0.3, "$\\delta = z - w$")
    text(moving, 2.6, -0.15, "$V = w'$")
    text(moving, 0.6, -1.15, "$Y(s) = V/F = d + \\Sigma\\,r/(s - p)$")

    plate, floating, joists = kinds
    for axes, name in zip(kinds, ("plate", "floating floor", "joist floor"), strict=True):
        text(axes, 0, 0.98, name)
        ball(axes, 0, 0.3)
    block(plate, (-0.9, -0.32), (1.8, 0.32), "$B',\\ m''$")
    for x in (-0.8, 0.8):
        plate.plot([x, x - 0.09, x + 0.09, x], [-0.32, -0.5, -0.5, -0.32], color=INK, linewidth=1)
    text(plate, 0, -0.88, "infinite:\n$Z = 8\\sqrt{B' m''}$")
    block(floating, (-0.9, -0.16), (1.8, 0.16))
    for x in np.linspace(-0.75, 0.75, 6):
        spring(floating, x, -0.42, -0.16, 0.05)
    block(floating, (-0.9, -0.66), (1.8, 0.24))
    text(floating, 0, -0.98, "layer: $s'$")
    block(joists, (-0.9, -0.1), (1.8, 0.1))
    for x in (-0.7, 0.0, 0.7):
        block(joists, (x - 0.07, -0.55), (0.14, 0.45))
    measure(joists, (-0.7, -0.7), (0.0, -0.7), "$a$", dy=-0.25)
    return figure


def room() -> Figure:
    """Draw the energies of floor, walls, ceiling and room."""
    figure, (house, chain) = panels([(-2.3, 2.3, -2.4, 0.95)], [(-0.25, 3.45, -1.72, 0.25)])
    house.add_patch(Rectangle((-1.8, -2.2), 3.6, 2.0, facecolor="white", edgecolor="none"))
    block(house, (-2.0, -0.2), (4.0, 0.26), "")
    text(house, -1.3, -0.07, "$E_1$: floor")
    for x in (-2.0, 1.76):
        block(house, (x, -2.2), (0.24, 2.0))
    house.plot([-1.76, 1.76], [-0.55, -0.55], color=INK, linewidth=1.2, linestyle=(0, (6, 2)))
    text(house, 1.0, -0.76, "ceiling: $m$, $d$")
    floor(house, -2.2, 2.2, top=-2.2)
    ball(house, -0.1, 0.36)
    arrow(house, (0.4, 0.75), (0.4, 0.12), RED)
    text(house, 1.35, 0.68, "$10\\,\\lg E = L_\\mathrm{FE}$", color=RED)
    text(house, 1.35, 0.38, "$+\\;10\\,\\lg \\mathrm{Re}\\,Y$", color=RED)
    for x in (-0.9, -0.4, 0.1):
        arrow(house, (x, -0.24), (x, -1.0), GREEN, mutation_scale=7)
    text(house, 0, -1.3, "$E_2$: room, $V$, $T$")
    arrow(house, (-1.88, -0.3), (-1.88, -1.2), BLUE, mutation_scale=7, zorder=6)
    arrow(house, (-1.7, -1.7), (-1.1, -1.7), GREEN, mutation_scale=7)
    text(house, -1.68, -0.9, "$K$", color=BLUE, ha="left")
    house.plot([1.2, 1.2], [-2.2, -1.75], color=INK, linewidth=1)
    house.add_patch(Circle((1.2, -1.7), 0.06, facecolor=INK, zorder=4))
    text(house, 1.05, -1.75, "$p^2$", ha="right")

    rows = [
        ("into the floor", "$L_\\mathrm{FE}$, $\\mathrm{Re}\\,Y$"),
        ("lost by the floor", "$\\omega\\,\\eta$"),
        ("radiated into the room", "$\\rho_0 c_0\\,\\sigma/m''$"),
        ("lost in the room", "$6 \\ln 10/T$"),
        ("pressure", "$p^2 = \\rho_0 c_0^2 E_2/V$"),
        ("detector, Fast", "$y' = 8\\,\\mathrm{s}^{-1}(p^2 - y)$"),
        ("level", "$L_\\mathrm{i,Fmax} = 10\\,\\lg(\\max y/p_0^2)$"),
    ]
    for i, (words, formula) in enumerate(rows):
        y = 0.1 - 0.28 * i
        colour = RED if i == len(rows) - 1 else BLUE
        text(chain, 0, y, words, ha="left")
        text(chain, 3.4, y, formula, ha="right", color=colour)
        if i:
            arrow(chain, (-0.12, y + 0.22), (-0.12, y), mutation_scale=7)
    return figure
