"""Examples of the public names, by task: the sections of `docs/examples/python`."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

FOLDER = Path(__file__).parents[1] / "examples/python"


class Example(NamedTuple):
    """A section of a script.

    Attributes
    ----------
    task : str
        Title of the script.
    names : list of str
        Public names that the section shows.
    code : str
        Its code, with the imports of the script that it uses.
    """

    task: str
    names: list[str]
    code: str


def read_examples() -> list[Example]:
    """Return all sections: each begins with a line ``# %% name, name`` of the names it shows."""
    examples = []
    for path in sorted(FOLDER.glob("*.py")):
        head, *sections = re.split(r"^# %% ", path.read_text("utf-8"), flags=re.MULTILINE)
        title = head.split('"""')[1].rstrip(".")
        for section in sections:
            names, _, code = section.partition("\n")
            imports = [
                line
                for line in re.findall(r"^import .*", head, re.MULTILINE)
                if re.search(rf"\b{line.split()[-1]}\.", code)
            ]
            text = "\n".join([*imports, "", code.strip()])
            examples.append(Example(title, names.split(", "), text))
    return examples
