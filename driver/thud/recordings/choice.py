"""Choice of the drops that are measured."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from thud.base.checks import refuse
from thud.base.note import Note
from thud.recordings.config_values import parse_numbers

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from thud.recordings.drops import Window


def choose(
    windows: Sequence[Window], first: int, drops: str | None, leave_out: Mapping[str, str]
) -> tuple[list[Window], tuple[Note, ...]]:
    """Return the chosen windows, and notes on those that are left out.

    The windows have the numbers from `first` on. `drops` are the numbers of those to be measured,
    all but those whose windows say why not if None; `leave_out` are numbers of others, with the
    reason.
    """
    chosen: list[Window] = []
    notes: list[Note] = []
    excluded = [(parse_numbers(text, "leave_out"), why) for text, why in leave_out.items()]
    included = None if drops is None else parse_numbers(drops, "drops")
    for number, window in enumerate(windows, start=first):
        reason = next((why for ranges, why in excluded if _holds(ranges, number)), "")
        note = window.left_out if included is None else None
        if reason:
            note = Note("drop_left_out", others={"reason": reason})
        elif included is not None and not _holds(included, number):
            note = Note("drop_not_chosen", others={"chosen": drops or ""})
        if note is None:
            chosen.append(window)
            continue
        time = (window.start + window.contact[0]) / window.sample_rate
        notes.append(replace(note, value=number, others={**note.others, "time": time}))
    return chosen, tuple(notes)


def _holds(ranges: Sequence[range], number: int) -> bool:
    return any(number in numbers for numbers in ranges)


def require_chosen(
    count: int, chosen: int, drops: str | None, leave_out: Mapping[str, str]
) -> None:
    """Raise InputError if a number exceeds that of the drops, or none of the drops is chosen."""
    stated = {"leave_out": ",".join(leave_out), "drops": drops or ""}
    for key, text in stated.items():
        highest = max((r.stop - 1 for r in parse_numbers(text, key)), default=0) if text else 0
        if highest > count:
            refuse(f"{key}: there is no drop {highest}", f"numbers from 1 to {count}", subject=key)
    if not chosen:
        refuse("every drop is left out", "at least one drop")
