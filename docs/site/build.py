"""Build the documentation site: pages, key reference, Python and Fortran reference.

    python docs/site/build.py [DIRECTORY]

writes plain files to DIRECTORY (default: build/site/html). A warning is an error.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import thud

REPOSITORY = Path(__file__).parents[2]
WORK = REPOSITORY / "build/site"
COPIED = (
    *("docs", "inputs", "README.md", "CHANGELOG.md"),
    *("CONTRIBUTING.md", "CITATION.cff", "LICENSE"),
)
# FORD does not read lengths of characters that are calls, nor the include file of FFTW.
FORD = """---
project: thud
summary: The Fortran library
src_dir: {sources}
output_dir: {output}/fortran
css: {css}
preprocess: false
display: public
source: false
graph: false
search: false
warn: false
predocmark: >
exclude: **/text.f90
    **/table.f90
    **/set_report.f90
    **/transform.f90
---
Modules, types and procedures of the library. Programs use the façade `thud`; see the
[page on it](../docs/fortran.html).
"""


def python_page() -> str:
    """Return the page of all public Python names, classes first."""
    kinds = {"Classes": [], "Functions": []}
    for name in sorted(thud.__all__):
        found = getattr(thud, name)
        if isinstance(found, type):
            kinds["Classes"].append(name)
        elif callable(found):
            kinds["Functions"].append(name)
    text = "# Python reference\n\nAll public names of the package `thud`.\n"
    for title, names in kinds.items():
        listed = "\n".join(f"   {name}" for name in names)
        text += (
            f"\n## {title}\n\n```{{eval-rst}}\n.. currentmodule:: thud\n\n"
            f".. autosummary::\n   :toctree: generated\n   :nosignatures:\n\n{listed}\n```\n"
        )
    return text


def fortran_page(reference: Path) -> str:
    """Return the page of all Fortran modules, made from FORD's list of them."""
    listed = json.loads((reference / "modules.json").read_text(encoding="utf-8"))["modules"]
    # One of two files of a module is compiled.
    modules = {module["name"]: module for module in listed}
    rows = [
        f"| <a href=\"fortran/{module['external_url'].removeprefix('./')}\">{module['name']}</a> "
        f"| {', '.join(f'`{name}`' for name in sorted([*module['pub_types'], *module['pub_procs']]))} |"
        for _, module in sorted(modules.items())
    ]
    return "\n".join(
        [
            "# Fortran reference",
            "",
            "The modules of the library and their public types and procedures. Programs use the façade `thud`",
            "([page on it](docs/fortran.md)).",
            "",
            "| module | types and procedures |",
            "|---|---|",
            *rows,
            "",
        ]
    )


def strip_network(reference: Path) -> None:
    """Take from FORD's pages what they load from other hosts; `fortran.css` replaces it."""
    for path in reference.rglob("*.html"):
        text = path.read_text(encoding="utf-8")
        text = re.sub(r"<script\b.*?</script>", "", text, flags=re.DOTALL)
        text = re.sub(r"<link\b(?![^>]*(?:user|pygments)\.css)[^>]*stylesheet[^>]*>", "", text)
        # A way back to the other pages.
        text = re.sub(
            r'(<a class="navbar-brand" href="([^"]*)index\.html">)',
            r'<a href="\2../index.html">Documentation</a> \1Fortran reference of ',
            text,
        )
        path.write_text(text, encoding="utf-8")
    for name in ("js", "webfonts"):
        shutil.rmtree(reference / name)


def copy_sources() -> Path:
    """Return the directory of the sources of the site, made anew."""
    source = WORK / "source"
    shutil.rmtree(source, ignore_errors=True)
    source.mkdir(parents=True)
    for name in COPIED:
        path = REPOSITORY / name
        if path.is_dir():
            shutil.copytree(path, source / name)
        else:
            shutil.copy(path, source)
    for name in ("conf.py", "index.md"):
        shutil.copy(Path(__file__).parent / name, source)
    # Tutorials find the inputs beside them, as `thud-driver examples` puts them.
    (source / "docs/tutorials/inputs").symlink_to(source / "inputs")
    return source


def build(target: Path) -> None:
    """Build the site into a directory."""
    source = copy_sources()
    shutil.rmtree(target, ignore_errors=True)
    settings = WORK / "ford.md"
    settings.write_text(
        FORD.format(
            sources=REPOSITORY / "src",
            output=WORK / "ford",
            css=Path(__file__).parent / "fortran.css",
        ),
        encoding="utf-8",
    )
    python = [sys.executable, "-m"]
    subprocess.run([*python, "ford", str(settings)], check=True)
    reference = WORK / "ford/fortran"
    strip_network(reference)
    pages = {"python_reference.md": python_page(), "fortran_reference.md": fortran_page(reference)}
    for name, text in pages.items():
        (source / name).write_text(text, encoding="utf-8")
    subprocess.run(
        [*python, "sphinx", "-W", "--keep-going", "-q", "-j", "auto", str(source), str(target)],
        check=True,
    )


if __name__ == "__main__":
    build(Path(sys.argv[1]) if len(sys.argv) > 1 else WORK / "html")
