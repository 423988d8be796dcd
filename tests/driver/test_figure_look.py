"""Look of all figures: nothing crosses a legend, forces and bands are named, text stays text."""

from __future__ import annotations

import importlib
import inspect
import os
import pkgutil
import re
import shutil
import xml.etree.ElementTree as ET
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from conftest import MINIMAL, REPOSITORY, names_in, python
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox
from PIL import Image

import thud
from thud import cli, plot, report
from thud.plot.style import COLORS, WIDTH, curve_style
from thud.recordings.signal import Signal

LONG = "rubber_ball_with_a_name_that_is_much_longer_than_the_column_of_a_page_is_wide"
# What a user may have configured, for slides and papers.
OTHER_STYLE = {
    "text.usetex": True, "savefig.dpi": 10000, "figure.dpi": 10000, "font.family": "nowhere",
    "axes.unicode_minus": False, "savefig.bbox": "tight", "savefig.format": "ps",
    "lines.linewidth": 20, "svg.fonttype": "path",
}  # fmt: skip
SVG = "{http://www.w3.org/2000/svg}"


def judging(impact: thud.Impact, force: str) -> thud.Impact:
    return replace(impact, case=replace(impact.case, levels=thud.Levels(force=force)))


def texts(figure: Figure) -> list[str]:
    return [t.get_text() for t in figure.findobj(Text) if isinstance(t, Text)]


def assert_clean(figure: Figure) -> None:
    """Assert that the parts of a figure neither overlap nor leave it."""
    figure.draw_without_rendering()
    parts = [axes.get_tightbbox() for axes in figure.axes]
    parts += [legend.get_window_extent() for legend in figure.legends]
    parts = [part for part in parts if part is not None]
    assert all(axes.get_legend() is None for axes in figure.axes)
    for i, part in enumerate(parts):
        # Rounding of the layout, in pixels of 1/300 inch.
        assert not [p for p in parts[:i] if (b := Bbox.intersection(p, part)) and min(b.size) > 2]
        assert min(part.min) > -2
        assert (part.max < figure.bbox.max + 2).all()
    for before, after in pairwise(figure.axes[0].get_xticklabels()):
        assert before.get_window_extent().x1 < after.get_window_extent().x0
    assert not re.search(r"[-−]0\.?0*(?![.\d])", " ".join(texts(figure)))


@pytest.mark.parametrize("count", [1, 2, 8])
def test_long_names_of_many_cases_stay_outside_of_the_axes(shell: thud.Impact, count: int) -> None:
    impacts = {f"{LONG}_{i}": shell for i in range(count)}
    heights = []
    for draw in (plot.force_history, plot.levels):
        figure = draw(impacts)
        assert_clean(figure)
        assert figure.get_figwidth() == pytest.approx(WIDTH)
        axes = figure.axes[0].get_window_extent()
        heights.append(axes.height / figure.dpi)
    # The legend does not squeeze the axes.
    assert min(heights) > 1.8


def test_levels_are_drawn_at_their_bands() -> None:
    """Shifted markers would change the slopes of the lines between them."""
    impacts = {f"{i}": thud.solve(model="hollow_sphere") for i in range(4)}
    (axes,) = plot.levels(impacts).axes
    lines = [line for line in axes.lines if line.get_label() in impacts]
    sizes = [line.get_markersize() for line in lines]
    for line in lines:
        np.testing.assert_array_equal(line.get_xdata(), range(5))
    # Equal levels: each marker is seen around the next.
    assert sizes == sorted(sizes, reverse=True)
    assert len(set(sizes)) == 4


def test_no_two_of_many_curves_look_the_same() -> None:
    styles = [curve_style(i, 4) for i in range(4 * len(COLORS))]
    looks = {(style["color"], str(style["linestyle"]), style["marker"]) for style in styles}
    assert len(looks) == len(styles)


def test_force_is_that_of_the_case_and_is_named(shell: thud.Impact) -> None:
    for force, words in (("floor", "force on the floor"), ("elastic", "elastic force")):
        one = {"ball": judging(shell, force)}
        assert plot.force_history(one).axes[0].get_ylabel().startswith(words.capitalize())
        (axes,) = plot.levels(one).axes
        assert axes.get_ylabel().endswith(f"({words})")
        curves = {str(line.get_label()): line.get_ydata() for line in axes.lines}
        np.testing.assert_array_equal(curves["ball"], shell.levels(force=force))


def test_legend_names_forces_that_differ(shell: thud.Impact) -> None:
    both = {"a": judging(shell, "elastic"), "b": judging(shell, "floor")}
    for draw in (plot.force_history, plot.levels):
        figure = draw(both)
        assert {"a, elastic force", "b, force on the floor"} <= set(texts(figure))
        assert "(" not in figure.axes[0].get_ylabel()


@pytest.mark.parametrize(("bands", "panels"), [("octave", 1), ("third", 2), ("both", 2)])
def test_third_octaves_are_drawn_if_asked_for(shell: thud.Impact, bands: str, panels: int) -> None:
    case = replace(shell.case, levels=thud.Levels(bands=bands))
    figure = plot.levels({"ball": replace(shell, case=case)})
    assert_clean(figure)
    labels = [axes.get_xlabel() for axes in figure.axes]
    assert labels == ["Octave band, Hz", "One-third-octave band, Hz"][:panels]
    # Tolerances are those of the octaves.
    assert [len(axes.collections) for axes in figure.axes] == [6, 0][:panels]
    if panels > 1:
        (line,) = figure.axes[1].lines
        np.testing.assert_array_equal(line.get_ydata(), shell.levels("third"))


def limits(impact: thud.Impact | thud.Recording) -> tuple[float, float]:
    low, high = plot.force_history({"ball": impact}).axes[0].get_xlim()  # type: ignore[dict-item]
    return low, high


def test_time_axis_is_that_of_the_contact_whatever_the_length_of_the_record() -> None:
    short, long = (thud.solve(duration=time, model="hollow_sphere") for time in (0.025, 1.0))
    contact = 1e3 * long.contact_time
    assert limits(long) == limits(short)
    assert limits(long)[0] == 0
    assert contact < limits(long)[1] < 1.05 * contact
    mesh = {"radial_elements": 2, "polar_elements": 16}
    flying = thud.solve(model="finite_element", **mesh, flight_before=5e-3)
    low, high = limits(flying)
    contact = 1e3 * flying.contact_time
    assert -0.05 * contact < low < 0
    assert 0.98 * contact < high < 1.05 * contact


def test_recording_is_drawn_from_first_touch_to_last_release(shell: thud.Impact) -> None:
    force = np.random.default_rng(1).normal(scale=0.5, size=44100)
    contact = shell.floor_force[shell.floor_force > 0]
    # A bounce is a contact of its own.
    for start, part in ((11025, 1.0), (22050, 0.7)):
        force[start : start + len(contact)] += part * contact
        low, high = limits(thud.read_recording(Signal.from_array(force, 44100)))
        assert -1.5 < low < 0
        assert 20 < high < 22


def test_files_have_a_title_and_vector_text_is_text(shell: thud.Impact, tmp_path: Path) -> None:
    for ending in ("svg", "png", "pdf"):
        plot.save(plot.levels({"shell & <ball>": shell}), tmp_path / f"rubber_ball.{ending}")
    assert b"/Title (Rubber ball)" in (tmp_path / "rubber_ball.pdf").read_bytes()
    with Image.open(tmp_path / "rubber_ball.png") as picture:
        assert picture.info["Title"] == "Rubber ball"
    root = ET.fromstring((tmp_path / "rubber_ball.svg").read_text())  # noqa: S314 - our own
    assert root.findtext(f"{SVG}title") == "Rubber ball"
    found = list(root.iter(f"{SVG}text"))
    shown = {"".join(text.itertext()).strip() for text in found}
    assert {"shell & <ball>", "Octave band, Hz", "31.5", "Tolerance, rubber ball"} <= shown
    assert all("sans-serif" in text.attrib["style"] for text in found)


def test_users_style_changes_no_figure(shell: thud.Impact, tmp_path: Path) -> None:
    for folder, style in (("plain", {}), ("other", OTHER_STYLE)):
        (tmp_path / folder).mkdir()
        with mpl.rc_context(style):
            figures = {**plot.case_figures(shell), "overview": shell.plot()}
            for name, figure in figures.items():
                plot.save(figure, tmp_path / folder / f"{name}.svg")
    names = names_in(tmp_path / "plain")
    assert "overview.svg" in names
    for name in names:
        plain, other = ((tmp_path / folder / name).read_bytes() for folder in ("plain", "other"))
        assert plain == other, name


@pytest.mark.parametrize("words", [["run", "case.nml"], ["measure", "record.csv"]])
def test_commands_without_matplotlib_keep_the_results(words: list[str], tmp_path: Path) -> None:
    (tmp_path / "case.nml").write_text(MINIMAL)
    shutil.copy(REPOSITORY / "inputs/recordings/drop_1.csv", tmp_path / "record.csv")
    (tmp_path / "matplotlibrc").write_bytes(b"font.family: \xff")
    command = ["-P", "-m", "thud", *words, "-q", "-o", "out"]
    done = python(*command, cwd=tmp_path, env=os.environ | {"MPLBACKEND": "nowhere"})
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    assert "utf-8" in done.stderr
    assert (tmp_path / "out/levels.csv").exists()


def test_every_figure_is_drawn_in_its_own_style() -> None:
    names = [
        module.name
        for package in (plot, report)
        for module in pkgutil.iter_modules(package.__path__, f"{package.__name__}.")
        if module.name != "thud.plot.style"
    ]
    draws = [
        draw
        for name in names
        for draw in vars(importlib.import_module(name)).values()
        if inspect.isfunction(draw) and draw.__module__ == name and draw.__name__[0] != "_"
        if "Figure" in str(inspect.signature(draw).return_annotation)
    ]
    assert len(draws) > 25
    assert [draw.__qualname__ for draw in draws if not hasattr(draw, "__wrapped__")] == []


@pytest.mark.parametrize(
    ("command", "results"),
    [
        ("run {}/rubber_ball_010cm.nml", {"force.csv", "summary.nml"}),
        ("compare {0}/comparison/1_shell.nml {0}/comparison/3_modes.nml", {"comparison.html"}),
        ("measure {}/recordings/drop_1.csv", {"levels.csv", "report.json", "report.html"}),
        ("floor {0}/floors/joists.nml {0}/floors/concrete_140.nml", {"floors.html"}),
        ("rate {}/floors/field_levels.csv", set()),
    ],
)
@pytest.mark.slow
def test_figure_that_fails_is_a_warning(
    command: str,
    results: set[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def fail(*_: object, **__: object) -> None:
        message = "the font is damaged\nsecond line"
        raise RuntimeError(message)

    monkeypatch.setattr(Figure, "savefig", fail)
    monkeypatch.chdir(tmp_path)
    assert cli.main([*command.format(REPOSITORY / "inputs").split(), "-q", "-o", "out"]) == 0
    printed = [line for line in capsys.readouterr().err.splitlines() if "not drawn" in line]
    assert printed
    assert all("the font is damaged" in line for line in printed)
    assert not list(Path("out").glob("*.svg"))
    assert results <= {*names_in(Path("out"))}
