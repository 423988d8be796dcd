"""Commands that are killed at random and run again: nothing is lost, mixed or done twice."""

from __future__ import annotations

import shutil
import signal
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from campaign import Finding
from forks import WORK, Order, forks
from scenarios import NEW, OLD, OUT, SCENARIOS, inputs, make

from thud.files import MANIFEST

if TYPE_CHECKING:
    import random
    from collections.abc import Iterable

    from forks import Done

    Tries = list[tuple[int, random.Random]]
    Files = dict[str, bytes]

SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
NOTES, MINE = "notes.txt", b"mine"
# Their results appear in one step.
AT_ONCE = ("run", "sets")


def files_of(folder: Path) -> Files:
    """Return the contents of all files below a directory by their paths."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


@cache
def undisturbed(name: str, which: str) -> tuple[Files, float]:
    """Return the files that a scenario leaves, and the time it takes, s."""
    with TemporaryDirectory(prefix="thud_faults_") as place:
        make(Path(place))
        done = forks().run(Order(SCENARIOS[name].given(which), place))
        if done.code or done.left:
            message = f"{name}: {done}"
            raise RuntimeError(message)
        return files_of(Path(place, OUT)), done.seconds


def prepare(place: Path, name: str, *, old: bool) -> None:
    """Make a directory with inputs and, where asked for, older results and a file of the user."""
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir()
    make(place)
    for path, content in {**undisturbed(name, OLD)[0], NOTES: MINE}.items() if old else ():
        target = place / OUT / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(content)


def check_kills(tries: Tries, folder: Path) -> Iterable[Finding]:
    """Kill a command at a random time, then run it again."""
    names = [name for name, one in SCENARIOS.items() for _ in range(one.weight)]
    for _, chance in tries:
        yield _check(chance.choice(names), chance, folder / "kill")


def check_slow_kills(tries: Tries, folder: Path) -> Iterable[Finding]:
    """Do the same with commands that draw, or start processes of their own."""
    names = [name for name, one in SCENARIOS.items() if not one.weight]
    for number, chance in tries:
        yield _check(names[number % len(names)], chance, folder / "kill")


def _check(name: str, chance: random.Random, place: Path) -> Finding:
    scenario = SCENARIOS[name]
    old = chance.random() < 0.5
    prepare(place, name, old=old)
    number = chance.choice(SIGNALS) * chance.choice((1, -1))
    usual = undisturbed(name, NEW)[1]
    sent = [(chance.uniform(0, usual), int(number))]
    if chance.random() < 0.1:
        sent.append((sent[0][0] + chance.uniform(0, 0.1), -signal.SIGKILL))
    first = forks().run(Order(scenario.given(NEW), str(place), sent))
    word = judge_end(first) or judge_files(name, place, old=old, done=first.code == 0)
    parts = list((place / OUT).glob("*.part*"))
    # Of whole results no part is needed any more.
    whole = undisturbed(name, NEW)[0].items() <= files_of(place / OUT).items()
    finished = _work(place) if parts and not whole else set()
    (place / WORK).unlink(missing_ok=True)
    again = forks().run(Order(scenario.given(NEW), str(place)))
    word = word or judge_again(name, place, again, old=old)
    if not word and (twice := finished & _work(place)):
        word = f"lost: {twice} repeated"
    word, _, what = word.partition(": ")
    detail = f"{name}, old {old}, {sent} of {usual:.3f} s: {first}, {again}, {what}"
    return Finding(word or f"{name} {'done' if first.code == 0 else 'killed'}", detail)


def _work(place: Path) -> set[str]:
    """Return the blocks or drops that were written."""
    path = place / WORK
    return set(path.read_text().split()) if path.exists() else set()


def judge_end(done: Done) -> str:
    """Return the fault in how a command has ended, if any: a word and what it is about."""
    if done.code == -signal.SIGALRM or done.left:
        return "hung"
    killed = -done.code in SIGNALS or done.code in (128 + signal.SIGINT, 128 + signal.SIGTERM)
    if done.code not in (0, 1, 2) and not killed:
        return "crashed"
    return "crashed" if "Traceback" in done.said or "Warning" in done.said else ""


def judge_files(name: str, place: Path, *, old: bool, done: bool) -> str:
    """Return the fault of what a command has left that may have ended early, if any."""
    found = files_of(place / OUT)
    before = undisturbed(name, OLD)[0] if old else {}
    new = undisturbed(name, NEW)[0]
    if old and found.pop(NOTES, b"") != MINE:
        return f"lost: {NOTES}"
    if done:
        return _difference(found, new)
    if name in AT_ONCE and found not in (before, new):
        return "mixed: not at once"
    # A study begins by removing the older results, as it was asked to, and a case its figures.
    gone = before.keys() - found.keys()
    if gone and not SCENARIOS[name].study and name != "figures":
        return f"lost: {gone}"
    bad = [path for path in found.keys() & (before.keys() | new.keys())
           if found[path] not in (before.get(path), new.get(path))
           and path != MANIFEST]  # fmt: skip
    return f"mixed: {bad}" if bad else ""


def judge_again(name: str, place: Path, again: Done, *, old: bool) -> str:
    """Return the fault of the undisturbed run that followed, if any."""
    if again.code or again.left:
        return "lost: fails again"
    found = files_of(place / OUT)
    if old and found.pop(NOTES, b"") != MINE:
        return f"lost: {NOTES}"
    left = {path.name for path in place.iterdir()} - {OLD, NEW, OUT, WORK, *inputs()}
    return _difference(found, undisturbed(name, NEW)[0]) or (
        f"mixed: {left} is left" if left else ""
    )


def _difference(found: Files, expected: Files) -> str:
    """Return the fault of files that should be others, if any."""
    if missing := expected.keys() - found.keys():
        return f"lost: {missing}"
    if left := found.keys() - expected.keys():
        return f"mixed: {left} is left"
    different = [path for path, content in found.items() if content != expected[path]]
    return f"mixed: {different}" if different else ""
