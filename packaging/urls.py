"""State where the project is, which only its host knows: python packaging/urls.py ADDRESS."""

import sys
from pathlib import Path

address = sys.argv[1]
with Path(__file__).parents[1].joinpath("pyproject.toml").open("a", encoding="utf-8") as file:
    file.write(f"""
[project.urls]
Repository = "{address}"
Issues = "{address}/issues"
Changelog = "{address}/blob/main/CHANGELOG.md"
""")
