"""Write the pages of the Fortran reference, one a folder, from what FORD reads in the sources."""

from __future__ import annotations

import re
import shutil
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING

from ford.fortran_project import Project
from ford.settings import ProjectSettings

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from ford.sourceform import FortranBase

# FORD does not read lengths of characters with parentheses, nor finds the include file of FFTW.
NESTED = "[^()]*"
for _ in range(3):
    NESTED = rf"(?:[^()]|\({NESTED}\))*"
REPLACED = {
    rf"\bcharacter\(len=(?=[^()]*\(){NESTED}\)": "character(len=…)",
    r"(?m)^ *include .*": "",
}
FACADE = "thud"
REFERENCE = """---
nosearch: true
---

# Fortran reference

The modules of the library, a page for each folder of the sources. Programs use the façade
`thud`, which makes names of other modules public ([thud in Fortran programs](../docs/fortran.md)).

"""
NAMES = """
## Names

```{raw} html
<label>Find a name: <input type="search" id="find"></label>
<script>
  document.getElementById("find").addEventListener("input", (event) => {
    const word = event.target.value.trim().toLowerCase();
    for (const entry of document.querySelectorAll("#names li"))
      entry.hidden = !entry.textContent.includes(word);
  });
</script>
```

"""


def read_modules(sources: Path, copy: Path) -> list[FortranBase]:
    """Return the modules as FORD reads them from a copy of the sources."""
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(sources, copy)
    for path in copy.rglob("*.f90"):
        text = path.read_text(encoding="utf-8")
        for pattern, replacement in REPLACED.items():
            text = re.sub(pattern, replacement, text)
        path.write_text(text, encoding="utf-8")
    settings = ProjectSettings(
        directory=copy, src_dir=[copy], predocmark=">", preprocess=False, dbg=False, quiet=True
    )
    settings.normalise_paths(copy)
    project = Project(settings)
    project.correlate()
    # One of two files of a module is compiled.
    return in_order({module.name: module for module in project.modules}.values())


def in_order(items: Iterable[FortranBase]) -> list[FortranBase]:
    """Return items in the order of their names."""
    return sorted(items, key=lambda item: item.name)


def comment(item: FortranBase) -> str:
    """Return the comment of the sources on an item."""
    return textwrap.dedent("\n".join(item.doc_list)).strip()


def entry(term: str, text: str) -> str:
    """Return an entry of a list: a term, and what it means if that is stated."""
    return textwrap.indent(f"{term}: {text}" if text else term, "  ").replace("  ", "- ", 1)


def heading(level: int, name: str, target: str = "") -> str:
    """Return a heading to which others link by a target."""
    return f"({target})=\n" * bool(target) + f"{'#' * level} {name}\n"


def link(item: FortranBase, text: str = "") -> str:
    """Return a link to an item of a module."""
    return f"[`{text or item.name}`](#{item.parent.name}-{item.name})"


class Pages:
    """Sections of pages, with links to types of other sections."""

    def __init__(self, modules: list[FortranBase]) -> None:
        """Find the public types of all modules."""
        self.types = {item.name: item for module in modules for item in module.types}

    def variable(self, item: FortranBase) -> str:
        """Return the entry of a variable: name and value, type and attributes, comment."""
        kind = re.sub("<.*?>", "", item.full_type).replace("len=len=", "len=")
        attributes = [
            *item.attribs,
            *[f"dimension{item.dimension}"] * bool(item.dimension),
            *[f"intent({item.intent})"] * bool(item.intent),
            *["optional"] * item.optional,
        ]
        derived = self.types.get(kind.rpartition("(")[2].rstrip(")"))
        shown = [link(derived, kind)] if derived else []
        words = ", ".join(attributes if derived else [kind, *attributes])
        value = f" = {item.initial}" if item.initial else ""
        term = ", ".join([f"**`{item.name}{value}`**", *shown, *[f"`{words}`"] * bool(words)])
        return entry(term, comment(item))

    def procedure(self, item: FortranBase, level: int, target: str = "") -> Iterator[str]:
        """Yield the sections of a procedure, of an interface, or of a procedure of a type."""
        yield heading(level, item.name, target)
        if getattr(item, "generic", False):
            yield comment(item) + "\n"
            for choice in item.modprocs:
                yield from self.procedure(choice.procedure, level + 1)
            return
        routine = (item.proto or item.bindings[0]) if item.obj == "boundprocedure" else item
        routine = getattr(routine, "procedure", routine)
        result = getattr(routine, "retvar", None)
        arguments = ", ".join(argument.name for argument in routine.args)
        first = " ".join([*routine.attribs, routine.proctype.lower(), f"{item.name}({arguments})"])
        first += f" result({result.name})" if result else ""
        yield f"`{first}`\n\n{comment(routine)}\n"
        yield from map(self.variable, [*routine.args, *[result] * bool(result)])
        yield ""

    def type(self, item: FortranBase) -> Iterator[str]:
        """Yield the sections of a type: comment, components, its own procedures."""
        yield heading(3, item.name, f"{item.parent.name}-{item.name}")
        if item.extends:
            base = self.types.get(getattr(item.extends, "name", ""))
            yield f"Extends {link(base) if base else f'`{item.extends}`'}.\n"
        yield comment(item) + "\n"
        yield from map(self.variable, item.variables)
        yield ""
        for bound in in_order(item.boundprocs):
            if bound.parent is item:
                yield from self.procedure(bound, 4)

    def module(self, module: FortranBase) -> Iterator[str]:
        """Yield the sections of a module."""
        yield heading(2, module.name, module.name)
        yield comment(module) + "\n"
        yield from map(self.variable, module.variables)
        yield ""
        for item in in_order(module.types):
            yield from self.type(item)
        for item in in_order([*module.functions, *module.subroutines, *module.interfaces]):
            yield from self.procedure(item, 3, f"{module.name}-{item.name}")


def list_facade(module: FortranBase) -> Iterator[str]:
    """Yield the names that the façade makes public, with links."""
    yield heading(2, module.name, module.name)
    yield comment(module) + "\n"
    yield from (
        entry(link(item), comment(item))
        for item in in_order([*module.pub_types.values(), *module.pub_procs.values()])
    )


def write_pages(sources: Path, copy: Path, target: Path) -> None:
    """Write the pages of all folders of the sources, and the page that lists them."""
    modules = read_modules(sources, copy)
    pages = Pages(modules)
    folders: dict[str, list[FortranBase]] = {}
    for module in modules:
        folder = Path(module.parent.path).relative_to(copy).parent.as_posix()
        folders.setdefault(folder, []).append(module)
    (facade,) = folders.pop(".")
    target.mkdir()
    listed = []
    for folder, members in sorted(folders.items()):
        sections = [section for module in members for section in pages.module(module)]
        # Neither does the search of the guide find them: the page of all names has one of its own.
        # The list of sections beside the page holds those of modules only.
        text = "\n".join(
            ["---\ntocdepth: 2\nnosearch: true\n---\n", heading(1, f"src/{folder}"), *sections]
        )
        (target / f"{folder.replace('/', '_')}.md").write_text(text, encoding="utf-8")
        names = ", ".join(f"[`{module.name}`](#{module.name})" for module in members)
        listed.append(entry(f"[src/{folder}]({folder.replace('/', '_')}.md)", names))
    toctree = ["```{toctree}", ":hidden:", ":glob:", "", "*", "```", ""]
    public = [
        item
        for module in modules
        for item in [*module.types, *module.functions, *module.subroutines, *module.interfaces]
        if module is not facade
    ]
    names = [entry(f"{link(item)} of `{item.parent.name}`", "") for item in in_order(public)]
    text = "\n".join([REFERENCE, *listed, "", *list_facade(facade), NAMES, *names, "", *toctree])
    (target / "index.md").write_text(text, encoding="utf-8")
