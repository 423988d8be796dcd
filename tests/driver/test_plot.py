"""Figures: units on the axes, tolerance band, every curve named, whole files, one file each."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from conftest import REPOSITORY, names_in
from PIL import Image

import thud
from thud.level.levels import low_pass
from thud.plot.style import WIDTH

if TYPE_CHECKING:
    from pathlib import Path


COARSE: dict[str, Any] = {"radial_elements": 2, "polar_elements": 16}
SNAPSHOTS = {"snapshot_interval": 1e-3, **COARSE}


@pytest.fixture(scope="module")
def deformed() -> thud.Impact:
    return thud.solve(model="finite_element", flight_before=2e-3, **SNAPSHOTS)


def test_force_history_shows_every_curve_with_units() -> None:
    impacts = {f"{height} m": thud.solve(drop=thud.Drop(height)) for height in (0.1, 1.0, 1.6)}
    figure = thud.plot.force_history(impacts, "elastic")
    (axes,) = figure.axes
    assert axes.get_xlabel() == "Time since first touch, ms"
    assert axes.get_ylabel() == "Elastic force,\nlow-passed at 1.25 kHz, kN"
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == list(impacts)
    for line, impact in zip(axes.lines, impacts.values(), strict=True):
        shown = len(line.get_ydata())
        recorded = low_pass(impact.elastic_force, impact.sample_rate)
        np.testing.assert_array_equal(line.get_ydata(), 1e-3 * recorded[:shown])
        assert line.get_ydata().max() == pytest.approx(1e-3 * impact.elastic_force.max(), rel=0.01)
    assert len({(line.get_color(), line.get_linestyle()) for line in axes.lines}) == 3


@pytest.mark.parametrize("source", ["rubber_ball", "tyre"])
def test_levels_show_the_tolerance_band(shell: thud.Impact, source: str) -> None:
    (axes,) = thud.plot.levels({"ball": shell}, source=source).axes
    assert axes.get_xlabel().endswith(", Hz")
    assert axes.get_ylabel() == "Force exposure level, dB re 1 N, 1 s\n(force on the floor)"
    boxes = [box.get_datalim(axes.transData).intervaly for box in axes.collections[:5]]
    limits = [(c.lower, c.upper) for c in shell.assess(source).criteria[:5]]
    np.testing.assert_allclose(boxes, limits)


def test_motion_shows_instants_from_first_touch_to_release(deformed: thud.Impact) -> None:
    figure = thud.plot.motion(deformed)
    panels = [axes for axes in figure.axes if axes.get_title()]
    times = [float(axes.get_title().removesuffix(" ms")) for axes in panels]
    assert len(times) == 9
    assert times == sorted(times)
    assert times[0] == pytest.approx(0, abs=0.6)
    assert times[-1] == pytest.approx(1e3 * deformed.contact_time, abs=0.6)
    assert figure.get_figwidth() == pytest.approx(WIDTH)
    # Each time is nearer to its ball than to the one below.
    figure.draw_without_rendering()
    for panel, below in zip(panels, panels[3:], strict=False):
        label = panel.title.get_window_extent()
        own = panel.get_window_extent().y0 - label.y1
        assert 0 <= own < label.y0 - below.get_window_extent().y1


def test_animation_has_a_picture_for_each_snapshot(tmp_path: Path) -> None:
    impact = thud.solve(model="finite_element", **{**SNAPSHOTS, "snapshot_interval": 4e-3})
    assert impact.motion
    thud.plot.animate(impact, tmp_path / "ball.gif")
    assert names_in(tmp_path) == ["ball.gif"]
    with Image.open(tmp_path / "ball.gif") as pictures:
        assert pictures.n_frames == len(impact.motion.time) > 4


def test_floor_is_drawn_where_it_moves() -> None:
    floor = thud.InfinitePlate(resistance=500.0)
    impact = thud.solve(model="finite_element", floor=floor, **SNAPSHOTS)
    moved = impact.on_floor
    assert moved
    assert moved.motion
    assert impact.motion
    assert not impact.motion.floor_displacement.any()
    sampled = np.interp(moved.motion.time, moved.time, moved.floor_displacement)
    np.testing.assert_allclose(moved.motion.floor_displacement, sampled, atol=1e-12)
    assert moved.motion.floor_displacement.max() > 0.02
    tops = []
    for axes in thud.plot.motion(moved).axes:
        if not axes.get_title():
            continue
        shown = float(axes.get_title().removesuffix(" ms"))
        i = np.argmin(abs(1e3 * moved.motion.time - shown))
        # The floor is drawn last.
        tops += [np.asarray(axes.collections[-1].get_paths()[0].vertices)[:, 1].max()]
        assert tops[-1] == pytest.approx(-moved.motion.floor_displacement[i], abs=1e-12)
        # A jump of the force by 1 kN moves the floor by 1e-5 m in a step.
        assert moved.motion.position[i][..., 1].min() > tops[-1] - 1e-5
        assert axes.get_ylim()[0] < -moved.motion.floor_displacement.max()
    assert len(tops) == 9
    assert min(tops) < -0.02


def test_mode_shapes_are_named() -> None:
    modes = thud.free_modes(count=4)
    figure = thud.plot.mode_shapes(modes)
    titles = [f"{f:.1f} Hz, n = {n}" for f, n in zip(modes.frequency, modes.harmonic, strict=True)]
    assert [axes.get_title() for axes in figure.axes][:4] == titles
    assert figure.get_figwidth() == pytest.approx(WIDTH)


def test_loss_factors_follow_their_laws() -> None:
    laws = {
        law: thud.FiniteElement(viscosity=law, loss_factor=0.2)
        for law in ("kelvin_voigt", "constant_loss", "fractional")
    }
    frequency = np.geomspace(10, 1000, 200)
    rising, constant, fractional = (thud.loss_factors(m, frequency) for m in laws.values())
    assert rising[-1] / rising[0] == pytest.approx(100)
    np.testing.assert_allclose(constant, 0.2, rtol=3e-3)
    # From 10 to 1000 Hz: p sin x**a/(1 + p cos (x**a - 1)) with x = f/74 Hz and p = 0.2/sin.
    power = np.array([10 / 74, 1000 / 74]) ** 0.75
    expected = 0.2 * power / (1 + 0.2 / np.tan(0.375 * np.pi) * (power - 1))
    np.testing.assert_allclose(fractional[[0, -1]], expected, rtol=0.02)


def test_case_has_the_figures_of_its_results(deformed: thud.Impact) -> None:
    modes = thud.free_modes(count=2)
    assert set(thud.plot.case_figures(deformed)) == {"force", "levels", "motion"}
    assert set(thud.plot.case_figures(modes=modes)) == {"modes"}
    assert set(thud.plot.case_figures(thud.solve(), modes)) == {"force", "levels", "modes"}
    assert list(thud.plot.case_figures(deformed, modes, count=3)) == ["force", "levels", "modes"]


def test_figure_of_the_documentation_is_drawn() -> None:
    """The example of docs/how_to_add.md."""
    page = (REPOSITORY / "docs/how_to_add.md").read_text().partition("## A figure")[2]
    (source,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    example: dict[str, Any] = {}
    exec(source, example)  # noqa: S102 - our own
    impact = thud.solve()
    (axes,) = example["force_loop"]({"shell": impact}).axes
    np.testing.assert_array_equal(axes.lines[0].get_xdata(), 1e3 * impact.deflection)
