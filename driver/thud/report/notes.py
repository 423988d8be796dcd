"""Messages about many drops, those that are alike as one."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w])")


def group_sentences(said: Iterable[tuple[str, str]], places: int, kind: str) -> list[str]:
    """Return sentences that differ in numbers only as one, with the range of each number.

    Parameters
    ----------
    said
        Place (name of a drop or a file) and sentence.
    places
        Number of all places.
    kind
        What places are, such as ``"drops"``.

    >>> group_sentences([("a", "an offset of 3 N"), ("b", "an offset of 4.5 N")], 2, "drops")
    ['an offset of 3 to 4.5 N (2 of 2 drops)']
    """
    groups: dict[str, list[tuple[str, list[str]]]] = {}
    for place, sentence in said:
        pattern = NUMBER.sub("\0", sentence)
        groups.setdefault(pattern, []).append((place, NUMBER.findall(sentence)))
    found = []
    for pattern, members in groups.items():
        names = list(dict.fromkeys(place for place, _ in members))
        columns = zip(*(numbers for _, numbers in members), strict=True)
        text = pattern
        for column in columns:
            text = text.replace("\0", _range(column), 1)
        if places > 1:
            text += f" ({names[0]})" if len(names) == 1 else f" ({len(names)} of {places} {kind})"
        found.append(text)
    return found


def group_places(places: Mapping[str, Sequence[tuple[str, Sequence[str]]]]) -> list[str]:
    """Return sentences of places of several kinds, those of one kind that are alike as one.

    Parameters
    ----------
    places
        By kind, such as ``"drops"``: name and sentences of each place.
    """
    return [
        sentence
        for kind, ones in places.items()
        for sentence in group_sentences(
            [(name, one) for name, sentences in ones for one in sentences], len(ones), kind
        )
    ]


def shorten(items: Sequence[str], count: int) -> list[str]:
    """Return up to a number of items; of more, the first ones and how many follow."""
    if len(items) <= count:
        return list(items)
    return [*items[: count - 1], f"and {len(items) - count + 1} more, in report.json"]


def _range(texts: Sequence[str]) -> str:
    """Return the minimum and the maximum of numbers as they are written."""
    low, high = min(texts, key=float), max(texts, key=float)
    return low if float(low) == float(high) else f"{low} to {high}"
