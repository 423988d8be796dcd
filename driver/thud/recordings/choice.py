"""Choice of the drops that are measured."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from thud.base.checks import refuse
from thud.base.note import Note
from thud.recordings.config_values import parse_numbers

if TYPE_CHECKING:
    from collections.abc import Sequence

    from thud.recordings.config import Config
    from thud.recordings.drops import Pulse


def choose(
    found: Sequence[Pulse], first: int, rate: float, config: Config
) -> tuple[list[Pulse], list[Note]]:
    """Return the drops to be measured, and notes on those that are left out.

    The drops found in a signal of a sample rate, Hz, have the numbers from `first` on. Without
    chosen numbers all are measured but those that say why not.
    """
    chosen: list[Pulse] = []
    notes: list[Note] = []
    reasons = {
        number: reason
        for numbers, reason in config.leave_out.items()
        for number in range(first, first + len(found))
        if _holds(numbers, number, "leave_out")
    }
    for number, drop in enumerate(found, start=first):
        note = None if config.drops else drop.left_out
        if number in reasons:
            note = Note("drop_left_out", others={"reason": reasons[number]})
        elif config.drops and not _holds(config.drops, number, "drops"):
            note = Note("drop_not_chosen", others={"chosen": config.drops})
        if note is None:
            chosen.append(drop)
            continue
        others = {**note.others, "time": drop.contact[0] / rate}
        notes.append(replace(note, value=number, others=others))
    return chosen, notes


def _holds(text: str, number: int, key: str) -> bool:
    return any(number in numbers for numbers in parse_numbers(text, key))


def require_chosen(count: int, chosen: int, config: Config) -> None:
    """Raise InputError if a number exceeds that of the drops, or none of the drops is chosen."""
    for key, text in (("leave_out", ",".join(config.leave_out)), ("drops", config.drops)):
        highest = max(numbers.stop - 1 for numbers in parse_numbers(text, key)) if text else 0
        if highest > count:
            refuse(f"{key}: there is no drop {highest}", f"numbers from 1 to {count}", subject=key)
    if not chosen:
        refuse("every drop is left out", "at least one drop")
