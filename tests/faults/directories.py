"""Result directories under kills, errors of the system, delays and damage."""

from __future__ import annotations

import shutil
import subprocess
import time
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from campaign import Finding
from forks import Order, fail, forks
from injection import ERRORS, KILLS, PATIENCE, executable, injecting

import thud
from thud.base.files import Results

if TYPE_CHECKING:
    import random
    from collections.abc import Iterable, Iterator

    from campaign import Tries


INPUTS = {
    "a": "&case name = 'case' / &ball / &drop / &model /",
    "b": "&case name = 'case' / &ball mass = 2.4 / &drop / &model / &modes count = 1 /",
}
MINE = {"notes.txt": b"mine"}
FIGURE = "force.png"
# Files of the directory that are no results.
OTHER = {".thud", FIGURE, *MINE}


class Place(NamedTuple):
    """A directory, and how it is named to a run: by its name, or as its working directory."""

    out: Path
    where: Path
    arguments: list[str]

    def order(self, new: str) -> Order:
        """Return the command that writes the results of an input there."""
        return Order(["thud", f"{self.out.parent}/{new}.nml", *self.arguments], str(self.where))


@cache
def whole_sets() -> dict[str, dict[str, bytes]]:
    """Return the files of each input."""
    folder = Path(mkdtemp(prefix="thud_faults_"))
    found = {}
    for name, text in INPUTS.items():
        (folder / f"{name}.nml").write_text(text)
        command = [executable(), f"{name}.nml", "-q", "-o", name]
        subprocess.run(command, cwd=folder, check=True, timeout=PATIENCE)
        found[name] = files_of(folder / name)
    shutil.rmtree(folder)
    return found


def files_of(folder: Path, pattern: str = "*") -> dict[str, bytes]:
    """Return the contents of the files of a directory by their paths in it."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.glob(pattern)
        if path.is_file()
    }


def owner_of(found: dict[str, bytes]) -> str | None:
    """Return the input that all results of a directory are of, if all are there."""
    results = {name: content for name, content in found.items() if name not in OTHER}
    for name, files in whole_sets().items():
        if results == {n: content for n, content in files.items() if n not in OTHER}:
            return name
    return None


def made(folder: Path, old: str, way: str) -> Place:
    """Return a directory with the results of an input, a figure of it and a file of the user."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for name, text in INPUTS.items():
        (folder / f"{name}.nml").write_text(text)
    out = folder / "o"
    out.mkdir()
    for name, content in {**whole_sets()[old], **MINE}.items():
        (out / name).write_bytes(content)
    Results(out).write({FIGURE: b"figure"})
    if way == "exchanged":
        return Place(out, folder, ["-q", "-o", "o"])
    return Place(out, out, ["-q", "-o", "."])


@cache
def plan() -> list[tuple[str, str, str, str, int]]:
    """Return way, old and new input, action and number of each call that can go wrong."""
    tries = []
    folder = Path(mkdtemp(prefix="thud_faults_"))
    for way in ("exchanged", "moved"):
        for old, new in ("ab", "ba", "aa"):
            place = made(folder / "o", old, way)
            calls = len(fail(place.order(new), 0, "")[1])
            tries += [
                (way, old, new, action, at + 1)
                for action in (*KILLS, *ERRORS)
                for at in range(calls)
            ]
    shutil.rmtree(folder)
    return tries


def check_calls(tries: Tries, folder: Path) -> Iterable[Finding]:
    """Let one call after the other go wrong: kill, interrupt, full disk, error of the disk."""
    for number, _ in tries:
        way, old, new, action, at = plan()[number]
        place = made(folder / "calls", old, way)
        done, calls = fail(place.order(new), at, action)
        call = calls[at - 1]
        # Where the call is of the screen, the results are there and their warnings are not.
        written = done.code == 0 or "are written" in done.said or "(deleted)" in call
        if done.code not in (0, 1, 2, -9, 130, 143):
            word = "crashed"
        else:
            expected = (old, new) if done.code == -9 else (new if written else old,)
            word = _judged(place, old, expected)
        word = word or _healed(place, new) or ("replaced" if written else "kept")
        yield Finding(word, f"{way} {old} to {new}, {action} at {call}: {done.code}, {done.said}")


def _judged(place: Place, old: str, expected: tuple[str, ...]) -> str:
    """Return the fault of a directory whose results may be those of some inputs, if any."""
    found = files_of(place.out)
    owner = owner_of(found)
    if any(found.get(name) != content for name, content in MINE.items()):
        return "lost"
    if owner is None and len(expected) > 1 and "effective.nml" not in found:
        # Killed while files were moved one by one.
        return "mixed" if _readable(place.out) else ""
    if owner not in expected:
        return "lost"
    return "mixed" if (FIGURE in found) != (owner == old) else ""


def _healed(place: Place, new: str) -> str:
    """Return the fault after another run without a fault, if any."""
    done = forks().run(place.order(new))
    left = [path for path in (*place.out.iterdir(), *place.out.parent.iterdir())
            if path.name.endswith(".part")]  # fmt: skip
    if done.code or left or owner_of(files_of(place.out)) != new:
        return "lost"
    return "" if _readable(place.out) else "mixed"


def _readable(folder: Path) -> bool:
    try:
        thud.read_results(folder)
    except thud.InputError:
        return False
    return True


def check_races(tries: Tries, folder: Path) -> Iterable[Finding]:
    """Let a run wait before one of its calls, while another one writes into its directory."""
    for number, _ in tries:
        # Files of one case with two inputs, or of two cases.
        at, cases = 1 + number // 2, 1 + number % 2
        shutil.rmtree(folder / "race", ignore_errors=True)
        place = folder / "race"
        place.mkdir()
        for name, text in INPUTS.items():
            given = text if cases == 1 else text.replace("'case'", f"'{name}'")
            (place / f"{name}.nml").write_text(given)
        command = [executable(), "a.nml", "-q", "-o", "o"]
        slow = injecting(at=at, action="0.1s")
        with subprocess.Popen(command, cwd=place, env=slow, stderr=subprocess.DEVNULL) as first:
            time.sleep(0.02)
            command[1] = "b.nml"
            second = subprocess.run(
                command, cwd=place, capture_output=True, check=False, timeout=60
            )
            codes = first.wait(PATIENCE), second.returncode
        yield Finding(_won(place, codes, cases), f"delay at {at}, {cases} cases: {codes}")


def _won(place: Path, codes: tuple[int, int], cases: int) -> str:
    """Return what two runs in one directory have left."""
    found = files_of(place / "o")
    if cases == 2:
        if sorted(codes) != [0, 1]:
            return "lost"
        owner = "ab"[codes.index(0)]
        found = {
            name: content.replace(f"'{owner}'".encode(), b"'case'").replace(
                f"case {owner},".encode(), b"case case,"
            )
            for name, content in found.items()
        }
        return f"{owner} stays" if owner_of(found) == owner else "mixed"
    if codes != (0, 0) or any(path.name != "o" for path in place.iterdir() if path.is_dir()):
        return "lost"
    owner_ = owner_of(found)
    return f"{owner_} stays" if owner_ else "mixed"


def check_damage(tries: Tries, folder: Path) -> Iterable[Finding]:
    """Damage one file of a directory: reading it is refused, or gives what was written."""
    for number, chance in tries:
        place = made(folder / "damage", "a", "exchanged").out
        whole = thud.read_results(place)
        said = "".join(_damage(place, chance, with_manifest=number % 4 != 0))
        try:
            yield _compared(thud.read_results(place), whole, said)
        except thud.InputError:
            yield Finding("refused")


def _compared(found: thud.Impact, whole: thud.Impact, said: str) -> Finding:
    """Return whether results that were read are those before the damage, or come with a warning."""
    if found.warnings != whole.warnings:
        return Finding("read with a warning")
    same = np.array_equal(found.floor_force, whole.floor_force) and found.case == whole.case
    return Finding("read" if same and found.contact_time == whole.contact_time else "mixed", said)


def _damage(place: Path, chance: random.Random, *, with_manifest: bool) -> Iterator[str]:
    """Damage a directory of results; yield what was done."""
    if not with_manifest:
        (place / ".thud").unlink()
        yield "without manifest: "
    path = place / chance.choice(
        [".thud", "effective.nml", "summary.nml", "force.csv"][0 if with_manifest else 1 :]
    )
    content = bytearray(path.read_bytes())
    at = chance.randrange(len(content))
    kind = chance.choice(["flip", "cut", "insert", "other", "none", "directory", "noise"])
    yield f"{path.name} {kind} at {at}"
    if kind == "flip":
        content[at] ^= 1 << chance.randrange(8)
    elif kind == "cut":
        del content[at:]
    elif kind == "insert":
        content[at:at] = chance.choice([b"\0", b"nan", b"/", b"&", b"'", b"\n", b"1e999", b"\xff"])
    elif kind == "other":
        content[:] = whole_sets()["b"][path.name]
    elif kind == "noise":
        content[at : at + 64] = chance.randbytes(64)
    path.unlink()
    if kind == "directory":
        path.mkdir()
    elif kind != "none":
        path.write_bytes(content)
