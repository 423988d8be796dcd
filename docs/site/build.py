"""Build the documentation site: pages, key reference, Python and Fortran reference.

    python docs/site/build.py [DIRECTORY]

writes plain files to DIRECTORY (default: build/site/html). A warning is an error.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from types import FunctionType
from typing import get_args

import thud
from PIL import Image

from examples import read_examples
from fortran import write_pages

REPOSITORY = Path(__file__).parents[2]
WORK = REPOSITORY / "build/site"
COPIED = (
    *("docs", "inputs", "README.md", "CHANGELOG.md"),
    *("CONTRIBUTING.md", "CITATION.cff", "LICENSE"),
)


def python_page() -> str:
    """Return the page of all public Python names, by the tasks of their examples."""
    tasks: dict[str, list[str]] = {}
    for example in read_examples():
        tasks.setdefault(example.task, []).extend(example.names)
    text = "# Python reference\n\nThe public names of the package `thud`, by task.\n"
    aliases = []
    for title, names in tasks.items():
        objects = {name: getattr(thud, name) for name in names}
        pages = [name for name, one in objects.items() if isinstance(one, type | FunctionType)]
        aliases += [(name, get_args(objects[name])) for name in names if name not in pages]
        listed = "\n".join(f"   {name}" for name in pages)
        text += (
            f"\n## {title}\n\n```{{eval-rst}}\n.. currentmodule:: thud\n\n"
            f".. autosummary::\n   :toctree: generated\n   :nosignatures:\n\n{listed}\n```\n"
        )
    text += "\n## Types of arguments\n\n"
    for name, values in aliases:
        words = [repr(v) if isinstance(v, str) else v.__name__ for v in values]
        text += f"- `{name}`: one of {', '.join(f'`{word}`' for word in words)}\n"
    return text


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
    for name in ("conf.py", "index.md", "gallery.md"):
        shutil.copy(Path(__file__).parent / name, source)
    # The search of the guide finds pages on how things are, not how they became.
    log = source / "CHANGELOG.md"
    log.write_text(f"---\nnosearch: true\n---\n\n{log.read_text('utf-8')}", "utf-8")
    # Tutorials find the inputs beside them, as `thud-driver examples` puts them.
    (source / "docs/tutorials/inputs").symlink_to(source / "inputs")
    return source


def reduce_colors(path: Path) -> None:
    """Write a figure with 256 colors, which makes the file a third as large."""
    image = Image.open(path).convert("RGB")
    image.quantize(method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE).save(path)


def remove_outputs(path: Path) -> None:
    """Write a notebook as it is before it runs; its page shows what it prints and draws."""
    notebook = json.loads(path.read_text(encoding="utf-8"))
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            cell |= {"outputs": [], "execution_count": None}
    path.write_text(json.dumps(notebook, indent=1, ensure_ascii=False), encoding="utf-8")


def build(target: Path) -> None:
    """Build the site into a directory."""
    source = copy_sources()
    shutil.rmtree(target, ignore_errors=True)
    write_pages(REPOSITORY / "src", WORK / "fortran", source / "fortran")
    (source / "python_reference.md").write_text(python_page(), encoding="utf-8")
    sphinx = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-j", "auto"]
    shutil.rmtree(WORK / "doctrees", ignore_errors=True)
    # One process for each core reads pages; threads of BLAS would only wait for each other.
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    command = [*sphinx, "-d", WORK / "doctrees", source, target]
    subprocess.run(command, check=True, env=environment)
    for path in target.rglob("*.html"):  # what moves sideways, by the keyboard, too
        text = path.read_text(encoding="utf-8")
        for tag in ("<pre>", "<table>", '<table border="1" class="dataframe">', '<div class="math">'):
            text = text.replace(tag, f'{tag[:-1]} tabindex="0">')
        text = text.replace('<div class="table-wrapper', '<div tabindex="0" class="table-wrapper')
        path.write_text(text, encoding="utf-8")
    for path in target.glob("_images/*.png"):
        reduce_colors(path)
    for path in target.glob("_downloads/*/*.ipynb"):
        remove_outputs(path)


if __name__ == "__main__":
    build(Path(sys.argv[1]) if len(sys.argv) > 1 else WORK / "html")
