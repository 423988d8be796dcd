"""The files of the page, which the server joins into one."""

from __future__ import annotations

import re
from collections import Counter
from importlib import resources

PAGE = resources.files("thud.explorer") / "page"
TOP_LEVEL = re.compile(
    r"^(?:export )?(?:async )?(?:function\*?|const|let|class) +(\w+)", re.MULTILINE
)


def test_names_of_modules_do_not_collide() -> None:
    # The modules become scripts that share their names.
    texts = [file.read_text() for file in PAGE.iterdir() if file.name.endswith(".js")]
    names = Counter(name for text in texts for name in TOP_LEVEL.findall(text))
    assert names["showAll"] == 1
    assert [name for name, count in names.items() if count > 1] == []


def test_each_imported_name_exists_in_an_earlier_module() -> None:
    order = re.findall(r"page/(\w+\.js)", (PAGE / "index.html").read_text())
    for i, name in enumerate(order):
        text = (PAGE / name).read_text()
        for names, module in re.findall(r'^import \{ (.+) \} from "\./(.+)";$', text, re.MULTILINE):
            assert module in order[:i], f"{name} imports {module}"
            exported = re.findall(
                r"^export (?:async )?(?:function|const|let|class) +(\w+)",
                (PAGE / module).read_text(),
                re.MULTILINE,
            )
            assert set(names.split(", ")) <= set(exported), f"{name} from {module}"
            unused = [one for one in names.split(", ") if len(re.findall(rf"\b{one}\b", text)) < 2]
            assert not unused, f"{name}: {unused}"
