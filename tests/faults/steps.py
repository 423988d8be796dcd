"""The driver's commands, over older results, with each call of the system going wrong once."""

from __future__ import annotations

import errno
import signal
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from campaign import Finding
from forks import Order, forks
from injection import KILLS
from kills import judge_again, judge_end, judge_files, prepare
from scenarios import NEW, SCENARIOS

if TYPE_CHECKING:
    import random
    from collections.abc import Iterable

    from forks import Done

ERRORS = [str(number) for number in (errno.ENOSPC, errno.EIO, errno.EMFILE, errno.EROFS)]
# A disk that stays full.
FULL = f"{errno.ENOSPC} from there on"
NAMES = ("sweep", "zarr", "surrogate", "fit", "measure", "export")


def _run(name: str, place: Path, at: int, action: str) -> Done:
    """Run a scenario whose call of that number goes wrong, none for 0."""
    number, _, on = action.partition(" ")
    env = {"FAULT_AT": str(at), "FAULT_ACTION": number, "FAULT_UNDER": str(place)}
    env["FAULT_LOG"] = str(place.with_suffix(".log"))
    if on:
        env["FAULT_FROM"] = "1"
    return forks().run(Order(SCENARIOS[name].given(NEW), str(place), env=env))


@cache
def plan() -> list[tuple[str, str, int]]:
    """Return scenario, action and number of the call."""
    tries = []
    with TemporaryDirectory(prefix="thud_faults_") as folder:
        place = Path(folder, "steps")
        for name in NAMES:
            prepare(place, name, old=True)
            _run(name, place, 0, "")
            calls = len(place.with_suffix(".log").read_text().splitlines())
            place.with_suffix(".log").unlink()
            tries += [
                (name, action, at + 1)
                for action in (*KILLS, *ERRORS, FULL)
                for at in range(0, calls, 1 + calls // 100)
            ]
    return tries


def check_steps(tries: list[tuple[int, random.Random]], folder: Path) -> Iterable[Finding]:
    """Let one call after the other go wrong, then run the command again."""
    for number, _ in tries:
        name, action, at = plan()[number]
        place = folder / "steps"
        prepare(place, name, old=True)
        log = place.with_suffix(".log")
        log.unlink(missing_ok=True)
        done = _run(name, place, at, action)
        calls = log.read_text().splitlines()
        call = calls[at - 1] if at <= len(calls) else "none"
        word = judge_end(done)
        if action not in KILLS and done.code in (-signal.SIGKILL, 130, 143):
            word = "crashed"
        elif done.code == 1 and not done.said.splitlines()[-1].startswith("thud-driver: "):
            word = "crashed: no sentence"
        word = word or judge_files(name, place, old=True, done=done.code == 0)
        again = forks().run(Order(SCENARIOS[name].given(NEW), str(place)))
        word, _, what = (word or judge_again(name, place, again, old=True)).partition(": ")
        detail = f"{name}, {action} at {call}: {done}, {again}, {what}"
        yield Finding(word or f"{name} {'done' if done.code == 0 else 'stopped'}", detail)
