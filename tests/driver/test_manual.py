"""Manual pages and completions of shells: they are fresh, and shells and roff take them."""

from __future__ import annotations

import shutil
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from conftest import REPOSITORY

if TYPE_CHECKING:
    from pathlib import Path

SHARE = REPOSITORY / "share"
PAGES = sorted(SHARE.glob("man/man1/*.1"))
# What the shell would offer for the words of a line.
BASH = """
. "$1"
shift
COMP_WORDS=("$@")
COMP_CWORD=$(($# - 1))
"_shtab_${1//-/_}"
printf '%s\\n' "${COMPREPLY[@]}"
"""
LINES = {
    "thud --t": {"--threads"},
    "thud a": {"a case.nml"},
    "thud b.nml --samples ": {"table.csv", "folder"},
    "thud-driver sen": {"sensitivity"},
    "thud-driver compare --source ": {"rubber_ball", "tyre"},
    "thud-driver run b.nml a": {"a case.nml"},
    "thud-driver run b.nml -o ": {"folder"},
    "thud-driver measure --config ": {"lab.toml", "folder"},
    "thud-driver measure ": {"a case.nml", "b.nml", "lab.toml", "table.csv", "folder"},
}


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    for name in ("a case.nml", "b.nml", "lab.toml", "table.csv"):
        (tmp_path / name).touch()
    (tmp_path / "folder").mkdir()
    return tmp_path


def test_files_of_the_repository_are_fresh(executable: str, tmp_path: Path) -> None:
    """`./bootstrap schema` was run after the latest change of a key, a command or an option."""
    generate = REPOSITORY / "driver/generate_manual.py"
    subprocess.run([sys.executable, "-P", generate, executable, tmp_path], check=True)
    made = {path.relative_to(tmp_path): path for path in tmp_path.rglob("*") if path.is_file()}
    kept = [path.relative_to(REPOSITORY) for path in SHARE.rglob("*") if path.is_file()]
    assert sorted(made) == sorted(kept)
    for name, path in made.items():
        assert path.read_text() == (REPOSITORY / name).read_text(), name


def test_manual_has_every_key(executable: str) -> None:
    shown = subprocess.run([executable, "--keys"], capture_output=True, text=True, check=True)
    page = (SHARE / "man/man1/thud.1").read_text()
    assert shown.stdout.count(" = ") == page.count(" = ") > 100


@pytest.mark.skipif(not shutil.which("groff"), reason="groff is not installed")
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_roff_takes_the_pages_without_a_warning(page: Path) -> None:
    command = ["groff", "-man", "-ww", "-z", page]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stderr == ""


@pytest.mark.parametrize("line", LINES)
def test_bash_completes(line: str, directory: Path) -> None:
    words = line.split(" ")
    script = SHARE / "bash-completion/completions" / words[0]
    command = ["bash", "-c", BASH, "bash", script, *words]
    done = subprocess.run(command, cwd=directory, capture_output=True, text=True, check=True)
    assert set(done.stdout.splitlines()) == LINES[line]


@pytest.mark.skipif(not shutil.which("fish"), reason="fish is not installed")
@pytest.mark.parametrize("line", LINES)
def test_fish_completes(line: str, directory: Path) -> None:
    script = SHARE / f"fish/vendor_completions.d/{line.split(maxsplit=1)[0]}.fish"
    command = ["fish", "--no-config", "-c", f"source {script}; complete -C '{line}'"]
    done = subprocess.run(command, cwd=directory, capture_output=True, text=True, check=True)
    assert {one.split("\t")[0].rstrip("/") for one in done.stdout.splitlines()} == LINES[line]


@pytest.mark.skipif(not shutil.which("zsh"), reason="zsh is not installed")
@pytest.mark.parametrize("path", sorted(SHARE.glob("zsh/*/*")), ids=lambda path: path.name)
def test_zsh_reads_the_completions(path: Path) -> None:
    command = ["zsh", "-f", "-n", path]
    subprocess.run(command, check=True)
