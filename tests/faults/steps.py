"""The driver's commands, over older results, with each call of the system going wrong once."""

from __future__ import annotations

import errno
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from forks import fail
from injection import KILLS
from kills import judge, order, prepare

if TYPE_CHECKING:
    import random
    from collections.abc import Iterable

    from campaign import Finding
    from forks import Done

ERRORS = [str(number) for number in (errno.ENOSPC, errno.EIO, errno.EMFILE, errno.EROFS)]
# A disk that stays full.
FULL = f"{errno.ENOSPC} from there on"
NAMES = ("sweep", "zarr", "surrogate", "fit", "measure", "export")


def _run(name: str, place: Path, at: int, action: str) -> tuple[Done, list[str]]:
    """Run a scenario whose call of that number in its directory goes wrong, none for 0."""
    prepare(place, name, old=True)
    return fail(order(name, place)._replace(env={"FAULT_UNDER": str(place)}), at, action)


@cache
def plan() -> list[tuple[str, str, int]]:
    """Return scenario, action and number of the call."""
    tries = []
    with TemporaryDirectory(prefix="thud_faults_") as folder:
        place = Path(folder, "steps")
        for name in NAMES:
            calls = len(_run(name, place, 0, "")[1])
            tries += [
                (name, action, at + 1)
                for action in (*KILLS, *ERRORS, FULL)
                for at in range(0, calls, 1 + calls // 100)
            ]
    return tries


def check_steps(tries: list[tuple[int, random.Random]], folder: Path) -> Iterable[Finding]:
    """Let one call after the other go wrong, then run the command again."""
    for number, _ in tries:
        name, action, at = plan()[number % len(plan())]
        done, calls = _run(name, folder / "steps", at, action)
        call = calls[at - 1] if at <= len(calls) else "none"
        what = f"{action} at {call}"
        yield judge(name, folder / "steps", done, what, old=True, killed=action in KILLS)
