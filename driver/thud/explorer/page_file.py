"""The page as one file with scripts, style and first answer, so that one request shows it."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from dataclasses import dataclass
from importlib import resources
from typing import TYPE_CHECKING, Any

from thud.explorer.answer import answer_case, new_case

if TYPE_CHECKING:
    from collections.abc import Mapping
    from importlib.resources.abc import Traversable

FOLDER = resources.files("thud.explorer") / "page"
_STYLE = re.compile(r'<link rel="stylesheet" href="page/([\w.]+)">')
_SCRIPT = re.compile(r'<script type="module" src="page/([\w.]+)"></script>')
_FIRST = '<script type="application/json" id="first_answer">'
# Comments of whole lines, indents and empty lines, blanks of a style, and imports of other modules:
# a script shares the names of those before.
_COMMENT = re.compile(r"^[ \t]*(?://[^\n]*|/\*.*?\*/)\n", re.MULTILINE | re.DOTALL)
_INDENT = re.compile(r"^[ \n]+", re.MULTILINE)
_BLANK = re.compile(r"(?<=[{};,:]) | (?=[{}])")
_IMPORT = re.compile(r'^import .*"\./[\w.]+";\n', re.MULTILINE)
_EXPORT = re.compile(r"^export ", re.MULTILINE)
# The page loads nothing, but plays and shows what it has made or downloaded with its token.
_POLICY = (
    "default-src 'none'; connect-src 'self'; img-src data: blob:; media-src blob:; "
    "script-src {scripts}; style-src {styles}; frame-ancestors 'none'; base-uri 'none'; "
    "form-action 'none'"
)


@dataclass(frozen=True)
class Page:
    """Content of the page, its content security policy and its entity tag."""

    content: str
    policy: str
    tag: str


def new_page(values: Mapping[str, Any] | None) -> Page:
    """Return the page, with the answer of the values of a case unless they are None."""
    hashes: dict[str, list[str]] = {"scripts": [], "styles": []}

    def inline(match: re.Match[str], kind: str, element: str) -> str:
        text = _text(FOLDER / match[1], is_script=kind == "scripts")
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        hashes[kind].append(f"'sha256-{digest}'")
        return f"<{element}>{text}</{element}>"

    content = (FOLDER / "index.html").read_text(encoding="utf-8")
    content = _STYLE.sub(lambda match: inline(match, "styles", "style"), content)
    content = _SCRIPT.sub(lambda match: inline(match, "scripts", "script"), content)
    if values is not None:
        # The motion comes with the next answer.
        first = {"values": values, "answer": answer_case(new_case(values)) | {"motion": None}}
        text = json.dumps(first, allow_nan=False, separators=(",", ":")).replace("</", "<\\/")
        content = content.replace(_FIRST, _FIRST + text)
    policy = _POLICY.format(**{kind: " ".join(found) or "'none'" for kind, found in hashes.items()})
    return Page(content, policy, f'"{hashlib.sha256(content.encode()).hexdigest()}"')


def _text(file: Traversable, *, is_script: bool) -> str:
    """Return a style, or a module as a script, without comments and needless blanks."""
    text = _INDENT.sub("", _COMMENT.sub("", file.read_text(encoding="utf-8")))
    return _EXPORT.sub("", _IMPORT.sub("", text)) if is_script else _BLANK.sub("", text)
