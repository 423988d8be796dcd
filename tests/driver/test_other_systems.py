"""Files that come from Windows and macOS, or go there, and the page in their browsers."""

from __future__ import annotations

import platform
import re
import subprocess
from typing import TYPE_CHECKING

import pytest
from conftest import MINIMAL, REPOSITORY

import thud
from thud import cli
from thud.case.constructions import read_construction
from thud.cli.explore_command import _reachable_name
from thud.recordings.config import read_config

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from conftest import CaseFile, Run

pytestmark = pytest.mark.usefixtures("working_directory")

BYTE_ORDER_MARK = "\N{BYTE ORDER MARK}"
READERS: dict[str, Callable[[Path], object]] = {
    "case.nml": thud.read_case,
    "modal_slab.nml": lambda path: thud.solve(thud.read_case(path)).levels().tolist(),
    "s.toml": lambda path: repr(thud.read_study(path)),
    "lab.toml": read_config,
    "concrete_140.toml": read_construction,
    "drop_1.csv": lambda path: thud.read_recording(path).levels().tolist(),
    "field_levels.csv": lambda path: thud.read_room_levels(path).to_dataframe().to_dict(),
}
OWN = {"case.nml": MINIMAL, "s.toml": "parameters.height = {low = 0.5, high = 1.5, count = 2}\n"}


def text_of(name: str) -> str:
    """Return the text of an input."""
    return OWN.get(name) or next((REPOSITORY / "inputs").rglob(name)).read_text(encoding="utf-8")


def foreign(text: str) -> str:
    """Return a text as an editor of Windows saves it."""
    return BYTE_ORDER_MARK + text.replace("\n", "\r\n")


@pytest.mark.parametrize("name", READERS)
def test_inputs_of_windows_are_read(name: str, tmp_path: Path) -> None:
    found = []
    for change in (str, foreign):
        folder = tmp_path / change.__name__
        folder.mkdir()
        for entry in [name, "modal_slab.csv"] if name == "modal_slab.nml" else [name]:
            text = change(text_of(entry))
            (folder / entry).write_text(text, encoding="utf-8", newline="")
        found.append(READERS[name](folder / name))
    assert found[0] == found[1]


def test_results_of_a_case_of_windows_are_the_same(
    run: Run, case_file: CaseFile, tmp_path: Path
) -> None:
    assert run(case_file(MINIMAL)).returncode == 0
    before = (tmp_path / "outputs/case/force.csv").read_bytes()
    (tmp_path / "case.nml").write_text(foreign(MINIMAL), encoding="utf-8", newline="")
    (tmp_path / "t.csv").write_text(foreign("mass\n2.4\n"), encoding="utf-8", newline="")
    assert run("case.nml").returncode == 0
    assert (tmp_path / "outputs/case/force.csv").read_bytes() == before
    assert run("case.nml", "--samples", "t.csv").returncode == 0


@pytest.mark.parametrize("name", ["a. b", "console", "com0", "ü", "con_1"])
def test_other_names_are_allowed(name: str, case_file: CaseFile, tmp_path: Path) -> None:
    case = case_file(f"&case name = '{name}' / {MINIMAL}")
    assert cli.main(["run", "-q", "--no-figures", str(case)]) == 0
    assert (tmp_path / "outputs" / name).is_dir()


def test_files_of_the_repository_exist_on_every_system() -> None:
    listed = subprocess.run(
        ["/usr/bin/env", "git", "-C", REPOSITORY, "ls-files", "-z", "--eol"],
        check=False, capture_output=True, text=True,
    )  # fmt: skip
    if listed.returncode:
        pytest.skip("this is no clone")
    entries = [entry.split("\t") for entry in listed.stdout.rstrip("\0").split("\0")]
    names = [name for _, name in entries]
    assert not [name for name in names if re.search(r'[\\:*?"<>|]|[. ](/|$)', name)]
    device = re.compile(r"(^|/)(con|prn|aux|nul|(com|lpt)[1-9])(\.|/|$)", re.IGNORECASE)
    assert not list(filter(device.search, names))
    assert len({name.casefold() for name in names}) == len(names)
    # Scripts with the line ends of Windows would not run in WSL and containers.
    assert all("eol=lf" in attributes for attributes, _ in entries)


def test_page_has_an_address_that_windows_and_containers_forward(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(platform, "release", lambda: "6.6.87.2-microsoft-standard-WSL2")
    assert _reachable_name("127.0.0.1") == "localhost"
    assert _reachable_name("10.0.0.7") == "10.0.0.7"
    monkeypatch.setattr(platform, "release", lambda: "6.1.0-13-amd64")
    assert _reachable_name("127.0.0.1") == "127.0.0.1"
    assert _reachable_name("0.0.0.0") == "localhost"  # noqa: S104 - nothing listens
    assert _reachable_name("[::]") == "[::1]"
