"""The modules of the page."""

from __future__ import annotations

import re
from importlib import resources

PAGE = resources.files("thud.explorer") / "page"
EXPORTED = re.compile(r"^export (?:async )?(?:function|const|let|class) +(\w+)", re.MULTILINE)
IMPORTED = re.compile(r'^import \{([^}]+)\} from "thud/([\w.]+)";$', re.MULTILINE)


def test_each_imported_name_exists_and_is_used() -> None:
    texts = {file.name: file.read_text() for file in PAGE.iterdir() if file.name.endswith(".js")}
    assert "showAll" in EXPORTED.findall(texts["doors.js"])
    for name, text in texts.items():
        for listed, module in IMPORTED.findall(text):
            names = [word.strip() for word in listed.split(",") if word.strip()]
            assert set(names) <= set(EXPORTED.findall(texts[module])), f"{name} from {module}"
            unused = [one for one in names if len(re.findall(rf"\b{one}\b", text)) < 2]
            assert not unused, f"{name}: {unused}"
