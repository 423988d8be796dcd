"""Notes on many files and drops as sentences, one for each kind of note."""

from __future__ import annotations

from typing import TYPE_CHECKING

from thud.base.note import sentence

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from thud.base.note import Note
    from thud.recordings.measured_drop import Drop
    from thud.recordings.recording import Origin, Recording

    Select = Callable[[Note], bool]


def sentences(recording: Recording, select: Select) -> list[str]:
    """Return the selected notes of a recording, a sentence for each kind of note."""
    return [
        *(note.message for note in recording.own_notes if select(note)),
        *group_notes(recording.origins, "files", select),
        *group_notes(recording.drops, "drops", select),
    ]


def group_notes(parts: Sequence[Origin | Drop], kind: str, select: Select) -> list[str]:
    """Return a sentence for the notes that differ in numbers only, with the range of each number.

    `parts` are all drops or files, and `kind` is ``"drops"`` or ``"files"``. The sentence states
    how many of them have such a note.
    """
    groups: dict[tuple[str, ...], list[tuple[str, Note]]] = {}
    for part in parts:
        for note in filter(select, part.notes):
            words = [value for value in note.others.values() if isinstance(value, str)]
            groups.setdefault((note.code, note.unit, *words), []).append((part.name, note))
    result = []
    for members in groups.values():
        names = list(dict.fromkeys(name for name, _ in members))
        share = names[0] if len(names) == 1 else f"{len(names)} of {len(parts)} {kind}"
        text = sentence([note for _, note in members])
        result.append(f"{text} ({share})" if len(parts) > 1 else text)
    return result
