"""Figures of the documentation are legible at the width of a column, 8 cm."""

from __future__ import annotations

import re
import sys
import warnings
import xml.etree.ElementTree as ET
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from conftest import REPOSITORY
from legibility import COLUMN, SMALLEST, find_faults
from PIL import Image
from test_comparison_page import open_in_browser

import thud
from thud.plot import legend_above, own_style
from thud.plot.style import empty_axes

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
SVG = "{http://www.w3.org/2000/svg}"
HREF = "{http://www.w3.org/1999/xlink}href"
# Texts and strokes of a picture: pairs of texts that overlap, texts that a stroke crosses.
OVERLAPS = """() => {
  const named = (prefix) => [...document.querySelectorAll(`g[id^="${prefix}_"]`)];
  const texts = named("text").map((g) => {
    const boxes = [...g.querySelectorAll("use")].map((use) => use.getBoundingClientRect());
    return { id: g.id, boxes };
  });
  const inside = (box, x, y) => x > box.left && x < box.right && y > box.top && y < box.bottom;
  const meet = (a, b) =>
    a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
  const faults = [];
  for (const [i, a] of texts.entries())
    for (const b of texts.slice(i + 1))
      if (a.boxes.some((one) => b.boxes.some((other) => meet(one, other))))
        faults.push([a.id, b.id]);
  for (const path of document.querySelectorAll("path")) {
    if (path.closest("defs, [id^=text_]") || getComputedStyle(path).stroke === "none") continue;
    const matrix = path.getScreenCTM();
    for (let length = 0; length < path.getTotalLength(); length += 0.5) {
      const { x, y } = path.getPointAtLength(length).matrixTransform(matrix);
      const hit = texts.find((text) => text.boxes.some((box) => inside(box, x, y)));
      if (hit) { faults.push([hit.id, path.parentElement.id]); break; }
    }
  }
  return { count: texts.length, faults };
}"""


def stems(pattern: str) -> set[str]:
    return {path.stem for path in FIGURES.glob(pattern)}


def test_every_figure_can_be_drawn_again() -> None:
    assert stems("*.svg") == set(draw.SKETCHES)
    assert stems("*.png") == set(draw.PLOTS) | SCREENS


@pytest.mark.parametrize("name", sorted(draw.SKETCHES))
def test_sketch_is_legible(name: str) -> None:
    assert find_faults(draw.SKETCHES[name]()) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(set(draw.PLOTS) - BY_SURROGATE))
def test_plot_is_legible(name: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        figure = draw.PLOTS[name]()
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


def glyph_sizes(path: Path) -> list[float]:
    """Return the sizes of the letters of a sketch at the width of a column, pt."""
    root = ET.fromstring(path.read_text(encoding="utf-8"))  # noqa: S314 - our own
    scale = 72 * COLUMN / float(root.attrib["width"].removesuffix("pt"))
    sizes = []
    for group in root.iter(f"{SVG}g"):
        found = re.search(r" scale\(([\d.]+) -", group.get("transform", ""))
        for letter in group.findall(f"{SVG}use") if found else ():
            # Signs that grow with a formula, as of a root, are of another font.
            if "DejaVu" not in letter.get(HREF, ""):
                continue
            part = re.search(r"scale\(([\d.]+)\)", letter.get("transform", ""))
            # Letters are drawn 100 pt high.
            sizes.append(100 * scale * float(found[1]) * float(part[1] if part else 1))
    return sizes


@pytest.mark.parametrize("name", sorted(stems("sketch_*.svg")))
def test_letters_in_the_file_of_a_sketch_have_6_pt_in_a_column(name: str) -> None:
    sizes = glyph_sizes(FIGURES / f"{name}.svg")
    assert len(sizes) > 10
    assert min(sizes) >= SMALLEST


@pytest.mark.parametrize("name", sorted(stems("*.png") - SCREENS))
def test_file_of_a_plot_is_as_wide_as_it_was_drawn(name: str) -> None:
    """Text that is legible in the figure is so in the file."""
    with Image.open(FIGURES / f"{name}.png") as picture:
        assert picture.width / picture.info["dpi"][0] == pytest.approx(COLUMN, rel=2e-3)


def test_figures_are_small() -> None:
    assert sum(path.stat().st_size for path in FIGURES.iterdir()) < 4e6


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(stems("sketch_*.svg")))
def test_nothing_lies_on_the_text_of_a_sketch_in_a_browser(name: str, tmp_path: Path) -> None:
    source = (FIGURES / f"{name}.svg").read_text(encoding="utf-8")
    page = f"<style>svg {{ width: 8cm; height: auto }}</style>{source[source.index('<svg') :]}"
    with open_in_browser(tmp_path / "page.html", page) as opened:
        found = opened.evaluate(OVERLAPS)
    assert found["count"] > 4
    assert found["faults"] == []


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
        "'crossed' is on a mark",
        "'one' and 'two' overlap",
        "'small': 5.90 pt",
        "small}$': 5.60 pt",
        "'longer than the axes' is cut",
        "'below' is not seen",
        "'nowhere' is not seen",
    ):
        assert fault in faults, fault
    assert "above" not in faults
