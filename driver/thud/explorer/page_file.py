"""The page, with its style, the modules of its first picture and the answer that this shows.

One request shows them; the other modules follow as files.
"""

from __future__ import annotations

import secrets
from functools import lru_cache
from importlib import resources
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from jinja2 import Environment, PackageLoader

from thud.explorer.answer import answer_case, new_case

if TYPE_CHECKING:
    from collections.abc import Mapping

FOLDER = resources.files("thud.explorer") / "page"
# Modules of the first picture.
FIRST = ("page", "storage", "request", "plot", "headline", "results", "first")
# What an address of data may contain as it is.
_SAFE = "".join(map(chr, range(32, 127))).translate({37: None, 35: None})
# The page loads its own modules, and plays and shows what it has made or downloaded with its token.
_POLICY = (
    "default-src 'none'; connect-src 'self'; img-src data: blob:; media-src blob:; "
    "script-src 'self' 'nonce-{nonce}'; style-src 'nonce-{nonce}'; frame-ancestors 'none'; "
    "base-uri 'none'; form-action 'none'"
)
_TEMPLATES = Environment(loader=PackageLoader("thud.explorer", "page"), autoescape=True)


def first_answer(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of a case and its answer; the motion comes with the next answer."""
    return {"values": values, "answer": answer_case(new_case(values)) | {"motion": None}}


def render_page(first: Mapping[str, Any] | None) -> tuple[str, str]:
    """Return the page and its content security policy.

    `first` is the answer that it shows first, see `first_answer`; None: it has to ask.
    """
    nonce = secrets.token_urlsafe(16)
    page = _TEMPLATES.get_template("index.html")
    others = sorted(
        file.name
        for file in FOLDER.iterdir()
        if file.name.endswith(".js") and file.name.removesuffix(".js") not in FIRST
    )
    content = page.render(first=first, imports=_import_map(), others=others, nonce=nonce)
    return content, _POLICY.format(nonce=nonce)


@lru_cache(maxsize=1)
def _import_map() -> dict[str, dict[str, str]]:
    """Return the import map that has the modules of the first picture as data."""
    imports = {"thud/": "./page/"}
    for name in FIRST:
        text = (FOLDER / f"{name}.js").read_text(encoding="utf-8")
        imports[f"thud/{name}.js"] = f"data:text/javascript,{quote(text, safe=_SAFE)}"
    return {"imports": imports}
