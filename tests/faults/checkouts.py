"""Whole builds, and the first run, in checkouts whose paths have unusual characters."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

from campaign import Finding

if TYPE_CHECKING:
    from collections.abc import Iterable

    from campaign import Tries

REPOSITORY = Path(__file__).parents[2]
NAMES = ("a b", "äöü", "a b ü 'q'\"x", "$HOME", "a & b", "#1", "(a)", "[a] b]", "a;b")
# What builds and runs make, and the history.
_MADE = shutil.ignore_patterns(
    ".*_cache", ".git", ".hypothesis", ".venv", "build", "dist", "outputs"
)


def check_checkouts(tries: Tries, folder: Path) -> Iterable[Finding]:
    """Run `./bootstrap run` in a copy of the checkout; it brings its Python packages."""
    for number, _ in tries:
        place = folder / NAMES[number]
        shutil.copytree(REPOSITORY, place / "thud", ignore=_MADE)
        done = subprocess.run(
            ["./bootstrap", "run"],
            cwd=place / "thud",
            env={**os.environ, "XDG_CACHE_HOME": str(folder / "cache")},
            capture_output=True,
            text=True,
            check=False,
        )
        page = place / "thud/outputs/comparison/comparison.html"
        word = "run" if done.returncode == 0 and page.exists() else "crashed"
        yield Finding(word, f"{NAMES[number]}: {done.stderr[-2000:]}")
        shutil.rmtree(place)
        shutil.rmtree(folder / "cache", ignore_errors=True)
