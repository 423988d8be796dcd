"""Files that come from Windows and macOS, or go there, and the page in their browsers."""

from __future__ import annotations

import platform
import re
import subprocess
from typing import TYPE_CHECKING

import pytest
from conftest import MINIMAL, REPOSITORY, naming

import thud
from thud import cli
from thud.cli.explore_command import _reachable_name

if TYPE_CHECKING:
    from pathlib import Path

    from conftest import CaseFile, ErrorsOf, Run

pytestmark = pytest.mark.usefixtures("working_directory")

BYTE_ORDER_MARK = "\N{BYTE ORDER MARK}"
# Names that Windows forbids, whatever the case.
FORBIDDEN = ("a:b", "a*b", "a?b", 'a"b', "a<b", "a>b", "a|b", "a.", "con", "NUL", "aux.1", "Lpt5")
INPUTS = {
    "case.nml": "run --no-figures case.nml",
    "s.toml": "sweep --no-figures s.toml",
    "lab.toml": "measure --no-figures --config lab.toml {recordings}/drop_1.wav",
    "drop_1.csv": "measure --no-figures drop_1.csv",
    "field_levels.csv": "rate --no-figures field_levels.csv",
    "concrete_140.toml": "floor --construction concrete_140.toml",
    "modal_slab.nml": "run --no-figures modal_slab.nml",
}
OWN = {"case.nml": MINIMAL, "s.toml": "parameters.height = {low = 0.5, high = 1.5, count = 2}\n"}


def foreign(name: str) -> str:
    """Return the text of an input as an editor of Windows saves it."""
    found = next((REPOSITORY / "inputs").rglob(name), None)
    text = OWN.get(name) or (found.read_text(encoding="utf-8") if found else "")
    assert text
    return BYTE_ORDER_MARK + text.replace("\n", "\r\n")


@pytest.mark.parametrize("name", INPUTS)
def test_inputs_of_windows_are_read(name: str, tmp_path: Path) -> None:
    names = [name, "modal_slab.csv"] if name == "modal_slab.nml" else [name]
    for entry in names:
        (tmp_path / entry).write_text(foreign(entry), encoding="utf-8", newline="")
    recordings = REPOSITORY / "inputs/recordings"
    words = INPUTS[name].format(recordings=recordings).split()
    assert cli.main([*words, "-q", "-o", "out"]) == 0
    assert list((tmp_path / "out").iterdir())


def test_results_of_a_case_of_windows_are_the_same(
    run: Run, case_file: CaseFile, tmp_path: Path
) -> None:
    assert run(case_file(MINIMAL)).returncode == 0
    before = (tmp_path / "outputs/case/force.csv").read_bytes()
    (tmp_path / "case.nml").write_text(foreign("case.nml"), encoding="utf-8", newline="")
    (tmp_path / "t.csv").write_text(
        f"{BYTE_ORDER_MARK}mass\r\n2.4\r\n", encoding="utf-8", newline=""
    )
    assert run("case.nml").returncode == 0
    assert (tmp_path / "outputs/case/force.csv").read_bytes() == before
    assert run("case.nml", "--samples", "t.csv").returncode == 0


@pytest.mark.parametrize("name", FORBIDDEN)
def test_names_that_windows_forbids_are_refused(
    name: str, case_file: CaseFile, errors_of: ErrorsOf
) -> None:
    case = case_file(f"&case name = '{name}' / {MINIMAL}")
    pattern = naming("&case: name", repr(name).strip("'\""))
    assert re.search(pattern, errors_of("run", "--no-figures", case))
    ranges = {"parameters": {"height": {"values": [0.5, 1.0]}}}
    with pytest.raises(thud.InputError, match="name"):
        thud.sweep({"name": name, **ranges})


@pytest.mark.parametrize("name", ["a. b", "console", "com0", "ü", "con_1"])
def test_other_names_are_allowed(name: str, case_file: CaseFile, tmp_path: Path) -> None:
    case = case_file(f"&case name = '{name}' / {MINIMAL}")
    assert cli.main(["run", "-q", "--no-figures", str(case)]) == 0
    assert (tmp_path / "outputs" / name).is_dir()


def test_names_that_differ_in_case_only_do_not_share_a_directory(
    case_file: CaseFile, errors_of: ErrorsOf
) -> None:
    cases = [case_file(MINIMAL, f"{name}.nml") for name in ("ball", "Ball")]
    assert re.search(naming("'Ball'", cases[0]), errors_of("run", "-q", "--no-figures", *cases))


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
