"""Latency of the page in a browser. Needs Debian's chromium.

Prints the times from the move of a slider to the picture of its answer beside the requirement. With
a path, also saves the picture of the page that stands in docs/explorer.md:

    .venv/bin/python tests/bench/explorer.py [docs/figures/explorer.png]
"""

from __future__ import annotations

import shutil
import statistics
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from playwright.sync_api import sync_playwright

sys.path.insert(0, str(Path(__file__).parents[1] / "driver"))
from explorer_server import serve

if TYPE_CHECKING:
    from playwright.sync_api import Page

STEPS = 60
# Model, and the requirement, ms.
MODELS = (("hollow_sphere", 50), ("modal_ball", 100))


def latencies(page: Page, model: str) -> list[float]:
    """Return the times of a drag of the height, ms."""
    page.locator("#model").select_option(model)
    page.wait_for_timeout(1500)
    place = page.locator("[id='drop.height'] + input").bounding_box()
    assert place
    x, y = place["x"] + place["width"] / 2, place["y"] + place["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    times = []
    for step in range(1, STEPS + 1):
        page.evaluate("delete document.body.dataset.latency")
        page.mouse.move(x + step * place["width"] / 3 / STEPS, y)
        page.locator("body[data-latency]").wait_for()
        times.append(float(page.locator("body").get_attribute("data-latency") or 0))
    page.mouse.up()
    return times


def main() -> None:
    """Print the table, and save the picture."""
    with serve() as (address, _), sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox"]
        )
        page = browser.new_page(viewport={"width": 1400, "height": 900})
        page.goto(address)
        page.locator("#model").wait_for()
        for model, required in MODELS:
            times = latencies(page, model)
            most = statistics.quantiles(times, n=20)[-1]
            print(
                f"{model}: median {statistics.median(times):.0f} ms, 95 % {most:.0f} ms, "
                f"required {required} ms"
            )
        page.locator("#reset").dispatch_event("click")
        page.locator("#verdict.conforms").wait_for()
        page.locator("#model").select_option("finite_element")
        page.locator("#verdict", has_text="finite elements").wait_for()
        if len(sys.argv) > 1:
            page.wait_for_timeout(7000)
            page.screenshot(path=sys.argv[1])
        browser.close()


if __name__ == "__main__":
    main()
