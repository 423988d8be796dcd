"""Foreign files in the way of commands: they are there afterwards, bit for bit."""

from __future__ import annotations

import os
import shutil
from typing import TYPE_CHECKING

from campaign import Finding
from forks import Order, forks
from kills import judge_end, undisturbed
from scenarios import NEW, OUT, SCENARIOS, make

from thud.base.files import MANIFEST, TEMPORARY

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from pathlib import Path

    from campaign import Tries

NAMES = [name for name, one in SCENARIOS.items() if one.weight]
MINE = b"of the user\n"
# Names that commands read, or write for a while.
READ = (
    MANIFEST,
    TEMPORARY,
    "effective.nml",
    "samples.nml",
    "sweep.partial",
    "zarr.partial",
    "sweep.zarr",
)


def check_foreign(tries: Tries, folder: Path) -> Iterable[Finding]:
    """Put a foreign file under a name that a command reads or writes."""
    for number, chance in tries:
        name = NAMES[number % len(NAMES)]
        place = folder / "foreign"
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir()
        make(place)
        (place / "mine").write_bytes(MINE)
        (place / "mine").chmod(chance.choice((0o644, 0o444)))
        new = SCENARIOS[name].given(NEW)
        if chance.random() < 0.3:
            forks().run(Order(new, str(place)))
        path = place / OUT / chance.choice([*sorted(undisturbed(name, NEW)[0]), *READ])
        path.parent.mkdir(parents=True, exist_ok=True)
        shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
        kind = chance.choice(list(KINDS))
        source = chance.choice([place / "mine", *sorted((place / NEW).iterdir())])
        KINDS[kind](path, source)
        before, told = _state(path), source.read_bytes()
        # Inputs stay even where other files are to be replaced.
        words = [word for word in new if word != "--replace"]
        is_input = source != place / "mine" and f"{NEW}/{source.name}" in words
        if is_input and kind in ("hard link", "link") and chance.random() < 0.5:
            words.append("--replace")
        done = forks().run(Order(words, str(place)))
        word = judge_end(done).partition(":")[0]
        # A temporary name is the program's own.
        if path.name != TEMPORARY and _state(path) != before:
            word = word or "lost"
        if source.read_bytes() != told:
            word = word or "lost"
        yield Finding(
            word or ("done" if done.code == 0 else "refused"),
            f"{' '.join(words)}: {kind} of {source.name} as {path.name}: {done}",
        )


def _state(path: Path) -> object:
    """Return what is at a path, and where it leads."""
    if not os.path.lexists(path):
        return None
    found = path.lstat()
    content = path.read_bytes() if path.is_file() else sorted(p.name for p in path.iterdir()) if (
        path.is_dir()
    ) else b""  # fmt: skip
    return found.st_mode, content, path.readlink() if path.is_symlink() else None


def _directory(path: Path, _: Path) -> None:
    path.mkdir()
    (path / "mine").write_bytes(MINE)


# What puts a foreign file of some content there.
KINDS: dict[str, Callable[[Path, Path], object]] = {
    "copy": lambda path, source: shutil.copy(source, path),
    "hard link": lambda path, source: os.link(source, path),
    "link": lambda path, source: path.symlink_to(source),
    "dangling link": lambda path, _: path.symlink_to("nowhere"),
    "pipe": lambda path, _: os.mkfifo(path),
    "directory": _directory,
}
