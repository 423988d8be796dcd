"""The page of the program in a browser: its three doors, and what its users met.

Each state of the page is an approved snapshot (`pytest --renew`), whose numbers are those of the
library; the other tests are about what a snapshot does not show.
"""

from __future__ import annotations

import csv
import re
import time
from base64 import b64encode
from functools import partial
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import numpy as np
import pytest
from conftest import REPOSITORY
from explorer_server import Served, serve

import thud
from thud.explorer.recording_fields import FOLDED

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from playwright.sync_api import Browser, Locator, Page, Route

sync_api = pytest.importorskip("playwright.sync_api")
axe = pytest.importorskip("axe_playwright_python.sync_playwright")
# Machines that test may be busy.
TIMEOUT = 60_000
expect = sync_api.expect
expect.set_options(timeout=TIMEOUT)
pytestmark = pytest.mark.slow
RECORDINGS = REPOSITORY / "inputs/recordings"
RECORDING = RECORDINGS / "drop_1.csv"
# What the sound files need, and what is known of all recordings: see inputs/recordings/truth.toml.
CALIBRATION = "10 V/FS, 0.5 mV/pC, 4 pC/N"
DROP = {"height": "1", "mass": "2.5"}
PLATE = {"plate_f0": "1100", "plate_Q": "25"}
STATED = {
    **DROP, **PLATE, "plate_share": "1", "plate_f0_uncertainty": "0.1",
    "calibration_uncertainty": "0.1",
}  # fmt: skip
DOORS = ("recording", "ball", "floor")
# Height of screens, by their width, px.
SCREENS = {1400: 900, 1024: 768, 400: 800}
OUTDATED = re.compile("outdated")
# Time after which a change is a step of its own and is stored, ms.
STEP = 600
HEIGHT, WALL = "drop.height", "ball.wall_thickness"


@pytest.fixture(scope="module")
def server() -> Iterator[Served]:
    with serve() as found:
        yield found


def new_page(browser: Browser, address: str, width: int = 1400, **options: Any) -> Page:  # noqa: ANN401 - of playwright
    """Return the page of a new user, its first answer shown; a fault of its script fails."""
    context = browser.new_context(
        viewport={"width": width, "height": SCREENS[width]}, reduced_motion="reduce",
        permissions=["clipboard-read", "clipboard-write"], **options,
    )  # fmt: skip
    page = context.new_page()
    page.set_default_timeout(TIMEOUT)
    page.on("pageerror", lambda error: pytest.fail(str(error)))
    page.goto(address)
    page.locator("#model").wait_for()
    settle(page)
    return page


@pytest.fixture
def page(browser: Browser, server: Served) -> Iterator[Page]:
    """Return the page of a new user on a wide screen."""
    page = new_page(browser, server[0])
    yield page
    page.context.close()


def see(page: Page, selector: str = "", key: str = "") -> Any:  # noqa: ANN401 - of playwright
    """Return what can be asserted of an element, or of the field of a key."""
    return expect(page.locator(selector or f"[id='{key}']"))


def settle(page: Page) -> None:
    """Wait for the answer to the last change."""
    page.wait_for_timeout(100)
    see(page, "#panel").to_have_attribute("aria-busy", "false")
    see(page, "body").not_to_have_class(OUTDATED)


def field(page: Page, key: str) -> Locator:
    return page.locator(f"[id='{key}']")


def fill(page: Page, key: str, value: str) -> None:
    field(page, key).fill(value)
    page.keyboard.press("Tab")


def enter(page: Page, key: str, value: str) -> None:
    fill(page, key, value)
    settle(page)


def type_into(page: Page, key: str, text: str, *keys: str) -> None:
    """Select the text of a field and type another and keys, without leaving the field."""
    field(page, key).click()
    page.keyboard.press("Control+a")
    page.keyboard.type(text)
    for name in keys:
        page.keyboard.press(name)


def click(page: Page, selector: str) -> None:
    page.locator(selector).click()
    settle(page)


def choose(page: Page, selector: str, option: str) -> None:
    page.locator(selector).select_option(option)
    settle(page)


def open_door(page: Page, door: str) -> None:
    click(page, f"#door_{door}")


def load(page: Page, files: Any = RECORDING, **values: str) -> None:  # noqa: ANN401 - of playwright
    """State values in the door of recordings, choose files and wait for the answer."""
    open_door(page, "recording")
    if values.keys() & set(FOLDED):
        page.locator("#inputs summary").click()
    for name, value in values.items():
        page.locator(f"#recording_{name}").fill(value)
    page.locator("#file").set_input_files(files)
    settle(page)


def save(page: Page, path: Path, act: Callable[[], None]) -> str:
    """Save what an action downloads; return its name."""
    with page.expect_download() as found:
        act()
    found.value.save_as(path)
    name: str = found.value.suggested_filename
    return name


def drop_file(page: Page, content: bytes, name: str, selector: str = "body") -> None:
    page.locator(selector).evaluate(
        """(target, [bytes, name]) => {
            const data = new DataTransfer();
            data.items.add(new File([Uint8Array.from(atob(bytes), (c) => c.charCodeAt(0))], name));
            target.dispatchEvent(
                new DragEvent("drop", { dataTransfer: data, bubbles: true, cancelable: true }));
        }""",
        [b64encode(content).decode(), name],
    )


def rename(page: Page, label: str, name: str) -> None:
    page.once("dialog", lambda dialog: dialog.accept(name))
    page.get_by_label(f"Rename {label}", exact=True).click()


def names_of(page: Page) -> list[str]:
    names: list[str] = page.locator("#variants .name").all_inner_texts()
    return names


def share(page: Page, selector: str) -> None:
    """Click an entry of the menu of the case."""
    page.locator("#menu summary").click()
    page.locator(selector).click()


def numbers_in(page: Page, table: str, column: int) -> list[list[float]]:
    """Return the numbers in each cell of a column of a table; the first column has heads."""
    texts = page.locator(f"{table} tbody tr td:nth-child({column + 1})").all_inner_texts()
    return [[float(number) for number in re.findall(r"\d+\.?\d*", text)] for text in texts]


def height_of(page: Page) -> float:
    return numbers_in(page, "#criteria", 2)[-1][0]


def predict(name: str) -> thud.RoomPrediction:
    return thud.predict_level(thud.solve(thud.construction(name).case()))


# ---- Each state of the page.


def _changes_of_a_ball(page: Page) -> None:
    enter(page, "modal_ball.loss_factor", "0.2")
    page.locator("#improve").click()
    see(page, "#result li").not_to_have_count(0)
    # Criteria explain themselves.
    page.locator(".term summary", has_text="Contact time").press("Enter")


def _press_curve(page: Page) -> None:
    curve = thud.compress(thud.Ball(youngs_modulus=1.75e6), thud.ModalBall(), max_deflection=0.03)
    force = curve.force + np.random.default_rng(1).normal(size=curve.force.size)
    rows = [f"{1e3 * x:.5g},{y:.5g}" for x, y in zip(curve.deflection, force, strict=True)]
    page.locator("#press summary").click()
    # A drop on this zone is a curve, not a recording.
    content = "\n".join(["deflection (mm),force (N)", *rows]).encode()
    drop_file(page, content, "press 7.csv", "#press_zone")
    see(page, "#result").to_contain_text("press 7.csv")
    settle(page)


def _conforming_recording(page: Page) -> None:
    impact = thud.solve(model=thud.ModalBall(loss_factor=0.28))
    force = np.pad(impact.floor_force, round(0.1 * impact.sample_rate))
    force += np.random.default_rng(1).normal(scale=0.5, size=len(force))
    rows = [f"{i / impact.sample_rate:.9g},{y:.6g}" for i, y in enumerate(force)]
    content = "\n".join(["time_s,force_N", *rows]).encode()
    uncertain = dict.fromkeys([f"{name}_uncertainty" for name in (*DROP, "calibration")], "0.001")
    file = {"name": "good.csv", "mimeType": "text/csv", "buffer": content}
    load(page, file, **DROP, **uncertain)


def _refused_recording(page: Page) -> None:
    drop_file(page, b"no record", "<b>note.wav")
    see(page, "#message").to_be_visible()


def _required_level(page: Page) -> None:
    open_door(page, "floor")
    choose(page, "#construction", "concrete 180")
    enter(page, "room.required", "49")


def _improved_floor(page: Page, **answer: Any) -> None:  # noqa: ANN401 - of the server
    page.route("**/improve", lambda route: route.fulfill(json={"answer": answer}))
    _required_level(page)
    page.locator("#improve").click()
    see(page, "#result > *").not_to_have_count(0)


# Answers of the server on floors.
REACHED = {"level": 48, "uncertainty": 2.3, "probability": 0.9}
CHANGE = {"key": "plate.thickness", "value": 0.24, "factor": 4 / 3, **REACHED}
NONE: dict[str, Any] = {
    "changes": [],
    "reason": "no_layer",
    "constructions": [{"name": "X", **REACHED}],
}


def _compared_sources(page: Page) -> None:
    load(page, **DROP, **PLATE)
    open_door(page, "ball")
    page.locator("#keep").click()
    choose(page, "#model", "two_mass")


def _compared_rooms(page: Page) -> None:
    _required_level(page)
    page.locator("#keep").click()
    choose(page, "#construction", "CLT 200")


def _floor_without_room(page: Page) -> None:
    _required_level(page)
    page.locator("#keep").click()
    page.locator("#has_room").uncheck()
    settle(page)


STATES: dict[str, Callable[[Page], None]] = {
    **{door: partial(open_door, door=door) for door in DOORS},
    "changes_of_a_ball": _changes_of_a_ball,
    "press_curve": _press_curve,
    "recording_with_questions": load,
    "recording_that_conforms": _conforming_recording,
    "recording_that_does_not": partial(load, **STATED),
    "recording_refused": _refused_recording,
    "changes_of_a_floor": partial(_improved_floor, changes=[CHANGE]),
    "no_change_of_a_floor": partial(_improved_floor, **NONE),
    "compared_sources": _compared_sources,
    "compared_rooms": _compared_rooms,
    "floor_without_room": _floor_without_room,
    "phone": _changes_of_a_ball,
}


@pytest.mark.parametrize("state", STATES)
def test_page_is_the_approved_one(
    browser: Browser, server: Served, state: str, approved: Callable[[str, str], None]
) -> None:
    page = new_page(browser, server[0], 400 if state == "phone" else 1400)
    STATES[state](page)
    # The fields are those of the doors.
    if state not in DOORS:
        page.locator("#inputs").evaluate("form => form.remove()")
    approved(f"page_{state}.yaml", page.locator("main").aria_snapshot())
    page.context.close()


def test_numbers_on_the_page_are_those_of_the_library(page: Page) -> None:
    impact = thud.solve()
    shown = [value for value, *_ in numbers_in(page, "#criteria", 2)]
    assert shown[:5] == pytest.approx(impact.levels(), abs=0.0051)
    assert shown[5:8] == pytest.approx([1e3 * impact.contact_time, impact.restitution, 1], abs=6e-3)
    _required_level(page)
    prediction = predict("concrete 180")
    see(page, "#verdict").to_contain_text(str(prediction.rating))
    shown = [number for numbers in numbers_in(page, "#ratings", 1) for number in numbers]
    ratings = [[rating.level, rating.uncertainty] for rating in prediction.ratings.values()]
    # Behind them the class, 4: at most 49 dB.
    expected = [*np.ravel(ratings), 4, 49, *prediction.octave_level]
    assert shown == pytest.approx(expected, abs=0.051)
    parts = [value for value in prediction.rating.contributions.values() if value >= 0.05]
    assert [x for (x,) in numbers_in(page, "#contributions", 1)] == pytest.approx(parts, abs=0.051)
    load(page, **STATED)
    # The true level is 10.18 dB.
    level, uncertainty = numbers_in(page, "#criteria", 2)[4]
    assert abs(level - 10.18) < max(uncertainty, 0.05)


# ---- The three questions.


def test_recording_asks_for_what_its_verdict_needs(page: Page, tmp_path: Path) -> None:
    drop_file(page, RECORDING.read_bytes(), RECORDING.name)
    settle(page)
    see(page, "#door_recording").to_have_attribute("aria-selected", "true")
    # The plate rings, and is asked for at once, with what the record shows of it.
    asks = page.locator("#asks")
    see(page, "#ask_plate_f0").to_have_value("1100")
    see(page, "#recording_plate_f0").to_be_visible()
    page.locator("#ask_height").fill("1")
    page.locator("#ask_mass").fill("2.5")
    # One button sends all; what was typed stays while the page shows other results.
    page.locator("#thirds").evaluate("box => box.dispatchEvent(new Event('change'))")
    see(page, "#ask_height").to_have_value("1")
    expect(asks.locator("button")).to_have_count(1)
    # What is typed into a field wins over what is asked for, and the other way round.
    page.route("**/measure", lambda _: None)
    page.locator("#recording_plate_Q").fill("25")
    see(page, "#ask_plate_Q").to_have_value("25")
    see(page, "#recording_mass").to_have_value("2.5")
    page.unroute("**/measure")
    click(page, "#assess")
    # The share of the resonance is assumed, until it is stated.
    expect(asks.locator("input")).to_have_count(1)
    see(page, "#recording_plate_f0").to_have_value("1100")
    page.locator("#ask_plate_share").fill("1")
    click(page, "#assess")
    expect(asks).to_be_hidden()
    assert page.evaluate("document.activeElement !== document.body")
    # What is not stated leaves the result open, until it is.
    for name in ("calibration_uncertainty", "plate_f0_uncertainty"):
        see(page, "#verdict").to_have_class("undecided")
        page.locator("#inputs details").evaluate("details => { details.open = true; }")
        enter(page, f"recording_{name}", STATED[name])
    see(page, "#verdict").to_have_class("does_not_conform")
    save(page, tmp_path / "report.html", page.locator("#report").click)
    assert "drop_1.csv" in (tmp_path / "report.html").read_text()
    # Values of an earlier recording are in sight.
    page.wait_for_timeout(STEP)
    page.reload()
    for name, value in (("plate_Q", "25"), ("mass", "2.5"), ("plate_share", "1")):
        see(page, f"#recording_{name}").to_have_value(value)
        see(page, f"#recording_{name}").to_be_visible()


def test_calibration_is_asked_for_and_the_laboratory_states_it(page: Page) -> None:
    open_door(page, "recording")
    page.locator("#file").set_input_files(RECORDINGS / "drop_1.wav")
    page.locator("#ask_calibration").fill(CALIBRATION)
    click(page, "#assess")
    see(page, "#recording_calibration").to_have_value(CALIBRATION)
    page.locator("#recording_calibration").fill("")
    subject = see(page, "#verdict .subject")
    for files, expected in (
        (RECORDINGS / "lab.toml", "drop_1.wav, 1 drop "),
        ([RECORDINGS / f"drop_{i}.wav" for i in (2, 3)], "drop_1.wav and 2 more, 3 drops "),
    ):
        page.locator("#file").set_input_files(files)
        subject.to_have_text(expected)
    page.get_by_label("Remove drop_2.wav").press("Enter")
    subject.to_have_text("drop_1.wav and 1 more, 2 drops ")


def test_error_of_a_recording_is_at_its_field(page: Page) -> None:
    drop_file(page, b"force, N\n" + b"1\n2\n3\n" * 99, "record.csv")
    see(page, "#recording_sample_rate").to_have_attribute("aria-invalid", "true")
    for selector in ("#recording_sample_rate", "#ask_sample_rate"):
        see(page, selector).to_be_visible()
    page.get_by_label("Remove record.csv").click()
    page.locator("#recording_height").fill("-1")
    page.locator("#file").set_input_files(RECORDING)
    see(page, "#recording_height").to_have_attribute("aria-invalid", "true")
    see(page, "#message").to_contain_text("Drop height")


def test_construction_fills_floor_and_ceiling(page: Page) -> None:
    open_door(page, "floor")
    choose(page, "#construction", "concrete 180")
    subject = see(page, "#verdict .subject")
    subject.to_have_text("Concrete 180 ")
    enter(page, "plate.thickness", "190")
    # The room is not part of the construction.
    enter(page, "room.reverberation_time", "0.8")
    subject.to_have_text("Concrete 180, slab changed to 190 mm, T 0.8 s ")
    # Chosen by typing; it names its sources.
    construction = page.locator("#construction")
    construction.focus()
    page.keyboard.type("concrete 180, screed on 15 MN/m3, c")
    settle(page)
    expect(construction).to_be_focused()
    expect(construction).to_have_value("concrete 180, screed on 15 MN/m3, ceiling")
    see(page, key="room.ceiling_mass").to_have_value("9")
    see(page, key="plate.layer_stiffness.help").to_contain_text("EN 29052-1")
    enter(page, "plate.layer_stiffness", "14")
    expect(construction).to_have_value("")
    # Floors without a plate have no room, which returns with the plate.
    for floor in ("measured_mobility", "modal_floor", "infinite_plate", "plate"):
        choose(page, "#floor", floor)
        see(page, "#message").to_be_hidden()
    see(page, "#has_room").to_be_checked()


# ---- What users met.


# Of the models in this order, MPa; others are no ball of one material.
MODULI = {
    "finite_element": "2.06", "hunt_crossley": "", "measured_modes": "", "two_mass": "",
    "modal_ball": "1.56",
}  # fmt: skip


def test_model_brings_its_values_and_fields(page: Page) -> None:
    for name, modulus in MODULI.items():
        choose(page, "#model", name)
        see(page, "#message").to_be_hidden()
        # Fields without an effect are not there.
        see(page, key=WALL).to_have_count(int(bool(modulus)))
        if modulus:
            see(page, key="ball.youngs_modulus").to_have_value(modulus)
    see(page, key="modal_ball.fractional_order").to_have_count(0)
    # At once, before the event of the unfolding.
    field(page, "modal_ball.damping_law").evaluate(
        "law => { document.querySelector('#more summary').click(); law.value = 'fractional'; "
        "law.dispatchEvent(new Event('change')); }"
    )
    see(page, key="modal_ball.fractional_order").to_be_visible()


def test_bad_value_is_named_at_its_field(page: Page) -> None:
    wall = field(page, WALL)
    fill(page, WALL, "200")
    for selector in ("#message", f"[id='{WALL}.error']"):
        see(page, selector).to_contain_text("Wall thickness = 200 mm")
    expect(wall).to_have_attribute("aria-invalid", "true")
    see(page, "body").to_have_class(OUTDATED)
    enter(page, WALL, "30")
    see(page, "#message").to_be_hidden()
    assert wall.get_attribute("aria-invalid") is None
    # A soft ball is longer on the floor than the record, whose field is folded.
    fill(page, "ball.youngs_modulus", "0.1")
    duration = field(page, "sampling.duration")
    expect(duration).to_have_attribute("aria-invalid", "true")
    expect(duration).to_be_focused()
    expect(duration).to_be_in_viewport()


@pytest.mark.parametrize("is_same_page", [True, False])
def test_link_without_a_token_shows_how_to_open_it_and_then_its_case(
    browser: Browser, server: Served, *, is_same_page: bool
) -> None:
    sender = new_page(browser, server[0])
    enter(sender, HEIGHT, "0.7")
    share(sender, "#link")
    expect(sender.locator(".note")).to_be_visible()
    link = sender.evaluate("navigator.clipboard.readText()")
    context = browser.new_context()
    page = context.new_page()
    page.goto(link)
    see(page, "#message").to_contain_text("Open the full address")
    assert page.locator("main").inner_text() == page.locator("#message").inner_text()
    (page if is_same_page else context.new_page()).goto(server[0])
    see(page, key=HEIGHT).to_have_value("0.7")


@pytest.mark.parametrize("width", [1400, 400])
def test_focus_moves_no_field(browser: Browser, server: Served, width: int) -> None:
    page = new_page(browser, server[0], width)
    wall, mass = field(page, WALL), field(page, "ball.mass")
    top, bottom = (f"box => box.getBoundingClientRect().{y} + scrollY" for y in ("top", "bottom"))
    before = mass.evaluate(top)
    wall.click()
    see(page, key=f"{WALL}.help").to_be_visible()
    assert mass.evaluate(top) == before
    # A field behind the help takes the click.
    mass.dblclick()
    expect(mass).to_be_focused()
    type_into(page, "ball.mass", "2.4", "Tab")
    expect(mass).to_have_value("2.4")
    expect(wall).to_have_value("32")
    # A field at the bottom stands above its help.
    source = field(page, "limits.source")
    source.evaluate("box => box.scrollIntoView({ block: 'end' })")
    source.focus()
    shown, box = field(page, "limits.source.help").bounding_box(), source.bounding_box()
    assert shown
    assert box
    assert box["y"] + box["height"] <= shown["y"]
    # It hides neither its field nor the row beside it.
    for key in (WALL, "ball.mass"):
        field(page, key).focus()
        under = field(page, f"{key}.help").evaluate(top)
        assert max(one.evaluate(bottom) for one in (wall, mass)) < under


def test_enter_on_an_asked_value_goes_on_to_the_next(browser: Browser, server: Served) -> None:
    page = new_page(browser, server[0], 400)
    load(page)
    page.locator("#ask_height").fill("1")
    page.locator("#ask_height").press("Enter")
    settle(page)
    see(page, "#ask_height").to_have_count(0)
    see(page, "#ask_plate_share").to_be_focused()
    # The last one leads back to the answer.
    page.locator("#ask_plate_share").fill("1")
    page.locator("#ask_mass").fill("2.5")
    page.locator("#ask_mass").press("Enter")
    settle(page)
    see(page, "#asks").to_be_hidden()
    assert page.evaluate("scrollY") == 0


def test_keys_move_by_round_steps_and_to_the_ends(page: Page) -> None:
    wall = field(page, WALL)
    for selector in (f"[id='{WALL}']", f"[id='{WALL}'] + input"):
        page.locator(selector).focus()
        values = []
        for key in ("ArrowDown", "ArrowDown", "ArrowUp", "ArrowUp"):
            page.keyboard.press(key)
            values.append(wall.input_value())
        assert values == ["31", "30", "31", "32"]
    type_into(page, WALL, "30.7", "Tab")
    wall.focus()
    page.keyboard.press("ArrowUp")
    assert wall.input_value() == "31"
    for key, ends in {"modal_ball.loss_factor": ("0.11", "0.93"), HEIGHT: ("0.34", "3")}.items():
        page.locator(f"[id='{key}'] + input").focus()
        for name, value in zip(("Home", "End"), ends, strict=True):
            page.keyboard.press(name)
            see(page, key=key).to_have_value(value)
    settle(page)
    assert height_of(page) == 3


# ---- Comparison, history, storage and link.


def test_variants_are_named_by_what_differs(page: Page) -> None:
    page.locator("#keep").click()
    enter(page, WALL, "30")
    assert names_of(page) == ["Wall 30 mm", "Wall 32 mm"]
    # A variant keeps its name while another model is computed.
    page.locator("#keep").click()
    page.locator("#keep").click()
    page.route("**/solve", lambda _: None)
    page.locator("#model").select_option("hollow_sphere")
    assert names_of(page)[1:] == ["Wall 32 mm", "Wall 30 mm (2)", "Wall 30 mm (3)"]
    page.unroute("**/solve")
    page.reload()
    settle(page)
    choose(page, "#model", "two_mass")
    assert names_of(page)[:2] == ["Tyre: belt and rim", "Standard ball"]
    rename(page, "Tyre: belt and rim", "Ours")
    assert names_of(page)[0] == "Ours"
    for _ in range(3):
        page.locator("#variants .remove").first.click()
    see(page, "#variants_section").to_be_hidden()
    # The height of a room is not that of the drop.
    open_door(page, "floor")
    page.locator("#keep").click()
    enter(page, "room.height", "2.8")
    assert names_of(page)[0] == "Room height 2.8 m"


def test_fits_set_the_modulus_of_the_ball_unless_it_was_changed(page: Page) -> None:
    modulus = field(page, "ball.youngs_modulus")
    load(page, **DROP, **PLATE)
    page.locator("#fit").click()
    see(page, "#door_ball").to_have_attribute("aria-selected", "true")
    settle(page)
    assert 1.4 < float(modulus.input_value()) < 1.6
    page.locator("#variants .remove").click()
    _press_curve(page)
    assert float(modulus.input_value()) == pytest.approx(1.75, 0.01)
    see(page, "#verdict .subject").to_have_text("press 7 ")
    # Another value is no longer that of the curve.
    enter(page, "ball.youngs_modulus", "1.6")
    see(page, "#verdict .subject").not_to_contain_text("press 7")
    # A value that is entered while a fit runs.
    load(page)

    def delay(route: Route) -> None:
        time.sleep(0.7)
        route.continue_()

    page.route("**/fit", delay)
    page.locator("#fit").click()
    open_door(page, "ball")
    fill(page, "ball.mass", "2.45")
    see(page, "#message").to_contain_text("The fit was not taken over")
    assert field(page, "ball.mass").input_value() == "2.45"


def test_changes_are_undone_and_redone(page: Page) -> None:
    height = see(page, key=HEIGHT)
    enter(page, HEIGHT, "0.9")
    page.wait_for_timeout(STEP)
    # Within the time in which changes become one step.
    fill(page, HEIGHT, "0.8")
    page.keyboard.press("Control+z")
    height.to_have_value("0.9")
    page.locator("#undo").click()
    height.to_have_value("1")
    settle(page)
    assert height_of(page) == 1
    for key in ("Control+Shift+Z", "Control+y"):
        page.keyboard.press(key)
    height.to_have_value("0.8")
    page.locator("#undo").click()
    page.locator("#redo").click()
    height.to_have_value("0.8")
    # A button that is disabled gives the focus to its neighbor.
    see(page, "#undo").to_be_focused()
    settle(page)
    for count in (2, 3):
        page.locator("#keep").click()
        see(page, "#variants tbody tr").to_have_count(count)
    page.keyboard.press("Control+z")
    see(page, "#variants tbody tr").to_have_count(2)
    # The keys of a field are its own.
    type_into(page, HEIGHT, "0.7", "Control+z")
    page.wait_for_timeout(100)
    see(page, "#variants tbody tr").to_have_count(2)
    # A change is stored at once when the page is left.
    type_into(page, HEIGHT, "0.6")
    page.reload()
    height.to_have_value("0.6")


def test_link_carries_the_case_and_is_a_step(page: Page) -> None:
    enter(page, HEIGHT, "0.4")
    for _ in range(2):
        share(page, "#link")
    address = page.evaluate("navigator.clipboard.readText()")
    assert "token" not in address
    see(page, "#link").to_have_text("Copy link")
    enter(page, HEIGHT, "0.7")
    # The address is entered into the open page.
    page.evaluate("address => { location.href = address; }", address)
    see(page, key=HEIGHT).to_have_value("0.4")
    settle(page)
    page.locator("#undo").click()
    see(page, key=HEIGHT).to_have_value("0.7")


def test_link_without_a_case_is_said(page: Page, server: Served) -> None:
    values = (
        '["a"]', '{"model":{"name":"cube"}}', '{"model":"modal_ball","drop":7}',
        '{"model":{"name":"modal_ball"},"drop":{"height":{}}}',
    )  # fmt: skip
    doors = [f'{{"door":"ball","values":{one}}}' for one in values]
    for case in ("3", "{", '{"door":"recording","values":{"model":{"name":"modal_ball"}}}', *doors):
        page.goto("about:blank")
        page.goto(f"{server[0].partition('#')[0]}#case={quote(case)}")
        settle(page)
        see(page, "#message").to_contain_text("The link does not contain a case")
        see(page, "#verdict").to_have_class("conforms")


def test_case_and_view_return_and_tabs_have_their_own(page: Page, server: Served) -> None:
    assert page.locator("#levels .limits").count() == 5
    page.locator("#thirds").check()
    assert page.locator("#levels circle:visible").count() == 15
    assert page.locator("#levels .limits").count() == 0
    page.locator("#keep").click()
    enter(page, HEIGHT, "0.7")
    rename(page, "Drop 0.7 m", "Low")
    page.reload()
    settle(page)
    assert names_of(page) == ["Low", "Drop 1 m"]
    see(page, "#thirds").to_be_checked()
    # Another tab has a case of its own, and begins with the last one.
    other = page.context.new_page()
    page.wait_for_timeout(STEP)
    other.goto(server[0])
    see(other, key=HEIGHT).to_have_value("0.7")
    enter(other, HEIGHT, "0.5")
    other.wait_for_timeout(STEP)
    page.reload()
    see(page, key=HEIGHT).to_have_value("0.7")
    share(page, "#reset")
    settle(page)
    see(page, key=HEIGHT).to_have_value("1")
    see(page, "#variants_section").to_be_hidden()


# ---- State of the page.


def test_answer_of_other_values_is_not_shown_as_current(page: Page, tmp_path: Path) -> None:
    load(page, **DROP)
    height = field(page, "recording_height")
    # (a) A value that was typed before the door changed.
    type_into(page, "recording_height", "1.5")
    see(page, "body").to_have_class(OUTDATED)
    for selector in ("#report", "#levels_figure .tools button"):
        see(page, selector).to_be_disabled()
    click(page, "#door_ball")
    # A recording that is not assessed with its present values is in no comparison.
    assert page.locator("#variants_section").is_hidden()
    open_door(page, "recording")
    assert (height.input_value(), height_of(page)) == ("1.5", 1.5)
    see(page, "#report").to_be_enabled()
    # (b) Steps of Undo have the answers to their values.
    for value in ("1", "1.2", "0.8"):
        enter(page, "recording_height", value)
        page.wait_for_timeout(STEP)
    click(page, "#undo")
    assert (height.input_value(), height_of(page)) == ("1.2", 1.2)
    save(page, tmp_path / "report.html", page.locator("#report").click)
    assert re.search(r"1\.20* m|1\.200", (tmp_path / "report.html").read_text())
    # (c, d) Files that come and go while the door changes.
    page.locator("#file").set_input_files(RECORDINGS / "drop_2.wav")
    page.locator("#door_ball").click()
    page.locator("#door_recording").click()
    see(page, "#message").to_contain_text("drop_2.wav")
    see(page, "body").to_have_class(OUTDATED)
    page.get_by_label("Remove drop_2.wav").click()
    page.locator("#door_ball").click()
    open_door(page, "recording")
    see(page, "#message").to_be_hidden()
    # (e) A cancelled assessment.
    page.route("**/measure", lambda _: None)
    fill(page, "recording_height", "0.9")
    page.locator(".task button").click()
    see(page, "body").to_have_class(OUTDATED)
    page.locator("#door_ball").click()
    page.unroute("**/measure")
    page.locator("#door_recording").click()
    see(page, "#verdict .subject").to_have_text("drop_1.csv, 1 drop ")
    settle(page)
    assert height_of(page) == 0.9
    # (f) An error returns with its door.
    fill(page, "recording_calibration", "abc")
    see(page, "#message").to_contain_text("alibration")
    page.locator("#door_ball").click()
    page.locator("#door_recording").click()
    see(page, "#message").to_contain_text("alibration")
    see(page, "body").to_have_class(OUTDATED)
    see(page, "#report").to_be_disabled()


def test_removed_recording_returns_with_undo(page: Page) -> None:
    load(page, **DROP)
    open_door(page, "ball")
    # A name that is given in another door belongs to the recording.
    rename(page, "drop_1.csv, 1 drop", "Plate 3")
    expect(page.locator("#variants .name").nth(1)).to_be_focused()
    page.get_by_label("Remove Plate 3").click()
    see(page, "#variants_section").to_be_hidden()
    click(page, "#undo")
    assert names_of(page) == ["Standard ball", "Plate 3"]
    open_door(page, "recording")
    see(page, "#verdict .subject").to_have_text("Plate 3 ")


def test_typed_value_is_computed_after_a_pause(page: Page) -> None:
    body, height = see(page, "body"), field(page, HEIGHT)
    # A digit that is taken back.
    height.focus()
    page.keyboard.press("End")
    page.keyboard.type("0")
    body.to_have_class(OUTDATED)
    page.keyboard.press("Backspace")
    body.not_to_have_class(OUTDATED)
    # A value without Enter; its text stays as typed until the field is left.
    type_into(page, HEIGHT, "0.90")
    settle(page)
    assert (height_of(page), height.input_value()) == (0.9, "0.90")
    # A button that is clicked at once acts on the typed value.
    enter(page, "modal_ball.loss_factor", "0.2")
    sent: list[str] = []
    page.on("request", lambda request: sent.append(f"{request.url} {request.post_data}"))
    type_into(page, HEIGHT, "1")
    page.locator("#improve").click()
    expect(page.locator("#result li").first).to_contain_text("Loss factor")
    (asked,) = [text for text in sent if "/improve" in text]
    assert "height" not in asked
    # The focus is on the verdict after the button has gone.
    page.locator("#result button").first.click()
    settle(page)
    see(page, key="modal_ball.loss_factor").not_to_have_value("0.2")
    see(page, "#verdict").to_be_focused()
    page.locator("#next button").click()
    see(page, "#door_floor").to_be_focused()
    # A recording, too.
    load(page, **DROP)
    type_into(page, "recording_height", "1.1")
    body.to_have_class(OUTDATED)
    settle(page)
    assert height_of(page) == 1.1


def test_numbers_are_read_or_refused_but_not_changed(page: Page) -> None:
    height, message = field(page, HEIGHT), see(page, "#message")
    type_into(page, HEIGHT, "1,5", "Tab")
    settle(page)
    assert (height.input_value(), height_of(page)) == ("1.5", 1.5)
    for text in ("1,250", "0x10", "1e", "1 000", " "):
        type_into(page, HEIGHT, text, "Enter")
        message.to_be_visible()
        expect(height).to_have_attribute("aria-invalid", "true")
        see(page, "body").to_have_class(OUTDATED)
        assert height.input_value() == text
    # The headline stays in front of what scrolls below it.
    assert page.locator("#verdict").evaluate("box => getComputedStyle(box).opacity") == "1"
    # Keys begin with the last value, and the wheel changes none.
    page.keyboard.press("ArrowUp")
    settle(page)
    expect(height).to_have_value("1.51")
    message.to_be_hidden()
    height.hover()
    page.mouse.wheel(0, 100)
    page.wait_for_timeout(100)
    assert height.input_value() == "1.51"
    # Lists.
    choose(page, "#model", "measured_modes")
    for text in ("24,5 30; 41", "24.5, 30, 41"):
        fill(page, "measured_modes.frequency", text)
        see(page, key="measured_modes.frequency").to_have_value("24.5 30 41")
    fill(page, "measured_modes.frequency", "24,30,41")
    message.to_contain_text("“24,30,41”")
    # A recording.
    load(page, height="1,0", mass="2.5")
    assert height_of(page) == 1
    fill(page, "recording_height", "1e")
    see(page, "#recording_height").to_have_attribute("aria-invalid", "true")
    see(page, "#report").to_be_disabled()


@pytest.mark.parametrize("fault", ["denied", "full"])
def test_page_works_without_storage(browser: Browser, server: Served, fault: str) -> None:
    page = browser.new_context().new_page()
    page.on("pageerror", lambda error: pytest.fail(str(error)))
    scripts = {
        "denied": "for (const name of ['localStorage', 'sessionStorage']) Object.defineProperty("
        "window, name, { get() { throw new DOMException('no', 'SecurityError'); } });",
        "full": "Storage.prototype.setItem = () => { throw new DOMException('no', 'Quota'); };",
    }
    page.add_init_script(scripts[fault])
    page.goto(server[0])
    settle(page)
    enter(page, HEIGHT, "0.9")
    assert height_of(page) == 0.9
    page.locator("#undo").click()
    see(page, key=HEIGHT).to_have_value("1")


# ---- Files.


def test_values_of_plots_are_saved(page: Page, tmp_path: Path) -> None:
    # A name is no formula of a spreadsheet.
    page.locator("#keep").click()
    rename(page, "Standard ball", "=1+1")
    page.locator("#variants .remove").click()
    button = page.locator("#levels_figure .tools button")
    assert save(page, tmp_path / "CSV", button.click) == "levels.csv"
    header, *rows = csv.reader((tmp_path / "CSV").read_text().splitlines())
    assert header == [
        "Octave band, Hz", "'=1+1, dB", "'=1+1, low (95 %), dB", "'=1+1, high (95 %), dB",
        "lower limit, dB", "upper limit, dB",
    ]  # fmt: skip
    assert [row[0] for row in rows] == ["31.5", "63", "125", "250", "500"]
    assert [float(row[1]) for row in rows] == pytest.approx(thud.solve().levels(), abs=1e-3)
    assert rows[0][-2:] == ["38", "40"]
    value, low, high = map(float, rows[-1][1:4])
    assert low < value < high


def test_case_is_copied_and_downloaded_unless_it_has_an_error(page: Page, tmp_path: Path) -> None:
    enter(page, HEIGHT, "0.8")
    texts = {}
    for name in ("case.py", "case.nml"):
        share(page, f"[data-copy='{name}']")
        see(page, f"[data-copy='{name}']").to_have_text("Copied")
        texts[name] = page.evaluate("navigator.clipboard.readText()")
    compile(texts["case.py"], "case.py", "exec")
    (tmp_path / "copied.nml").write_text(texts["case.nml"])
    assert thud.read_case(tmp_path / "copied.nml").drop.height == 0.8
    for name in ("case.nml", "force.csv"):
        assert save(page, tmp_path / name, partial(share, page, f"[data-file='{name}']")) == name
    downloads: list[object] = []
    page.on("download", lambda download: downloads.append(download))  # noqa: PLW0108
    fill(page, HEIGHT, "")
    for entry in ("[data-file='case.nml']", "[data-copy='case.py']", "#link"):
        share(page, entry)
        see(page, key=HEIGHT).to_be_focused()
        see(page, key=HEIGHT).to_have_attribute("aria-invalid", "true")
    page.wait_for_timeout(300)
    assert downloads == []


# ---- Motion, keyboard, screens.


def test_source_moves_in_step_with_the_force(page: Page) -> None:
    line = page.locator("#force .moment line")
    moving = "line => line.getAttribute('x1')"
    page.locator("#play").click()
    see(page, "#play").to_have_text("Pause")
    first = line.evaluate(moving)
    page.wait_for_timeout(300)
    assert line.evaluate(moving) != first
    page.locator("#play").click()
    see(page, "#play").to_have_text("Play")
    for model in ("finite_element", "hollow_sphere"):
        choose(page, "#model", model)
        images = []
        for value in ("0.1", "0.5"):
            page.locator("#instant").fill(value)
            images.append(page.locator("#ball").evaluate("box => box.toDataURL()"))
        assert images[0] != images[1]


# Whether the focus is in an element.
HAS_FOCUS = "box => box.contains(document.activeElement)"


def tab_to(page: Page, selector: str, most: int = 30) -> None:
    target = page.locator(selector)
    for _ in range(most):
        page.keyboard.press("Tab")
        if target.evaluate("box => box === document.activeElement"):
            break
    expect(target).to_be_focused()


def test_keyboard_alone_opens_all_doors(page: Page) -> None:
    page.keyboard.press("Tab")
    see(page, "#door_ball").to_be_focused()
    for key, door in (("Home", "recording"), ("End", "floor")):
        page.keyboard.press(key)
        see(page, f"#door_{door}").to_be_focused()
    settle(page)
    see(page, "#room svg").to_be_visible()
    # The inputs follow the doors, and the results the inputs.
    tab_to(page, "#construction", 2)
    for _ in range(60):
        page.keyboard.press("Tab")
        if not page.locator("#inputs").evaluate(HAS_FOCUS):
            break
    assert page.locator("#panel").evaluate(HAS_FOCUS)
    page.locator("#construction").focus()
    page.keyboard.press("ArrowDown")
    settle(page)
    # The field keeps the focus after the form is built again.
    see(page, "#construction").to_be_focused()
    see(page, "#construction").to_have_value(re.compile("180, ceiling"))
    page.locator("#door_floor").focus()
    page.keyboard.press("ArrowRight")
    see(page, "#door_recording").to_be_focused()
    tab_to(page, "#file", 10)
    # Values that are asked for follow the files.
    load(page)
    page.locator("#file").focus()
    for count, target in ((2, "#ask_plate_f0"), (4, "#assess")):
        for _ in range(count):
            page.keyboard.press("Tab")
        see(page, target).to_be_focused()


def test_phone_shows_the_whole_answer_and_hides_no_field(browser: Browser, server: Served) -> None:
    page = new_page(browser, server[0], 400)
    # A headline as long as they come.
    fill(page, "drop.height", "0.6")
    enter(page, "ball.mass", "3.5")
    verdict = page.locator("#verdict")
    assert verdict.evaluate("box => box.scrollHeight <= box.clientHeight + 1")
    assert verdict.evaluate("box => box.getBoundingClientRect().bottom") < 90
    # The button stays beside the headline in front of the fields, and its answer comes in sight.
    see(page, "#improve").to_be_in_viewport()
    page.locator("#improve").click()
    see(page, "#result :first-child").to_be_in_viewport()
    name = page.locator("#detail").evaluate("box => getComputedStyle(box, '::before').content")
    assert name.startswith('"Standard ball')
    page.evaluate("scrollTo(0, 0)")
    open_door(page, "floor")
    see(page, key="room.required").to_be_in_viewport(ratio=1)


def test_print_is_light_and_within_the_paper(browser: Browser, server: Served) -> None:
    page = new_page(browser, server[0], color_scheme="dark")
    page.emulate_media(media="print", color_scheme="dark")
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert page.locator("#warnings_section").evaluate("details => details.open")
    page.set_viewport_size({"width": 700, "height": 1000})
    assert page.evaluate("getComputedStyle(document.body).color") == "rgb(27, 29, 31)"
    limits = page.locator("#levels .limits").first
    assert limits.evaluate("box => getComputedStyle(box).fill") == "rgb(223, 227, 231)"
    assert page.evaluate("document.documentElement.scrollWidth") <= 700
    for plot in page.locator(".plot svg:visible").all():
        box = plot.bounding_box()
        assert box
        assert box["x"] + box["width"] <= 700


@pytest.mark.parametrize(("width", "scheme"), [(1400, "light"), (400, "dark"), (1024, "dark")])
def test_page_is_accessible_with_each_answer_on_the_first_screen(
    browser: Browser, server: Served, width: int, scheme: str
) -> None:
    page = new_page(browser, server[0], width, color_scheme=scheme)
    for door, plot in {"ball": "#levels", "floor": "#room", "recording": "#levels"}.items():
        open_door(page, door)
        if door == "recording":
            load(page)
        for selector in ("#verdict", f"{plot} svg"):
            see(page, selector).to_be_in_viewport(ratio=0.99)
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        page.locator("footer, #panel > section:visible").last.scroll_into_view_if_needed()
        bottom = page.locator("#verdict").evaluate("box => box.getBoundingClientRect().bottom")
        if width == 400:
            assert bottom < 90
        page.evaluate("scrollTo(0, 0)")
        if door == "ball":
            page.locator("#keep").click()
            choose(page, "#model", "hollow_sphere")
            page.locator("#inputs .folded summary").click()
        found = axe.Axe().run(page).response["violations"]
        assert [(one["id"], one["nodes"][0]["html"]) for one in found] == []
        if width == 400:
            assert page.evaluate(SMALL_TARGETS) == []


# Targets below 24 px on a side.
SMALL_TARGETS = """() => [...document.querySelectorAll("button, summary, input, select, .toggle")]
    .filter((box) => box.offsetParent && !box.classList.contains("file"))
    .map((box) => [box.id || box.textContent, box.getBoundingClientRect()])
    .filter(([, { width, height }]) => width < 24 || height < 24).map(([name]) => name)"""


# ---- Server.


def test_first_picture_needs_one_request(browser: Browser, server: Served) -> None:
    page = browser.new_context().new_page()
    for others in ("**/about", "**/page/*"):
        page.route(others, lambda _: None)
    page.goto(server[0], wait_until="commit")
    expect(page.locator("#levels svg path").first).to_be_visible()
    see(page, "#verdict").to_contain_text("Standard ball Conforms")


def test_rooms_of_variants_are_played_at_one_scale(page: Page) -> None:
    _compared_rooms(page)
    volume, address = [], ""
    player = page.locator("#player")
    for button in page.locator("#sounds button").all():
        button.click()
        expect(player).not_to_have_attribute("src", address)
        expect(player).to_have_attribute("src", re.compile("blob:"))
        volume.append(player.evaluate("(player) => player.volume"))
        address = player.evaluate("(player) => player.src")
    scale = [thud.listen(predict(name)).full_scale for name in ("CLT 200", "concrete 180")]
    assert volume == pytest.approx([1.0, scale[1] / scale[0]])
    page.locator("#variants .remove").click()
    see(page, "#sounds button").to_have_count(1)


@pytest.mark.parametrize("tab", ["same", "other"])
def test_page_recovers_when_the_server_returns(browser: Browser, tab: str) -> None:
    with serve() as (address, process):
        page = new_page(browser, address)
        choose(page, "#model", "finite_element")
        page.locator("#inputs .folded summary").click()
        fill(page, "mesh.polar_elements", "400")
        see(page, ".task").to_be_visible()
        # Killed while it computes.
        process.kill()
        process.wait(20)
        see(page, "#message").to_contain_text("he server")
        see(page, "#message").to_contain_text("start it again with")
        fill(page, "mesh.polar_elements", "64")
    port = address.partition("#")[0].strip("/").rpartition(":")[2]
    with serve("--port", port) as (address, _):
        see(page, "#message").to_contain_text(re.compile("pen the full addr"))
        # A new server has a new token, which the address brings into this browser.
        if tab == "same":
            page.evaluate("address => { location.href = address; }", address)
        else:
            page.context.new_page().goto(address)
        see(page, "#message").to_be_hidden()
        see(page, key="mesh.polar_elements").to_have_value("64")


def test_page_begins_with_the_case_of_the_command(browser: Browser, tmp_path: Path) -> None:
    path = tmp_path / "case.nml"
    case = thud.construction("CLT 200").case()
    path.write_text(str(case.to_namelist()))
    with serve(str(path)) as (address, _):
        page = browser.new_context().new_page()
        page.goto(address)
        see(page, "#door_floor").to_have_attribute("aria-selected", "true")
        see(page, "#construction").to_have_value("CLT 200")
        see(page, "#verdict").to_contain_text("78 dB")
