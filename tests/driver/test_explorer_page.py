"""The page of the program in a browser."""

from __future__ import annotations

import re
import shutil
import signal
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from conftest import REPOSITORY

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from playwright.sync_api import Browser, Page

sync_api = pytest.importorskip("playwright.sync_api")
axe = pytest.importorskip("axe_playwright_python.sync_playwright")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="needs Debian's chromium")
START = "import sys; from thud_driver import main; sys.exit(main())"


@pytest.fixture
def server() -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """Return the address of a server, and its process."""
    command = [sys.executable, "-c", START, "explore", "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        address = re.search(r"http\S+", process.stdout.readline())
        assert address
        yield address[0], process
        process.send_signal(signal.SIGINT)
        process.wait(20)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """Return a headless browser."""
    with sync_api.sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield found
        found.close()


def new_page(browser: Browser, address: str, width: int = 1400, scheme: str = "light") -> Page:
    """Return the page of a new user, its first answer shown; a fault of its script fails."""
    context = browser.new_context(
        viewport={"width": width, "height": 900},
        color_scheme=scheme,  # type: ignore[arg-type]
    )
    page = context.new_page()
    page.on("pageerror", lambda error: pytest.fail(str(error)))
    page.goto(address)
    sync_api.expect(page.locator("#verdict")).to_contain_text("Hollow sphere does not conform")
    return page


def shown(page: Page, name: str) -> str:
    """Return the first value of a criterion in the table."""
    found: str = page.locator("#criteria tbody tr", has_text=name).locator("td").nth(1).inner_text()
    return found


def test_case_is_changed_computed_and_compared(
    browser: Browser, server: tuple[str, subprocess.Popen[str]]
) -> None:
    page = new_page(browser, server[0])
    assert shown(page, "octave 31.5") == "38.7"
    page.locator("#pin").click()
    # A slider by the keyboard.
    page.locator("[id='drop.height'] + input").focus()
    page.keyboard.press("End")
    sync_api.expect(page.locator("[id='drop.height']")).to_have_value("3")
    sync_api.expect(page.locator("#criteria tbody tr").first).to_contain_text("high")
    assert page.locator("#criteria thead th").count() == 4
    page.locator("#model").select_option("modal_ball")
    sync_api.expect(page.locator("#verdict")).to_contain_text("Modal ball")
    page.locator("#reset").click()
    sync_api.expect(page.locator("#verdict")).to_contain_text("Hollow sphere does not conform")
    assert page.locator("#criteria thead th").count() == 3


def test_bad_value_is_named_and_mended(
    browser: Browser, server: tuple[str, subprocess.Popen[str]]
) -> None:
    page = new_page(browser, server[0])
    page.locator("[id='ball.wall_thickness']").fill("0.2")
    page.keyboard.press("Tab")
    sync_api.expect(page.locator("#message")).to_contain_text("wall_thickness = 0.2")
    page.locator("[id='ball.wall_thickness']").fill("0.03")
    page.keyboard.press("Tab")
    sync_api.expect(page.locator("#message")).to_be_hidden()


def test_link_carries_the_case(browser: Browser, server: tuple[str, subprocess.Popen[str]]) -> None:
    page = new_page(browser, server[0])
    page.locator("[id='drop.height']").fill("0.4")
    page.keyboard.press("Tab")
    page.locator("#link").click()
    address = page.evaluate("location.href")
    assert "token" not in address
    page.goto("about:blank")
    page.goto(address)
    sync_api.expect(page.locator("[id='drop.height']")).to_have_value("0.4")
    sync_api.expect(page.locator("#verdict")).to_contain_text("drop height")


def test_recording_on_the_page_is_judged(
    browser: Browser, server: tuple[str, subprocess.Popen[str]]
) -> None:
    page = new_page(browser, server[0])
    page.locator("summary", has_text="Recording").click()
    page.locator("#recording_height").fill("1")
    page.locator("#recording_mass").fill("2.5")
    page.locator("#recording_calibration").fill("2000 N/FS")
    page.locator("#file").set_input_files(REPOSITORY / "inputs/recordings/drop_1.wav")
    head = page.locator("#criteria thead th", has_text="drop_1.wav (1 drop)")
    sync_api.expect(head).to_be_visible(timeout=60_000)


def test_slow_work_is_cancelled(
    browser: Browser, server: tuple[str, subprocess.Popen[str]]
) -> None:
    page = new_page(browser, server[0])
    page.locator("summary", has_text="Sampling").click()
    page.locator("#model").select_option("finite_element")
    sync_api.expect(page.locator("#verdict")).to_contain_text("Finite element", timeout=60_000)
    page.locator("[id='mesh.polar_elements']").fill("400")
    page.keyboard.press("Tab")
    sync_api.expect(page.locator("#work")).to_be_visible()
    page.locator("#cancel").click()
    sync_api.expect(page.locator("#work")).to_be_hidden()
    sync_api.expect(page.locator("#message")).to_be_hidden()


def test_two_users_do_not_meet(browser: Browser, server: tuple[str, subprocess.Popen[str]]) -> None:
    pages = [new_page(browser, server[0]) for _ in range(2)]
    for page, height in zip(pages, ("0.3", "1.5"), strict=True):
        page.locator("[id='drop.height']").fill(height)
        page.keyboard.press("Tab")
    for page, height in zip(pages, ("0.3", "1.5"), strict=True):
        row = page.locator("#criteria tbody tr", has_text="drop height")
        sync_api.expect(row).to_contain_text(height)


def test_stopped_server_is_said(
    browser: Browser, server: tuple[str, subprocess.Popen[str]]
) -> None:
    page = new_page(browser, server[0])
    server[1].send_signal(signal.SIGINT)
    assert server[1].wait(20) == 130
    page.locator("[id='drop.height']").fill("0.3")
    page.keyboard.press("Tab")
    sync_api.expect(page.locator("#message")).to_contain_text("does not answer")


@pytest.mark.parametrize(("width", "scheme"), [(1400, "light"), (400, "dark")])
def test_page_is_accessible(
    browser: Browser,
    server: tuple[str, subprocess.Popen[str]],
    width: int,
    scheme: str,
    tmp_path: Path,
) -> None:
    page = new_page(browser, server[0], width, scheme)
    page.screenshot(path=tmp_path / "page.png", full_page=True)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    found = axe.Axe().run(page).response["violations"]
    serious = [one["id"] for one in found if one["impact"] in {"serious", "critical"}]
    assert not serious
