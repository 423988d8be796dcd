"""Merging of similar messages about many drops."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w])")


def group_messages(messages: Iterable[tuple[str, str]], count: int, kind: str) -> list[str]:
    """Merge messages that differ only in numbers, with the range of each number.

    Numbers of drops at the beginning are listed: a range would include others.

    `messages` are pairs of the name of a drop or file and a message, `count` is the number of all
    drops or files, and `kind` is ``"drops"`` or ``"files"``.

    >>> group_messages([("a", "an offset of 3 N"), ("b", "an offset of 4.5 N")], 2, "drops")
    ['an offset of 3 to 4.5 N (2 of 2 drops)']
    >>> group_messages([("a", "drop 3 was left out"), ("a", "drop 5 was left out")], 1, "files")
    ['drops 3, 5 were left out']
    """
    groups: dict[str, list[tuple[str, list[str]]]] = {}
    for name, message in messages:
        pattern = NUMBER.sub("\0", message)
        groups.setdefault(pattern, []).append((name, NUMBER.findall(message)))
    result = []
    for pattern, members in groups.items():
        names = list(dict.fromkeys(name for name, _ in members))
        text = pattern
        columns = list(zip(*(numbers for _, numbers in members), strict=True))
        if pattern.startswith("drop \0 ") and len(set(columns[0])) > 1:
            numbers = sorted({int(number) for number in columns.pop(0)})
            text = text.replace("drop \0", f"drops {_listed(numbers)}", 1)
            text = text.replace(" was ", " were ", 1)
        for column in columns:
            text = text.replace("\0", _range(column), 1)
        if count > 1:
            text += f" ({names[0]})" if len(names) == 1 else f" ({len(names)} of {count} {kind})"
        result.append(text)
    return result


def group_by_kind(messages: Mapping[str, Sequence[tuple[str, Sequence[str]]]]) -> list[str]:
    """Merge messages of each kind, such as ``"drops"``, given as names with their messages."""
    return [
        message
        for kind, entries in messages.items()
        for message in group_messages(
            [(name, text) for name, texts in entries for text in texts], len(entries), kind
        )
    ]


def shorten(items: Sequence[str], count: int) -> list[str]:
    """Return items up to a number; if there are more, the last one says how many follow."""
    if len(items) <= count:
        return list(items)
    return [*items[: count - 1], f"and {len(items) - count + 1} more, in report.json"]


def _listed(numbers: Sequence[int]) -> str:
    """Return ascending numbers as text, three or more in a row as a range.

    >>> _listed([2, 3, 4, 7, 8])
    '2 to 4, 7, 8'
    """
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return ", ".join(
        f"{run[0]} to {run[-1]}" if len(run) > 2 else ", ".join(map(str, run))  # noqa: PLR2004
        for run in runs
    )


def _range(texts: Sequence[str]) -> str:
    low, high = min(texts, key=float), max(texts, key=float)
    return low if float(low) == float(high) else f"{low} to {high}"
