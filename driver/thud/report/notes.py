"""Notes on many files and drops as sentences, one for each kind of note."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from thud.base.note import sentence

if TYPE_CHECKING:
    from collections.abc import Sequence

    from thud.base.note import Note
    from thud.recordings.recording import Recording


class Noted(Protocol):
    """A file or a drop: its name, and notes on it."""

    @property
    def name(self) -> str:
        """Name of the file or the drop."""

    @property
    def notes(self) -> tuple[Note, ...]:
        """Notes on it."""


def processing(recording: Recording) -> list[str]:
    """Return what was done with files and drops, a sentence for each kind."""
    return _of_parts(recording, is_warning=False)


def warnings(recording: Recording) -> list[str]:
    """Return possible faults of a recording, its files and drops, a sentence for each kind."""
    own = [note.message for note in recording.own_notes]
    return [*own, *_of_parts(recording, is_warning=True)]


def _of_parts(recording: Recording, *, is_warning: bool) -> list[str]:
    return [
        *group_notes(recording.origins, "files", is_warning=is_warning),
        *group_notes(recording.drops, "drops", is_warning=is_warning),
    ]


def group_notes(parts: Sequence[Noted], kind: str, *, is_warning: bool) -> list[str]:
    """Return a sentence for the notes that differ in numbers only, with the range of each number.

    `parts` are all drops or files, and `kind` is ``"drops"`` or ``"files"``. The sentence states
    how many of them have such a note.
    """
    groups: dict[tuple[str, ...], list[tuple[str, Note]]] = {}
    for part in parts:
        for note in part.notes:
            if note.is_warning == is_warning:
                words = [value for value in note.others.values() if isinstance(value, str)]
                groups.setdefault((note.code, note.unit, *words), []).append((part.name, note))
    result = []
    for members in groups.values():
        names = list(dict.fromkeys(name for name, _ in members))
        share = names[0] if len(names) == 1 else f"{len(names)} of {len(parts)} {kind}"
        text = sentence([note for _, note in members])
        result.append(f"{text} ({share})" if len(parts) > 1 else text)
    return result


def shorten(items: Sequence[str], count: int) -> list[str]:
    """Return items up to a number; if there are more, the last one says how many follow."""
    if len(items) <= count:
        return list(items)
    return [*items[: count - 1], f"and {len(items) - count + 1} more, in report.json"]
