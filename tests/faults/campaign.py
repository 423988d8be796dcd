"""Parts of the campaign of faults, and the count of what they find."""

from __future__ import annotations

import json
import random
import time
from collections import Counter
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from pathlib import Path

    Tries = list[tuple[int, random.Random]]
    Check = Callable[[Tries, Path], Iterable["Finding"]]

# What must never happen; every other finding is fine.
FAULTS = ("crashed", "hung", "NaN", "lost", "mixed", "raw", "grown", "left behind", "wrong")
# Seeds of the tries of a campaign follow each other; those of the next campaign begin here.
SPAN = 10**9
# Seconds between two writings of the counts.
INTERVAL = 10.0


class Finding(NamedTuple):
    """What became of one try: a word such as "refused" or one of `FAULTS`, and how to see it."""

    word: str
    detail: str = ""


class Part(NamedTuple):
    """A part of the campaign.

    Attributes
    ----------
    tries : int or callable
        Tries of the whole campaign, or what counts them.
    small : int
        Tries of the small one.
    check : callable
        Makes some tries in a directory: from number and random source of each.
    share : int
        Tries that `check` makes at a time.
    limit : int
        Seconds after which a try is interrupted.
    may_stop : bool
        Interrupted tries are fine: they compute what takes long.
    """

    tries: int | Callable[[], int]
    small: int
    check: Check
    share: int = 1
    limit: int = 300
    may_stop: bool = False

    def count(self) -> int:
        """Return the tries of the whole campaign."""
        return self.tries if isinstance(self.tries, int) else self.tries()


def draw(name: str, seed: int) -> tuple[int, random.Random]:
    """Return number and random source of the try of a part with a seed."""
    return seed % SPAN, random.Random(f"{name}/{seed}")  # noqa: S311


def each(attempt: Callable[[random.Random], tuple[str, str]]) -> Check:
    """Return the check that makes one attempt after the other."""
    return lambda tries, _: (Finding(*attempt(chance)) for _, chance in tries)


# What becomes of a valid input, some of which are computed.
ACCEPTED = ("accepted", "computed", "failed", "stopped")


class Report:
    """Counts of the findings of each part, kept in a file, so that the campaign goes on."""

    def __init__(self, seed: int, path: Path | None = None) -> None:
        self.seed = seed
        self.path = path
        self.counts: dict[str, Counter[str]] = {}
        self.details: list[str] = []
        if path and path.exists():
            known = json.loads(path.read_text())
            if known["seed"] == seed:
                self.counts = {part: Counter(found) for part, found in known["counts"].items()}
                self.details = known["details"]

    def run(
        self, name: str, tries: int, count: int, find: Callable[[list[int]], Iterable[Finding]]
    ) -> None:
        """Make a number of a part's tries, spread over all of them, but for those already made."""
        counts = self.counts.setdefault(name, Counter())
        numbers: Iterable[int] = range(tries)
        if count < tries:
            numbers = random.Random(f"{self.seed}/{name}").sample(range(tries), count)  # noqa: S311
        seeds = [self.seed * SPAN + number for number in numbers][counts.total() :]
        kept = time.monotonic()
        try:
            for seed, found in zip(seeds, find(seeds), strict=True):
                counts[found.word] += 1
                if found.word in FAULTS:
                    self.details.append(f"{name} {seed}: {found.word}: {found.detail}")
                if time.monotonic() > kept + INTERVAL:
                    self._keep()
                    kept = time.monotonic()
        finally:
            self._keep()

    def _keep(self) -> None:
        if self.path:
            known = {"seed": self.seed, "counts": self.counts, "details": self.details}
            new = self.path.with_name(self.path.name + ".new")
            new.write_text(json.dumps(known))
            new.replace(self.path)

    @property
    def faults(self) -> int:
        """Number of findings that must never happen."""
        return sum(counts[word] for counts in self.counts.values() for word in FAULTS)

    def computed(self, name: str) -> float:
        """Return the fraction of the accepted inputs of a part that were computed."""
        counts = self.counts[name]
        return counts["computed"] / max(1, sum(counts[word] for word in ACCEPTED))

    def __str__(self) -> str:
        """Return a table of the counts, and the faults."""
        lines = [
            " ".join(["part".ljust(12), "tried".rjust(9), *(f"{w:>8}" for w in FAULTS), " rest"])
        ]
        for name, counts in self.counts.items():
            rest = ", ".join(
                f"{n} {word}" for word, n in sorted(counts.items()) if word not in FAULTS
            )
            if counts["accepted"]:
                rest += f"; {self.computed(name):.0%} of the accepted are computed"
            bad = (f"{counts[word]:8}" for word in FAULTS)
            lines.append(" ".join([f"{name:12}", f"{counts.total():9}", *bad, f" {rest}"]))
        return "\n".join([*lines, *self.details[:50]])
