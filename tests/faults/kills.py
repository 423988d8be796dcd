"""Commands that are killed at random and run again: nothing is lost, mixed or done twice."""

from __future__ import annotations

import shutil
import signal
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from campaign import FAULTS, Finding
from directories import files_of
from forks import WORK, Order, forks
from scenarios import NEW, OLD, OUT, SCENARIOS, inputs, make

from thud.base.files import MANIFEST

if TYPE_CHECKING:
    import random
    from collections.abc import Iterable

    from campaign import Tries
    from forks import Done

    Files = dict[str, bytes]

SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
NOTES, MINE = "notes.txt", b"mine"
# Their results appear in one step.
AT_ONCE = ("run", "sets")


def order(name: str, place: Path) -> Order:
    """Return the command of a scenario with the newer input."""
    return Order(SCENARIOS[name].given(NEW), str(place))


@cache
def undisturbed(name: str, which: str) -> tuple[Files, float]:
    """Return the files that a scenario leaves, and the time it takes, s."""
    with TemporaryDirectory(prefix="thud_faults_") as place:
        make(Path(place))
        done = forks().run(Order(SCENARIOS[name].given(which), place))
        if done.code or done.left:
            message = f"{name}: {done}"
            raise RuntimeError(message)
        return files_of(Path(place, OUT), "**/*"), done.seconds


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
    return (_check(chance.choice(names), chance, folder / "kill") for _, chance in tries)


def check_slow_kills(tries: Tries, folder: Path) -> Iterable[Finding]:
    """Do the same with commands that draw, or start processes of their own."""
    names = [name for name, one in SCENARIOS.items() if not one.weight]
    return (_check(names[number % len(names)], chance, folder / "kill") for number, chance in tries)


def _check(name: str, chance: random.Random, place: Path) -> Finding:
    old = chance.random() < 0.5
    prepare(place, name, old=old)
    number = chance.choice(SIGNALS) * chance.choice((1, -1))
    usual = undisturbed(name, NEW)[1]
    sent = [(chance.uniform(0, usual), int(number))]
    if chance.random() < 0.1:
        sent.append((sent[0][0] + chance.uniform(0, 0.1), -signal.SIGKILL))
    first = forks().run(order(name, place)._replace(signals=sent))
    parts = list((place / OUT).glob("*.part*"))
    # Of whole results no part is needed any more.
    whole = undisturbed(name, NEW)[0].items() <= files_of(place / OUT, "**/*").items()
    finished = _work(place) if parts and not whole else set()
    (place / WORK).unlink(missing_ok=True)
    found = judge(name, place, first, f"{sent} of {usual:.3f} s", old=old, killed=True)
    if found.word not in FAULTS and (twice := finished & _work(place)):
        return Finding("lost", f"{twice} repeated: {found.detail}")
    return found


def _work(place: Path) -> set[str]:
    """Return the blocks that were written."""
    path = place / WORK
    return set(path.read_text().split()) if path.exists() else set()


def judge(  # noqa: PLR0913 - what was disturbed, and how
    name: str, place: Path, done: Done, what: str, *, old: bool, killed: bool = False
) -> Finding:
    """Return the finding of a command that was disturbed, after it has run again undisturbed."""
    word = judge_end(done, killed=killed)
    word = word or _judge_files(name, place, old=old, done=done.code == 0)
    again = forks().run(order(name, place))
    word, _, why = (word or _judge_again(name, place, again, old=old)).partition(": ")
    detail = f"{name}, old {old}, {what}: {done}, {again}, {why}"
    return Finding(word or f"{name} {'done' if done.code == 0 else 'stopped'}", detail)


def judge_end(done: Done, *, killed: bool = False) -> str:
    """Return the fault in how a command has ended, if any: a word and what it is about."""
    if done.code == -signal.SIGALRM or done.left:
        return "hung"
    if killed and (
        -done.code in SIGNALS or done.code in (128 + signal.SIGINT, 128 + signal.SIGTERM)
    ):
        return ""
    if done.code not in (0, 1, 2) or "Traceback" in done.said or "Warning" in done.said:
        return "crashed"
    last = (done.said.splitlines() or [""])[-1]
    return "" if done.code == 0 or last.startswith("thud") else "crashed: no sentence"


def _judge_files(name: str, place: Path, *, old: bool, done: bool) -> str:
    """Return the fault of what a command has left that may have ended early, if any."""
    found = files_of(place / OUT, "**/*")
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


def _judge_again(name: str, place: Path, again: Done, *, old: bool) -> str:
    """Return the fault of the undisturbed run that followed, if any."""
    if again.code or again.left:
        return "lost: fails again"
    found = files_of(place / OUT, "**/*")
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
