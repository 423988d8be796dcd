"""Manual pages and completions of shells: shells and roff take what is made of the commands."""

from __future__ import annotations

import shutil
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from conftest import REPOSITORY

if TYPE_CHECKING:
    from pathlib import Path

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


@pytest.fixture(scope="session")
def share(executable: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the directory of new pages and completions."""
    root = tmp_path_factory.mktemp("manual")
    generate = REPOSITORY / "driver/generate_manual.py"
    subprocess.run([sys.executable, "-P", generate, executable, root], check=True)
    return root / "share"


def test_manual_has_every_key(executable: str, share: Path) -> None:
    shown = subprocess.run([executable, "--keys"], capture_output=True, text=True, check=True)
    page = (share / "man/man1/thud.1").read_text()
    assert shown.stdout.count(" = ") == page.count(" = ") > 100
    # Meanings of several lines are whole.
    assert page.count("allowed:") == page.count(" = ")


@pytest.mark.skipif(not shutil.which("groff"), reason="groff is not installed")
@pytest.mark.parametrize("name", ["thud", "thud-driver"])
def test_roff_takes_the_pages_without_a_warning(name: str, share: Path) -> None:
    command = ["groff", "-man", "-ww", "-z", share / f"man/man1/{name}.1"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stderr == ""


@pytest.mark.parametrize("line", LINES)
def test_bash_completes(line: str, directory: Path, share: Path) -> None:
    words = line.split(" ")
    script = share / "bash-completion/completions" / words[0]
    command = ["bash", "-c", BASH, "bash", script, *words]
    done = subprocess.run(command, cwd=directory, capture_output=True, text=True, check=True)
    assert set(done.stdout.splitlines()) == LINES[line]


@pytest.mark.skipif(not shutil.which("fish"), reason="fish is not installed")
@pytest.mark.parametrize("line", LINES)
def test_fish_completes(line: str, directory: Path, share: Path) -> None:
    script = share / f"fish/vendor_completions.d/{line.split(maxsplit=1)[0]}.fish"
    command = ["fish", "--no-config", "-c", f"source {script}; complete -C '{line}'"]
    done = subprocess.run(command, cwd=directory, capture_output=True, text=True, check=True)
    assert {one.split("\t")[0].rstrip("/") for one in done.stdout.splitlines()} == LINES[line]


@pytest.mark.skipif(not shutil.which("zsh"), reason="zsh is not installed")
@pytest.mark.parametrize("name", ["thud", "thud-driver"])
def test_zsh_reads_the_completions(name: str, share: Path) -> None:
    # zsh finds the completion of the command on its function path, and its code is valid.
    script = (
        'fpath=("$1" $fpath); autoload -Uz compinit; compinit -Du; print -r -- "$_comps[$2]"; '
        'autoload +X -z "_$2"'
    )
    command = ["zsh", "-f", "-c", script, "zsh", share / "zsh/site-functions", name]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == (f"_{name}\n", "")
