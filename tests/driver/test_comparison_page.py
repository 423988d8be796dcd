"""The page of a comparison: the same curves in picture and HTML, a table of any rows."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from test_figure_look import assert_clean

import thud
from thud.comparison.comparison import Comparison
from thud.plot.style import WIDTH

if TYPE_CHECKING:
    from pathlib import Path

    from playwright.sync_api import Browser, Locator, Page

SHELL, SOFT = thud.solve(), thud.solve(thud.Ball(youngs_modulus=1.2e6), duration=0.5)
IMPACTS: dict[str, thud.Impact | thud.Recording] = {"shell <1>": SHELL, "soft $x^{$": SOFT}
COMPARISON = Comparison(IMPACTS, {})


def plots(page: str) -> list[dict[str, Any]]:
    (found,) = re.findall(r"^(\[\{.*\}\])$", page, re.MULTILINE)
    read: list[dict[str, Any]] = json.loads(found)
    return read


def test_page_is_complete_in_one_file() -> None:
    page = COMPARISON.html()
    assert COMPARISON.files().keys() == {"comparison.svg", "comparison.html"}
    # Nothing is loaded from anywhere: the plots' own code stands in the page.
    assert "http" not in re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)
    assert not re.search(r"<(script|link|img)[^>]*\b(src|href)=", page)
    assert '"thud/plot.js": "data:text/javascript;base64,' in page


def test_page_has_the_curves_of_the_picture() -> None:
    figure, page = COMPARISON.plot(), plots(COMPARISON.html())
    assert len(page) == 3
    for axes, drawn in zip(figure.axes, page, strict=False):
        assert "{title}, {unit}".format(**drawn["x"]) == axes.get_xlabel()
        assert drawn["y"]["title"].partition(" ")[0] == re.split(r"\s", axes.get_ylabel())[0]
        lines = [line for line in axes.lines if line.get_label() in {*IMPACTS, r"soft \$x^{\$"}]
        assert [curve["style"] for curve in drawn["curves"]] == list(range(len(lines)))
        assert len(lines) == len(IMPACTS)
        for line, curve in zip(lines, drawn["curves"], strict=True):
            np.testing.assert_allclose(curve["y"], line.get_ydata(), rtol=1e-5)
    assert page[0]["y"] == {"title": "Force on the floor, low-passed at 1.25 kHz", "unit": "kN"}
    low, high = figure.axes[0].get_xlim()
    assert low == 0
    assert high < 1.1e3 * SOFT.contact_time


def test_tolerance_is_that_of_the_octaves() -> None:
    _, octaves, thirds = plots(Comparison(IMPACTS, {}, source="tyre").html())
    criteria = SHELL.assess("tyre").criteria[:5]
    assert octaves["limits"] == [[c.lower, c.upper] for c in criteria]
    assert "limits" not in thirds


def test_names_and_cells_are_no_code() -> None:
    page = Comparison({"</script><b>": SHELL, "a & b": SHELL}, {}).html()
    assert "<th>a &amp; b</th>" in page
    assert "</script><b>" not in page
    assert plots(page)[0]["curves"][0]["name"] == "</script><b>"


def long_names(count: int) -> Comparison:
    names = [f"a_case_with_a_name_that_is_rather_long_{i}" for i in range(count)]
    return Comparison(dict.fromkeys(names, SHELL), {})


@pytest.mark.parametrize("count", [1, 3, 9])
def test_picture_is_a_column_wide_for_any_number_of_cases(count: int) -> None:
    figure = long_names(count).plot()
    assert figure.get_figwidth() == pytest.approx(WIDTH)
    assert_clean(figure)


def open_in(browser: Browser, path: Path, html: str) -> Page:
    """Return the tab of a page of text."""
    path.write_text(html, encoding="utf-8")
    page = browser.new_page()
    page.goto(path.as_uri())
    return page


def test_browser_draws_the_curves_and_hides_them(browser: Browser, tmp_path: Path) -> None:
    page = open_in(browser, tmp_path / "page.html", COMPARISON.html())
    expect = pytest.importorskip("playwright.sync_api").expect
    curves = page.locator(".plot .curve")
    # Two curves in three plots; five octaves have a tolerance.
    expect(curves).to_have_count(6)
    expect(page.locator(".limits")).to_have_count(5)
    page.locator(".legend button").first.click()
    expect(curves).to_have_count(3)


def assert_scrolls_inside(page: Page, table: Locator, width: int) -> None:
    """Assert that a table, not the page, scrolls, and keeps the titles of its rows."""
    page.set_viewport_size({"width": width, "height": 800})
    # Plots are drawn again.
    page.wait_for_function(f"document.documentElement.scrollWidth <= {width}", timeout=5000)
    right = table.evaluate(
        "e => { e.scrollLeft = 1e4; const t = e.querySelector('tbody td');"
        "return [e.getBoundingClientRect().right, t.getBoundingClientRect().left]; }"
    )
    assert right[0] <= width
    assert 0 <= right[1] < width / 4


@pytest.mark.slow
@pytest.mark.parametrize("width", [320, 390, 1000])
def test_table_scrolls_inside_a_narrow_page(browser: Browser, width: int, tmp_path: Path) -> None:
    page = open_in(browser, tmp_path / "page.html", long_names(9).html())
    assert_scrolls_inside(page, page.locator(".table"), width)
    # At least two columns of numbers are in sight.
    second = page.locator("tbody tr").first.locator("td").nth(2)
    page.locator(".table").evaluate("e => { e.scrollLeft = 0; }")
    assert second.evaluate("e => e.getBoundingClientRect().right") <= width
