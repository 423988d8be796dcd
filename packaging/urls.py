"""State where the project is, which only its host knows: run by the workflow of a release.

python packaging/urls.py https://host/owner/thud
"""

import sys
from pathlib import Path

PROJECT = Path(__file__).parents[1] / "pyproject.toml"


def main(address: str) -> None:
    """Add the addresses to pyproject.toml."""
    text = PROJECT.read_text(encoding="utf-8")
    urls = f"""[project.urls]
Repository = "{address}"
Issues = "{address}/issues"
Changelog = "{address}/blob/main/CHANGELOG.md"

"""
    text = text.replace("[project.scripts]", f"{urls}[project.scripts]")
    PROJECT.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
