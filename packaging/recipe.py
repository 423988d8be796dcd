"""Write the conda recipe of a source distribution beside it.

Run as ``python packaging/recipe.py dist/thud_acoustics-1.0.0.tar.gz``.
"""

import hashlib
import re
import sys
import tomllib
from pathlib import Path

REPOSITORY = Path(__file__).parents[1]
# What conda-forge calls otherwise.
NAMES = {"matplotlib": "matplotlib-base"}


def conda(requirement: str) -> str:
    """Return a requirement of pyproject.toml as conda writes it."""
    found = re.fullmatch(r"([\w-]+)(\S*)", requirement)
    if found is None:
        message = f"{requirement}: not a name and a range"
        raise SystemExit(message)
    return f"{NAMES.get(found[1], found[1])} {found[2]}"


def main(source: str) -> None:
    """Write the recipe."""
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))
    path = Path(source)
    values = {
        "version": path.name.removeprefix("thud_acoustics-").removesuffix(".tar.gz"),
        "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        "build": "\n    - ".join(["", *map(conda, project["build-system"]["requires"])]).strip(),
        "run": "\n    - ".join(["", *map(conda, project["project"]["dependencies"])]).strip(),
        "summary": project["project"]["description"],
    }
    text = (REPOSITORY / "packaging/recipe.yaml.in").read_text(encoding="utf-8")
    text = re.sub(r"@(\w+)@", lambda found: values[found[1]], text)
    path.with_name("recipe.yaml").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
