"""The documentation site builds without a warning: pages, links, and tutorials, which it runs."""

from __future__ import annotations

import re
import runpy
from html.parser import HTMLParser
from typing import TYPE_CHECKING
from urllib.parse import unquote, urlsplit

import pytest
from conftest import REPOSITORY

import thud

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.slow

THEORY = (
    *("hollow_sphere", "lumped_models", "modal_ball", "finite_elements", "compression"),
    *("ball_impedance", "floors", "rooms", "levels", "recordings_theory"),
)


class Page(HTMLParser):
    """Links and anchors of a page, and what it loads."""

    def __init__(self) -> None:
        """Begin with none."""
        super().__init__()
        self.links: list[str] = []
        self.anchors: set[str] = set()
        self.loaded: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Take links and anchors of a tag."""
        found = dict(attrs)
        self.anchors |= {value for key in ("id", "name") if (value := found.get(key))}
        link = found.get("href" if tag in {"a", "link"} else "src")
        if link:
            self.links.append(link)
        if link and tag != "a":
            self.loaded.append(link)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the built site; a warning of its builder fails."""
    pytest.importorskip("sphinx")
    pytest.importorskip("myst_nb")
    target = tmp_path_factory.mktemp("site") / "html"
    runpy.run_path(str(REPOSITORY / "docs/site/build.py"))["build"](target)
    return target


def test_no_link_is_broken(site: Path) -> None:
    pages = {}
    for path in site.rglob("*.html"):
        page = Page()
        page.feed(path.read_text(encoding="utf-8"))
        pages[path] = page
    broken = []
    for path, page in pages.items():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            target = target / "index.html" if target.is_dir() else target
            # FORD links to anchors that it does not make.
            made_here = target in pages and "fortran" not in target.relative_to(site).parts
            known = pages[target].anchors if made_here else {parts.fragment}
            if not target.exists() or (parts.fragment and unquote(parts.fragment) not in known):
                broken.append((path.relative_to(site).as_posix(), link))
    assert len(pages) > len(thud.__all__)
    assert not broken


def test_site_needs_no_network(site: Path) -> None:
    foreign = []
    for path in site.rglob("*.html"):
        page = Page()
        page.feed(path.read_text(encoding="utf-8"))
        foreign += [(path.name, link) for link in page.loaded if urlsplit(link).netloc]
    for path in site.rglob("*.css"):
        style = path.read_text(encoding="utf-8")
        foreign += [
            (path.name, link)
            for link in re.findall(r"(?:@import|url\()\W*(?:https?:)?//\S+", style)
        ]
    assert not foreign


def test_every_page_of_the_documentation_is_in_the_site(site: Path) -> None:
    menu = (site / "index.html").read_text(encoding="utf-8")
    docs = REPOSITORY / "docs"
    for page in [*docs.glob("*.md"), *docs.glob("tutorials/*.md")]:
        place = page.relative_to(REPOSITORY).with_suffix(".html").as_posix()
        assert f'href="{place}"' in menu, page


def test_formulas_are_set(site: Path) -> None:
    raw, formulas = {}, {}
    for path in site.glob("docs/*.html"):
        text = path.read_text(encoding="utf-8")
        formulas[path.stem] = text.count("<math")
        words = re.sub(r"<(script|pre|code)\b.*?</\1>", "", text, flags=re.DOTALL)
        raw[path.stem] = re.findall(r"\\[a-z]+|\$", words)
    assert not any(raw.values()), raw
    assert all(formulas[page] for page in THEORY), formulas
