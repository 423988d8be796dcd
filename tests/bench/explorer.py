"""Latency and first load of the page in a browser, and ten users at once. Needs Debian's chromium.

Prints the times from the move of a slider to the picture of its answer, and from the address to the
first picture over a slow connection, beside the requirement. With a path, also saves the picture of
the page that stands in docs/explorer.md:

    .venv/bin/python tests/bench/explorer.py [docs/figures/explorer.png]
"""

from __future__ import annotations

import shutil
import statistics
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from playwright.sync_api import sync_playwright

sys.path.insert(0, str(Path(__file__).parents[1] / "driver"))
from explorer_server import drag, serve

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

STEPS = 60
# Model, and the requirement, ms.
MODELS = (("hollow_sphere", 50), ("modal_ball", 100))
# Slow connection: latency, ms, and bytes per second; and the requirement for the first picture, ms.
LATENCY, THROUGHPUT, FIRST_PICTURE = 400, 50_000, 1000
# Notes the time of the frame after the first curve is drawn.
WATCH = """new MutationObserver(() => {
    if (window.first || !document.querySelector("#levels svg path")) return;
    window.first = true;
    requestAnimationFrame(() => setTimeout(() => { window.picture = performance.now(); }));
}).observe(document, { childList: true, subtree: true })"""


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


def first_picture(browser: Browser, address: str) -> float:
    """Return the time from the address to the first picture over a slow connection, ms."""
    page = browser.new_context(viewport={"width": 1400, "height": 900}).new_page()
    connection = page.context.new_cdp_session(page)
    connection.send("Network.enable")
    speeds = {"downloadThroughput": THROUGHPUT, "uploadThroughput": THROUGHPUT}
    conditions = {"offline": False, "latency": LATENCY} | speeds
    connection.send("Network.emulateNetworkConditions", conditions)
    page.add_init_script(WATCH)
    page.goto(address)
    page.wait_for_timeout(3000)
    picture: float = page.evaluate("window.picture")
    page.context.close()
    return picture


def bench_slow(page: Page) -> float:
    """Return the time from the choice of finite elements to their verdict, s."""
    start = time.perf_counter()
    page.locator("#model").select_option("finite_element")
    page.locator("#verdict", has_text="finite elements").wait_for()
    return time.perf_counter() - start


def main() -> None:
    """Print the table, and save the picture."""
    with serve() as (address, _), sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox"]
        )
        picture = first_picture(browser, address)
        print(f"first picture: {picture:.0f} ms, required {FIRST_PICTURE} ms")
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
        bench_slow(page)
        page.locator("#reset").dispatch_event("click")
        page.locator("#verdict.conforms").wait_for()
        print(f"finite_element: {bench_slow(page):.2f} s, required 1 s")
        if len(sys.argv) > 1:
            page.wait_for_timeout(7000)
            page.screenshot(path=sys.argv[1])
        browser.close()
    with serve() as (address, _):
        times = drag(address, users=10, steps=100)
        print(
            f"ten users: {len(times)} answers without an error, median "
            f"{1e3 * statistics.median(times):.0f} ms, maximum {1e3 * max(times):.0f} ms"
        )


if __name__ == "__main__":
    main()
