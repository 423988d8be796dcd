"""Parts of the campaign of faults, and the count of what they find."""

from __future__ import annotations

import json
import random
from collections import Counter
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from pathlib import Path

# What must never happen; every other finding is fine.
FAULTS = ("crashed", "hung", "NaN", "lost", "mixed", "raw", "grown", "left behind", "wrong")


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
        Makes a number of tries in an empty directory: from number and random source of each.
    share : int
        Tries that `check` makes at a time.
    """

    tries: int | Callable[[], int]
    small: int
    check: Callable[[list[tuple[int, random.Random]], Path], Iterable[Finding]]
    share: int = 1


class Report:
    """Counts of the findings of each part, kept in a file after each share, so that it goes on."""

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

    def run(self, name: str, part: Part, tries: int, folder: Path, *, spread: bool = False) -> None:
        """Make the tries of a part that are still to be made, or some of them spread over all."""
        counts = self.counts.setdefault(name, Counter())
        numbers = range(part.tries if isinstance(part.tries, int) else part.tries())
        if spread:
            numbers = random.Random(f"{self.seed}/{name}").sample(numbers, min(tries, len(numbers)))  # type: ignore[assignment]  # noqa: S311
        for start in range(counts.total(), len(numbers), part.share):
            share = [
                (number, random.Random(f"{self.seed}/{name}/{number}"))  # noqa: S311
                for number in numbers[start : start + part.share]
            ]
            for (number, _), found in zip(share, part.check(share, folder), strict=True):
                counts[found.word] += 1
                if found.word in FAULTS:
                    self.details.append(f"{name} {number}: {found.word}: {found.detail}")
            if self.path:
                known = {"seed": self.seed, "counts": self.counts, "details": self.details}
                new = self.path.with_name(self.path.name + ".new")
                new.write_text(json.dumps(known))
                new.replace(self.path)

    @property
    def faults(self) -> int:
        """Number of findings that must never happen."""
        return sum(counts[word] for counts in self.counts.values() for word in FAULTS)

    def __str__(self) -> str:
        """Return a table of the counts, and the faults."""
        lines = [
            " ".join(["part".ljust(12), "tried".rjust(9), *(f"{w:>8}" for w in FAULTS), " rest"])
        ]
        for name, counts in self.counts.items():
            rest = ", ".join(
                f"{n} {word}" for word, n in sorted(counts.items()) if word not in FAULTS
            )
            bad = (f"{counts[word]:8}" for word in FAULTS)
            lines.append(" ".join([f"{name:12}", f"{counts.total():9}", *bad, f" {rest}"]))
        return "\n".join([*lines, *self.details[:50]])
