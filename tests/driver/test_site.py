"""The documentation site builds without a warning: pages, links, and tutorials, which it runs."""

from __future__ import annotations

import fcntl
import os
import re
from html.parser import HTMLParser
from types import FunctionType
from typing import TYPE_CHECKING
from urllib.parse import unquote, urlsplit

import pytest
from conftest import REPOSITORY, python

import thud

if TYPE_CHECKING:
    from pathlib import Path

    from playwright.sync_api import Browser, Page as Tab

pytestmark = pytest.mark.slow

THEORY = (
    *("hollow_sphere", "lumped_models", "modal_ball", "finite_elements", "compression"),
    *("ball_impedance", "floors", "room_theory", "levels", "recordings_theory"),
)
TUTORIALS = [path.stem for path in (REPOSITORY / "docs/tutorials").glob("*.md")]
NAMES = [n for n in thud.__all__ if isinstance(getattr(thud, n), type | FunctionType)]
SIZE = 15e6  # bytes
# Pages of all kinds, and the widths of a phone, a tablet and a laptop, px.
LOOKED_AT = (
    *("index", "gallery", "python_reference", "docs/keys", "docs/rooms", "docs/tutorials/paper"),
    *("generated/thud.Plate", "fortran/index", "fortran/impact"),
)
WIDTHS = (400, 1024, 1400)
# Figures that are wider than the page, and what else is wider and in no frame that moves sideways.
CLIPPED = """() => [...document.querySelectorAll("article *")].filter(item => {
    if (item.getBoundingClientRect().right <= innerWidth + 1) return false
    if (item.localName === "img") return true
    for (let frame = item; frame.localName !== "article"; frame = frame.parentElement)
        if (["auto", "scroll"].includes(getComputedStyle(frame).overflowX)) return false
    return true
}).map(item => item.outerHTML.slice(0, 100))"""
# Whether the font of formulas is there, and how far below its letter a subscript ends, px.
FORMULAS = """async () => {
    await document.fonts.ready
    const [letter, subscript] = document.querySelector("msub").children
    const end = item => item.getBoundingClientRect().bottom
    return [document.fonts.check("16px 'Noto Sans Math'"), end(subscript) - end(letter)]
}"""


class Page(HTMLParser):
    """Links and anchors of a page, what it loads, and its words and the letters of its formulas."""

    def __init__(self, text: str) -> None:
        """Read a page."""
        super().__init__()
        self.links: list[str] = []
        self.anchors: set[str] = set()
        self.loaded: list[str] = []
        self.words: list[str] = []
        self.letters: set[str] = set()
        self.formulas = 0
        self.open: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Take links and anchors of a tag."""
        found = dict(attrs)
        # Outputs of tutorials are what programs print; they hold further `div`.
        output = tag == "div" and (
            "div" in self.open or "cell_output" in (found.get("class") or "")
        )
        if output or tag in {"script", "style", "pre", "code", "math"}:
            self.open.append(tag)
        self.formulas += tag == "math"
        self.anchors |= {value for key in ("id", "name") if (value := found.get(key))}
        link = found.get("href" if tag in {"a", "link"} else "src")
        if link:
            self.links.append(link)
        if link and tag != "a":
            self.loaded.append(link)

    def handle_endtag(self, tag: str) -> None:
        """End what is no prose."""
        if self.open and self.open[-1] == tag:
            self.open.pop()

    def handle_data(self, data: str) -> None:
        """Take words of prose and letters of formulas."""
        if not self.open:
            self.words.append(data)
        elif "math" in self.open:
            self.letters |= set(data)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the built site; a warning of its builder fails."""
    pytest.importorskip("sphinx")
    pytest.importorskip("myst_nb")
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent
    target = folder / "site" / "html"
    # Processes of tests share one site, as kernels of two builds may take the same ports.
    with (folder / "site.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not target.exists():
            target.parent.mkdir()
            built = python(REPOSITORY / "docs/site/build.py", target)
            assert built.returncode == 0, built.stderr
    return target


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[str, Page]:
    return {
        path.relative_to(site).as_posix(): Page(path.read_text(encoding="utf-8"))
        for path in site.rglob("*.html")
    }


@pytest.fixture(scope="module")
def tab(browser: Browser) -> Tab:
    return browser.new_page()


def test_no_link_is_broken(site: Path, pages: dict[str, Page]) -> None:
    broken = []
    for name, page in pages.items():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            folder = (site / name).parent
            target = (folder / unquote(parts.path)).resolve() if parts.path else site / name
            known = pages.get(target.relative_to(site).as_posix())
            anchor = unquote(parts.fragment)
            if not target.exists() or (anchor and (known is None or anchor not in known.anchors)):
                broken.append((name, link))
    assert len(pages) > len(thud.__all__)
    assert not broken


def test_site_needs_no_network(site: Path, pages: dict[str, Page]) -> None:
    links = {name: page.loaded for name, page in pages.items()}
    assert not {name: link for name in links for link in links[name] if urlsplit(link).netloc}
    for path in site.rglob("*.css"):
        style = path.read_text(encoding="utf-8")
        assert not re.findall(r"(?:@import|url\()\W*(?:https?:)?//\S+", style), path.name


def test_every_page_of_the_documentation_is_in_the_site(pages: dict[str, Page]) -> None:
    docs = REPOSITORY / "docs"
    for page in [*docs.glob("*.md"), *docs.glob("tutorials/*.md")]:
        place = page.relative_to(REPOSITORY).with_suffix(".html").as_posix()
        assert place in pages["index.html"].links, page


def test_pages_state_the_version_and_are_small(site: Path, pages: dict[str, Page]) -> None:
    version = f"thud {thud.__version__}"
    assert not [name for name, page in pages.items() if version not in page.words]
    assert sum(path.stat().st_size for path in site.rglob("*") if path.is_file()) < SIZE


def test_formulas_are_set(pages: dict[str, Page]) -> None:
    for name, page in pages.items():
        # Commands of TeX, and subscripts that are typed: L_FE, T₀.
        raw = re.findall(r"\\[a-z]+|\$|\b[A-Za-z]_\w+|[₀-₉]", " ".join(page.words))
        assert not (name.startswith("docs/") and raw), (name, raw)
    assert all(pages[f"docs/{page}.html"].formulas for page in THEORY)


def test_font_has_all_letters_of_formulas(pages: dict[str, Page]) -> None:
    ttf = pytest.importorskip("fontTools.ttLib")
    pytest.importorskip("brotli")
    known = ttf.TTFont(REPOSITORY / "docs/site/static/noto-sans-math.woff2").getBestCmap()
    letters = {letter for page in pages.values() for letter in page.letters if letter.isprintable()}
    assert not [letter for letter in letters if ord(letter) not in known]
    # Single letters are set in italics, other characters: Latin and Greek.
    assert set(range(0x1D434, 0x1D468)) - {0x1D455} <= known.keys()
    assert set(range(0x1D6FC, 0x1D716)) <= known.keys()


def test_python_reference_has_all_signatures(site: Path, pages: dict[str, Page]) -> None:
    for name in NAMES:
        place = f"generated/thud.{name}.html"
        assert f"{place}#thud.{name}" in pages["python_reference.html"].links
        text = (site / place).read_text(encoding="utf-8")
        assert re.search(rf'<dt class="sig sig-object[^>]*id="thud.{name}">', text), name
        assert ".. auto" not in text
        assert "Examples" in text, name
    assert 'class="n"><span class="pre">outer_radius' in (
        site / "generated/thud.Ball.html"
    ).read_text(encoding="utf-8")


def test_fortran_reference_has_all_modules(pages: dict[str, Page]) -> None:
    declared = {
        name
        for path in (REPOSITORY / "src").rglob("*.f90")
        for name in re.findall(r"^module (\w+)$", path.read_text(encoding="utf-8"), re.MULTILINE)
    }
    fortran = [page.anchors for name, page in pages.items() if name.startswith("fortran/")]
    anchors = set().union(*fortran)
    assert "thud-ball" in anchors
    assert not [name for name in declared if name.replace("_", "-") not in anchors]


@pytest.mark.parametrize("tutorial", TUTORIALS)
def test_gallery_shows_the_figures_of_a_tutorial(pages: dict[str, Page], tutorial: str) -> None:
    place = f"docs/tutorials/{tutorial}.html"
    drawn = {link.rpartition("/")[2] for link in pages[place].loaded if "_images/" in link}
    shown = {link.rpartition("/")[2] for link in pages["gallery.html"].loaded}
    assert drawn
    assert drawn <= shown
    assert any(link.startswith(f"{place}#") for link in pages["gallery.html"].links)


@pytest.mark.parametrize("width", WIDTHS)
def test_nothing_is_clipped_or_hidden_from_readers(site: Path, tab: Tab, width: int) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    tab.set_viewport_size({"width": width, "height": 900})
    for name in LOOKED_AT:
        tab.goto(f"file://{site}/{name}.html")
        assert tab.evaluate("document.documentElement.scrollWidth") <= width, name
        assert not tab.evaluate(CLIPPED), name
        if width == min(WIDTHS):
            faults = axe.run(tab).response["violations"]
            assert not [f["id"] for f in faults if f["impact"] in {"serious", "critical"}], name


def test_subscripts_stand_below_their_letters(site: Path, tab: Tab) -> None:
    tab.goto(f"file://{site}/docs/levels.html")
    loaded, below = tab.evaluate(FORMULAS)
    assert loaded
    assert below > 1


def test_names_of_fortran_are_found(site: Path, tab: Tab) -> None:
    tab.goto(f"file://{site}/fortran/index.html")
    tab.locator("#find").fill("holds_impulse")
    found = tab.locator("#names li:visible a")
    assert found.count() == 1
    assert found.get_attribute("href") == "impact.html#thud-force-history-holds-impulse"


@pytest.mark.parametrize(
    ("question", "page"),
    [
        ("recording", "docs/recordings"),
        ("level in the room", "docs/rooms"),
        ("damping law", "docs/finite_elements"),
        ("friction", "docs/keys"),
        ("add format", "docs/how_to_add"),
        ("cite", "docs/citation"),
        ("read_recording", "generated/thud.read_recording"),
    ],
)
def test_search_answers_what_is_asked(site: Path, tab: Tab, question: str, page: str) -> None:
    tab.goto(f"file://{site}/search.html?q={question}")
    results = tab.locator("#search-results > ul > li > a")
    results.first.wait_for()
    tab.wait_for_timeout(500)
    links = [result.get_attribute("href") or "" for result in results.all()]
    assert any(link.startswith(f"{page}.html") for link in links[:3]), links[:3]
    assert not any(link.startswith("CHANGELOG.html") for link in links)
