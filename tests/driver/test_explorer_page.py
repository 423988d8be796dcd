"""The page of the program in a browser."""

from __future__ import annotations

import re
import shutil
from base64 import b64encode
from typing import TYPE_CHECKING
from urllib.parse import quote

import pytest
from conftest import REPOSITORY
from explorer_server import Served, serve

import thud
from thud.base._schema import ROOM_SOURCE

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from playwright.sync_api import Browser, Page

sync_api = pytest.importorskip("playwright.sync_api")
axe = pytest.importorskip("axe_playwright_python.sync_playwright")
# Machines that test may be busy.
sync_api.expect.set_options(timeout=30_000)
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="needs Debian's chromium"),
]
RECORDING = REPOSITORY / "inputs/recordings/drop_1.wav"


@pytest.fixture
def server() -> Iterator[Served]:
    """Return the address of a server, and its process."""
    with serve() as found:
        yield found


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
    """Return the value of a criterion in the table."""
    found: str = page.locator("#criteria tbody tr", has_text=name).locator("td").nth(1).inner_text()
    return found


def fill(page: Page, key: str, value: str) -> None:
    """Write a value into the field of a key."""
    page.locator(f"[id='{key}']").fill(value)
    page.keyboard.press("Tab")


def test_case_is_changed_computed_and_compared(browser: Browser, server: Served) -> None:
    page = new_page(browser, server[0])
    assert shown(page, "31.5 Hz") == "38.70"
    page.locator("#pin").click()
    # A slider by the keyboard.
    page.locator("[id='drop.height'] + input").focus()
    page.keyboard.press("End")
    sync_api.expect(page.locator("[id='drop.height']")).to_have_value("3")
    sync_api.expect(page.locator("#criteria tbody tr").first).to_contain_text("high")
    assert page.locator("#criteria thead th").count() == 6
    variants = page.locator("#variants li")
    sync_api.expect(variants).to_have_text(
        [re.compile("Hollow sphere Height 3 m"), re.compile("A: Hollow sphere")]
    )
    page.locator("#model").select_option("modal_ball")
    sync_api.expect(page.locator("#verdict")).to_contain_text("Modal ball")
    page.locator("#reset").click()
    sync_api.expect(page.locator("#verdict")).to_contain_text("Hollow sphere does not conform")
    assert page.locator("#criteria thead th").count() == 4


def test_bad_value_is_named_and_mended(browser: Browser, server: Served) -> None:
    page = new_page(browser, server[0])
    fill(page, "ball.wall_thickness", "200")
    sync_api.expect(page.locator("[id='ball.wall_thickness']")).to_have_attribute(
        "aria-invalid", "true"
    )
    sync_api.expect(page.locator("#message")).to_contain_text("wall_thickness = 0.2")
    fill(page, "ball.wall_thickness", "30")
    sync_api.expect(page.locator("#message")).to_be_hidden()


def test_link_carries_the_case(browser: Browser, server: Served) -> None:
    page = new_page(browser, server[0])
    fill(page, "drop.height", "0.4")
    page.locator("#link").click()
    page.wait_for_function("location.hash.startsWith('#case=')")
    address = page.evaluate("location.href")
    assert "token" not in address
    assert "0.4" in address
    page.goto("about:blank")
    page.goto(address)
    sync_api.expect(page.locator("[id='drop.height']")).to_have_value("0.4")
    sync_api.expect(page.locator("#verdict")).to_contain_text("drop height")


def test_recording_on_the_page_is_assessed(browser: Browser, server: Served) -> None:
    page = new_page(browser, server[0])
    page.locator("summary", has_text="Recording").click()
    page.locator("#recording_height").fill("1")
    page.locator("#recording_mass").fill("2.5")
    page.locator("#recording_calibration").fill("2000 N/FS")
    page.locator("#file").set_input_files(RECORDING)
    found = page.locator("#variants li", has_text="drop_1.wav, 1 drop does not conform")
    sync_api.expect(found).to_be_visible(timeout=60_000)
    found.locator("button").click()
    sync_api.expect(page.locator("#variants")).to_be_hidden()
    # What the file does not say of plate and filter.
    page.locator("summary", has_text="Standard uncertainties").click()
    for key, value in (("plate_f0", "1100"), ("plate_Q", "25"), ("filter_cutoff", "5e3")):
        page.locator(f"#recording_{key}").fill(value)
    page.locator("#recording_filter_kind").select_option("bessel")
    page.locator("#file").set_input_files(RECORDING)
    message = page.locator("#message")
    sync_api.expect(message).to_contain_text("“Order of the filter” is missing", timeout=60_000)
    page.locator("#recording_filter_order").fill("4")
    page.locator("#file").set_input_files(RECORDING)
    sync_api.expect(found).to_be_visible(timeout=60_000)
    found.locator("button").click()
    # The same, dropped on the page.
    drop = """([bytes, name]) => {
        const data = new DataTransfer();
        data.items.add(new File([Uint8Array.from(atob(bytes), (c) => c.charCodeAt(0))], name));
        document.body.dispatchEvent(
            new DragEvent("drop", { dataTransfer: data, bubbles: true, cancelable: true }));
    }"""
    page.evaluate(drop, [b64encode(RECORDING.read_bytes()).decode(), RECORDING.name])
    sync_api.expect(found).to_be_visible(timeout=60_000)
    page.evaluate(drop, [b64encode(b"no record").decode(), "<b>note</b>.wav"])
    sync_api.expect(page.locator("#message")).to_contain_text("<b>note</b>.wav", timeout=60_000)


def test_recording_measured_again_is_numbered_and_the_table_fits(
    browser: Browser, server: Served
) -> None:
    page = new_page(browser, server[0], 1300)
    # By keyboard and label only.
    page.locator("summary", has_text="Recording").press("Enter")
    page.get_by_label("Calibration, such as").fill("2000 N/FS")
    page.get_by_label("Drop height, m", exact=True).fill("1")
    page.locator("summary", has_text="Standard uncertainties").press("Enter")
    for label, value in (("calibration, %", "0.5"), ("drop height, m", "0.002")):
        page.get_by_label(f"Uncertainty of the {label}").fill(value)
    variants = page.locator("#variants li")
    for count in (2, 3, 4):
        page.locator("#file").set_input_files(RECORDING)
        sync_api.expect(variants).to_have_count(count, timeout=60_000)
    names = variants.locator("b")
    first = " drop_1.wav, 1 drop"
    sync_api.expect(names).to_have_text(["Hollow sphere", first, f"{first} (2)", f"{first} (3)"])
    # A number that is free again is used again.
    page.get_by_label("Remove drop_1.wav, 1 drop (2)").press("Enter")
    page.get_by_label("Remove drop_1.wav, 1 drop (3)").press("Enter")
    sync_api.expect(names).to_have_text(["Hollow sphere", first])
    page.locator("#file").set_input_files(RECORDING)
    sync_api.expect(names).to_have_text(["Hollow sphere", first, f"{first} (2)"], timeout=60_000)
    height = page.locator("#criteria tbody tr", has_text="Drop height")
    sync_api.expect(height).to_contain_text("1.0000 ± 0.0039")
    table = page.get_by_label("Table of criteria")
    assert table.evaluate("box => box.scrollWidth <= box.clientWidth")
    # On a phone the table scrolls, by keyboard too, and a shadow shows it.
    page.set_viewport_size({"width": 390, "height": 900})
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    assert table.evaluate("box => box.scrollWidth > box.clientWidth")
    assert "gradient" in table.evaluate("box => getComputedStyle(box).backgroundImage")
    table.press("ArrowRight")
    page.wait_for_timeout(500)
    assert table.evaluate("box => box.scrollLeft") > 0
    whole = "spans => spans.every((span) => span.getClientRects().length === 1)"
    assert page.locator("#criteria .value span").evaluate_all(whole)


def test_recording_is_seen_and_cancelled_before_the_server_answers(
    browser: Browser, server: Served
) -> None:
    page = new_page(browser, server[0])
    page.route("**/measure*", lambda _: None)
    page.locator("summary", has_text="Recording").click()
    page.locator("#file").set_input_files(RECORDING)
    sync_api.expect(page.locator(".task")).to_contain_text("Measuring drop_1.wav")
    page.locator(".task button").click()
    sync_api.expect(page.locator(".task")).to_have_count(0)
    sync_api.expect(page.locator("#message")).to_be_hidden()


def test_slow_work_is_cancelled(browser: Browser, server: Served) -> None:
    page = new_page(browser, server[0])
    page.locator("#model").select_option("finite_element")
    sync_api.expect(page.locator("#verdict")).to_contain_text("Finite element", timeout=60_000)
    fill(page, "mesh.polar_elements", "400")
    page.locator(".task button").click()
    sync_api.expect(page.locator(".task")).to_have_count(0)
    sync_api.expect(page.locator("#message")).to_be_hidden()


def test_two_users_do_not_meet(browser: Browser, server: Served) -> None:
    pages = [new_page(browser, server[0]) for _ in range(2)]
    for page, height in zip(pages, ("0.3", "1.5"), strict=True):
        fill(page, "drop.height", height)
    for page, height in zip(pages, ("0.3", "1.5"), strict=True):
        row = page.locator("#criteria tbody tr", has_text="Drop height")
        sync_api.expect(row).to_contain_text(height)


def test_floor_and_room_are_shown(browser: Browser, server: Served) -> None:
    page = new_page(browser, server[0])
    page.locator("#has_room").check()
    sync_api.expect(page.locator("#room_text")).to_contain_text("standardized")
    # The source of a room whose case names none.
    sync_api.expect(page.locator("#model")).to_have_value(ROOM_SOURCE.name)
    sync_api.expect(page.locator("[id='modal_ball.loss_factor']")).to_have_value("0.3")
    page.locator("#model").select_option("hollow_sphere")
    page.locator("#floor").select_option("joist_floor")
    sync_api.expect(page.locator("#floor_title")).to_contain_text("joist floor")
    sync_api.expect(page.locator("#floor_text")).to_contain_text("energy into the floor 2.7")
    page.locator("#pin").click()
    sync_api.expect(page.locator("#ball_text")).to_contain_text("magnified")
    page.locator("#floor").select_option("")
    sync_api.expect(page.locator("#variants li")).to_have_text(
        [
            re.compile(r"^\s*Hollow sphere\s*$"),
            re.compile("A: Hollow sphere Floor: Joist floor, Room below"),
        ]
    )
    page.locator("#variants button").click()
    sync_api.expect(page.locator("#room_section")).to_be_hidden()
    sync_api.expect(page.locator("#floor_section")).to_be_hidden()


def test_construction_fills_floor_and_ceiling(browser: Browser, server: Served) -> None:
    page = new_page(browser, server[0])
    chosen, text = page.locator("#construction"), page.locator("#construction_text")
    name = "concrete 180, screed on 15 MN/m3, ceiling"
    sync_api.expect(text).to_be_hidden()
    chosen.select_option(name)
    sync_api.expect(page.locator("#floor")).to_have_value("plate")
    sync_api.expect(page.locator("#has_room")).to_be_checked()
    for key, value in {
        "plate.thickness": "180", "plate.layer_stiffness": "15",
        "plate.source_x": "0.4", "room.ceiling_mass": "9",
    }.items():  # fmt: skip
        sync_api.expect(page.locator(f"[id='{key}']")).to_have_value(value)
    sync_api.expect(text).to_contain_text("20 mm mineral wool, 180 mm concrete")
    help_text = page.locator("[id='plate.layer_stiffness.help']")
    sync_api.expect(help_text).to_contain_text("EN 29052-1")
    sync_api.expect(page.locator("#room_text")).to_contain_text("standardized")
    page.locator("#pin").click()
    # Another value is none of the library, and has no source.
    fill(page, "plate.layer_stiffness", "14")
    sync_api.expect(chosen).to_have_value("")
    sync_api.expect(text).to_be_hidden()
    sync_api.expect(help_text).not_to_contain_text("EN 29052-1")
    fill(page, "plate.layer_stiffness", "15")
    sync_api.expect(chosen).to_have_value(name)
    # A floor without ceiling takes it away; of two equal floors the chosen one is shown.
    chosen.select_option("filigree slab 200")
    sync_api.expect(page.locator("[id='plate.thickness']")).to_have_value("200")
    sync_api.expect(page.locator("[id='room.ceiling_mass']")).to_have_value("0")
    sync_api.expect(chosen).to_have_value("filigree slab 200")
    sync_api.expect(page.locator("#variants li")).to_have_text(
        [
            re.compile("Modal ball.*Floor: filigree slab 200, Room below"),
            re.compile(f"A: Modal ball.*Floor: {name}, Room below"),
        ]
    )
    page.locator("#reset").click()
    sync_api.expect(chosen).to_have_value("")


def test_rooms_of_variants_are_played_at_one_scale(browser: Browser, server: Served) -> None:
    page = new_page(browser, server[0])
    page.locator("#has_room").check()
    buttons = page.locator("#sounds button")
    sync_api.expect(buttons).to_have_count(1)
    page.locator("#pin").click()
    page.locator("#floor").select_option("joist_floor")
    sync_api.expect(page.locator("#floor_title")).to_contain_text("joist floor")
    sync_api.expect(buttons).to_have_count(2)
    volume, address = [], []
    player = page.locator("#player")
    for i in (0, 1):
        buttons.nth(i).click()
        page.wait_for_function(
            "([other]) => player.src && player.src !== other && player.currentTime > 0.1",
            arg=[address[0] if i else ""],
        )
        volume.append(player.evaluate("(player) => player.volume"))
        address.append(player.evaluate("(player) => player.src"))
    prediction = {
        floor: thud.predict_level(floor=floor(), room=thud.Room())
        for floor in (thud.JoistFloor, thud.Plate)
    }
    scale = [thud.listen(one).full_scale for one in prediction.values()]
    assert volume == pytest.approx([1.0, scale[1] / scale[0]])
    # A removed variant has no sound, and the others are as loud as they were.
    page.locator("#variants button").click()
    sync_api.expect(buttons).to_have_count(1)
    plays = (
        "(address) => new Promise((done) => { const sound = new Audio(address);"
        " sound.oncanplay = () => done(true); sound.onerror = () => done(false); })"
    )
    assert [page.evaluate(plays, one) for one in address] == [True, False]


def test_files_are_downloaded(browser: Browser, server: Served, tmp_path: Path) -> None:
    page = new_page(browser, server[0])
    page.locator("button", has_text="Study").click()
    sync_api.expect(page.locator("#message")).to_contain_text("move a slider first")
    fill(page, "drop.height", "0.8")
    for name in ("case.nml", "force.csv", "report.html", "study.toml"):
        with page.expect_download() as found:
            page.locator(f"[data-file='{name}']").click()
        assert found.value.suggested_filename == name
        found.value.save_as(tmp_path / name)
    assert thud.read_case(tmp_path / "case.nml").drop.height == 0.8
    (height,) = thud.read_study(tmp_path / "study.toml", "sweep").parameters
    assert (height.name, height.low, height.high) == ("height", 0.8, 1.0)


def test_ball_plays(browser: Browser, server: Served) -> None:
    page = new_page(browser, server[0])
    before = page.locator("#instant").input_value()
    page.locator("#play").click()
    sync_api.expect(page.locator("#instant")).not_to_have_value(before)
    page.locator("#play").click()
    sync_api.expect(page.locator("#play")).to_have_text("Play")
    page.locator("#model").select_option("modal_ball")
    sync_api.expect(page.locator("#ball_section")).to_be_hidden()


@pytest.mark.parametrize(
    "case", ['{"model":{"name":"cube"}}', "3", '{"model":"x","drop":7}', "{", '{"floor":["a"]}']
)
def test_link_without_a_case_is_said(browser: Browser, server: Served, case: str) -> None:
    page = new_page(browser, server[0])
    page.goto("about:blank")
    page.goto(f"{server[0].partition('#')[0]}#case={quote(case)}")
    sync_api.expect(page.locator("#message")).to_contain_text("the link does not contain a case")
    sync_api.expect(page.locator("#verdict")).to_contain_text("Hollow sphere does not conform")


def test_verdict_is_seen_while_a_slider_moves_on_a_phone(browser: Browser, server: Served) -> None:
    page = new_page(browser, server[0], 400)
    slider = page.locator("[id='limits.source']")
    page.locator("summary", has_text="Limits").click()
    slider.focus()
    for part in ("#verdict", "#force svg", "#levels svg"):
        sync_api.expect(page.locator(part)).to_be_in_viewport(ratio=1)
    sync_api.expect(slider).to_be_in_viewport(ratio=1)


def test_page_recovers_when_the_server_returns(browser: Browser) -> None:
    with serve() as (address, process):
        page = new_page(browser, address)
        page.locator("#model").select_option("finite_element")
        sync_api.expect(page.locator("#verdict")).to_contain_text("Finite element", timeout=60_000)
        fill(page, "mesh.polar_elements", "400")
        sync_api.expect(page.locator(".task")).to_be_visible()
        # Killed while it computes.
        process.kill()
        process.wait(20)
        sync_api.expect(page.locator("#message")).to_contain_text("the server")
        sync_api.expect(page.locator("#message")).to_contain_text("start it again with")
        fill(page, "mesh.polar_elements", "64")
    port = address.partition("#")[0].strip("/").rpartition(":")[2]
    with serve("--port", port) as (address, _):
        sync_api.expect(page.locator("#message")).to_contain_text(
            "open the full address", timeout=10_000
        )
        # A new server has a new token, which the address brings into this browser.
        page.context.new_page().goto(address)
        sync_api.expect(page.locator("#message")).to_be_hidden(timeout=20_000)
        sync_api.expect(page.locator("[id='mesh.polar_elements']")).to_have_value("64")


@pytest.mark.parametrize(("width", "scheme"), [(1400, "light"), (400, "dark")])
def test_page_is_accessible(
    browser: Browser,
    server: Served,
    width: int,
    scheme: str,
    tmp_path: Path,
) -> None:
    page = new_page(browser, server[0], width, scheme)
    page.locator("#pin").click()
    page.locator("#has_room").check()
    page.locator("#construction").select_option("CLT 160, gravel")
    sync_api.expect(page.locator("#room_text")).to_contain_text("standardized")
    page.locator("summary", has_text="Recording").click()
    page.locator("summary", has_text="Standard uncertainties").click()
    page.screenshot(path=tmp_path / "page.png", full_page=True)
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    found = axe.Axe().run(page).response["violations"]
    serious = [one["id"] for one in found if one["impact"] in {"serious", "critical"}]
    assert not serious
