"""Commands whose calls of the system go wrong, without space or rights, and clocks set back."""

from __future__ import annotations

import errno
import signal
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from forks import fail, forks
from injection import KILLS
from kills import judge, order, prepare
from scenarios import OUT, SCENARIOS

if TYPE_CHECKING:
    import random
    from collections.abc import Iterable

    from campaign import Finding, Tries
    from forks import Done, Order

NAMES = [name for name, one in SCENARIOS.items() if one.weight]
ERRORS = [str(number) for number in (errno.ENOSPC, errno.EIO, errno.EMFILE, errno.EROFS)]
# A disk that stays full.
FULL = f"{errno.ENOSPC} from there on"
STEPPED = ("sweep", "zarr", "surrogate", "fit", "measure", "export")
# Variables that say where programs keep what is no result.
HOMES = ("HOME", "TMPDIR", "MPLCONFIGDIR", "XDG_CACHE_HOME", "XDG_CONFIG_HOME")


def check_places(tries: Tries, folder: Path) -> Iterable[Finding]:
    """Run a command where something is missing, then where nothing is."""
    for number, chance in tries:
        name = NAMES[number % len(NAMES)]
        old = chance.random() < 0.5
        place = folder / "places"
        _free(place)
        prepare(place, name, old=old)
        kind = chance.choice(list(KINDS))
        disturbed, what = KINDS[kind](order(name, place), chance)
        done = forks().run(disturbed)
        _free(place)
        yield judge(name, place, done, f"{kind} {what}", old=old)


def _free(place: Path) -> None:
    """Let everything be written again."""
    for path in (place, *place.rglob("*")) if place.exists() else ():
        if path.is_dir():
            path.chmod(0o755)


def _few_descriptors(usual: Order, chance: random.Random) -> tuple[Order, str]:
    # With fewer neither an interpreter begins nor the loader of libraries.
    most = chance.randint(4 if usual.command[0] == "thud" else 8, 24)
    return usual._replace(limits={"RLIMIT_NOFILE": most}), str(most)


def _small_files(usual: Order, chance: random.Random) -> tuple[Order, str]:
    # Words on the screen are a file here.
    most = int(10 ** chance.uniform(3, 5))
    return usual._replace(limits={"RLIMIT_FSIZE": most}), str(most)


def _read_only(usual: Order, chance: random.Random) -> tuple[Order, str]:
    place = Path(usual.folder)
    path = chance.choice([place, place / OUT] if (place / OUT).exists() else [place])
    path.chmod(0o555)
    return usual._replace(humble=True), path.name


def _no_homes(usual: Order, chance: random.Random) -> tuple[Order, str]:
    names = chance.sample(HOMES, chance.randint(1, len(HOMES)))
    where = chance.choice(["/nonexistent", "/dev/null", "/proc/self", "/dev/full"])
    return usual._replace(env=dict.fromkeys(names, where), humble=True), f"{names} {where}"


def _other_clock(usual: Order, chance: random.Random) -> tuple[Order, str]:
    seconds = chance.choice((-1, 1)) * 10 ** chance.uniform(0, 8)
    return usual._replace(env={"FAULT_CLOCK": f"{seconds:.0f}"}), f"{seconds:.0f}"


def _interrupted(usual: Order, chance: random.Random) -> tuple[Order, str]:
    """Kill it first, so that the clock goes back between two runs of one study."""
    forks().run(usual._replace(signals=[(0.5 * chance.random(), signal.SIGKILL)]))
    return _other_clock(usual, chance)


KINDS = {
    "descriptors": _few_descriptors,
    "file size": _small_files,
    "read-only": _read_only,
    "homes": _no_homes,
    "clock": _other_clock,
    "clock and kill": _interrupted,
}


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
        for name in STEPPED:
            calls = len(_run(name, place, 0, "")[1])
            tries += [
                (name, action, at + 1)
                for action in (*KILLS, *ERRORS, FULL)
                for at in range(0, calls, 1 + calls // 100)
            ]
    return tries


def check_steps(tries: Tries, folder: Path) -> Iterable[Finding]:
    """Let one call after the other go wrong, then run the command again."""
    for number, _ in tries:
        name, action, at = plan()[number % len(plan())]
        done, calls = _run(name, folder / "steps", at, action)
        call = calls[at - 1] if at <= len(calls) else "none"
        what = f"{action} at {call}"
        yield judge(name, folder / "steps", done, what, old=True, killed=action in KILLS)
