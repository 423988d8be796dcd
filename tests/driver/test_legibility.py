"""Figures of the documentation are legible at the width of a column, 8 cm."""

from __future__ import annotations

import re
import sys
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from conftest import REPOSITORY
from legibility import COLUMN, find_faults
from PIL import Image
from test_figure_look import assert_clean, texts

import thud
from thud.plot import legend_above, own_style
from thud.plot.style import WIDTH, empty_axes

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

sys.path.append(str(REPOSITORY / "docs/pictures"))
import draw

FIGURES = REPOSITORY / "docs/figures"
# Pages, which are read at the width of the screen.
SCREENS = {"explorer", "predicted_floor", "report"}
# Their surrogate takes minutes; a test below draws the same by a smaller one.
BY_SURROGATE = {"study_flagship_design", "study_surrogate"}
# Texts of a sketch, sizes of its letters, and its width.
PARTS = r'<!-- .*? -->|scale\([\d.]+|<svg .*?width="[\d.]+'


def stems(pattern: str) -> set[str]:
    return {path.stem for path in FIGURES.glob(pattern)}


def test_every_figure_can_be_drawn_again() -> None:
    assert stems("*.svg") == set(draw.SKETCHES)
    assert stems("*.png") == set(draw.PLOTS) | SCREENS


@pytest.mark.parametrize("name", sorted(draw.SKETCHES))
def test_sketch_is_legible_and_its_file_is_that_sketch(name: str, tmp_path: Path) -> None:
    assert find_faults(draw.SKETCHES[name]()) == []
    draw.draw_sketch(name, tmp_path)
    # Texts are comments of their outlines, whose scale is the size of the letters.
    paths = (tmp_path / f"{name}.svg", FIGURES / f"{name}.svg")
    drawn, file = (re.findall(PARTS, path.read_text("utf-8")) for path in paths)
    assert len(drawn) > 20
    assert file == drawn


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(set(draw.PLOTS) - BY_SURROGATE))
def test_plot_is_legible(name: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        figure = draw.PLOTS[name]()
    if name in draw.FIGURES:
        assert figure.get_figwidth() == pytest.approx(WIDTH)
        assert_clean(figure)
        words = " ".join(texts(figure)).replace("\n", " ").lower()
        # Plates press with one force.
        labels = [axes.get_ylabel() for axes in figure.axes if name != "compression"]
        if any("orce" in label or "evel" in label for label in labels):
            assert "force on the floor" in words or "elastic force" in words
    assert find_faults(figure) == []


@pytest.mark.slow
def test_plots_of_a_surrogate_are_legible() -> None:
    study: dict[str, Any] = {"fixed": {"model": "modal_ball", "damping_law": "rising"}}
    ranges = {
        "wall_thickness": {"low": 29, "high": 32, "unit": "mm"},
        "youngs_modulus": {"low": 1.6, "high": 2.0, "unit": "MPa"},
    }
    trained = thud.surrogate({**study, "design": {"size": 64}, "parameters": ranges})
    assert find_faults(trained.plot()) == []
    axes = {name: {**limits, "count": 41} for name, limits in ranges.items()}
    found = thud.design({**study, "parameters": axes}, surrogate=trained)
    assert find_faults(found.plot()) == []


def test_files_of_plots_are_as_wide_as_they_were_drawn_and_small() -> None:
    """Text that is legible in the figure is so in the file."""
    widths = {}
    for name in stems("*.png") - SCREENS:
        with Image.open(FIGURES / f"{name}.png") as picture:
            widths[name] = picture.width / picture.info["dpi"][0]
    assert widths == pytest.approx(dict.fromkeys(widths, COLUMN), rel=2e-3)
    assert sum(path.stat().st_size for path in FIGURES.iterdir()) < 4e6


@own_style()
def faulty_figure() -> Figure:
    """Return a figure with one fault of each kind."""
    figure, axes = empty_axes(2)
    x = np.linspace(0, 1)
    axes.plot(x, x, label="below", linewidth=1)
    axes.plot(x, x, label="above", linewidth=2)
    axes.plot([], [], color="magenta", label="nowhere")
    axes.text(0.5, 0.5, "crossed", ha="center", va="center")
    axes.text(0.2, 0.9, "one")
    axes.text(0.2, 0.9, "two")
    axes.text(0.7, 0.2, "small", fontsize=5.9)
    axes.text(0.7, 0.1, "$L_\\mathrm{small}$", fontsize=8)
    axes.text(0.9, 0.3, "longer than the axes").set_in_layout(False)
    axes.set_xlim(0, 1)
    legend_above(axes)
    return figure


def test_each_fault_is_found() -> None:
    faults = " ".join(find_faults(faulty_figure()))
    for fault in (
        "'crossed' is on a mark", "'one' and 'two' overlap", "'small': 5.90 pt",
        "small}$': 5.60 pt", "'longer than the axes' is cut", "'below' is not seen",
        "'nowhere' is not seen",
    ):  # fmt: skip
        assert fault in faults, fault
    assert "above" not in faults
