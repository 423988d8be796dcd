"""Facts about an input or a result that its user should know, and the sentences made of them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from decimal import Decimal
from itertools import groupby
from typing import TYPE_CHECKING

from thud.base.sentences import LIBRARY, PROCESSING, WARNINGS

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

_SENTENCES = PROCESSING | WARNINGS


@dataclass(frozen=True, eq=True)
class Note:
    """A fact: a possible fault, an assumption, or a step of processing."""

    # Its entry in `thud.base.sentences`, from which `sentence` makes words.
    code: str
    # What it is about: a key as "group.key", a file, a drop, a band or a criterion.
    subject: str = ""
    # Value, the range that it should have, NaN if there is none, and the unit of these numbers.
    value: float = math.nan
    low: float = math.nan
    high: float = math.nan
    unit: str = ""
    # Further values of the sentence, by name. A "part" is the part of the subject, such as a load
    # cell, that it is about.
    others: Mapping[str, float | str] = field(default_factory=dict, hash=False)

    @property
    def is_warning(self) -> bool:
        """Whether it states what may be wrong, not what was done."""
        return self.code not in PROCESSING

    @property
    def message(self) -> str:
        """The fact as a sentence, after its subject if it does not begin with it."""
        names_subject = not self.subject or "text" in self.others
        return str(self) if names_subject else f"{self.subject}: {self}"

    def __str__(self) -> str:
        """Return the fact as a sentence, without its subject."""
        return sentence([self])


def of_part(part: str, notes: Iterable[Note]) -> list[Note]:
    """Return notes about a part of their subject, such as a load cell."""
    return [replace(note, others={**note.others, "part": part}) for note in notes]


class _Range:
    """Values of one number in several notes, shown as its range, or with the format "list"."""

    def __init__(self, values: Sequence[float | str]) -> None:
        self.values = values

    def __format__(self, form: str) -> str:
        ordered = sorted(set(self.values), key=lambda value: (isinstance(value, str), value))
        if form == "list":
            return _listed([int(value) for value in ordered])
        texts = list(dict.fromkeys(decimal_text(value, form) for value in ordered))
        return texts[0] if len(texts) == 1 else f"{texts[0]} to {texts[-1]}"


def sentence(notes: Sequence[Note]) -> str:
    """Return one sentence for notes of one code, with the range of each number.

    >>> sentence([Note("offset_removed", value=value, unit="N") for value in (3.0, 4.5)])
    'an offset of 3 to 4.5 N was removed'
    """
    values = {
        name: _Range([getattr(note, name) for note in notes])
        for name in ("subject", "value", "low", "high", "unit")
    }
    values |= {name: _Range([note.others[name] for note in notes]) for name in notes[0].others}
    part = "{part}: " if "part" in values else ""
    # Facts of the library bring their text; their codes may be those of the driver too.
    text = LIBRARY if "text" in values else _SENTENCES[notes[0].code]
    return (part + text).format(**values)


def decimal_text(value: float | str, form: str) -> str:
    """Return a value by a format, never with an exponent.

    >>> decimal_text(2e4, ".4g"), decimal_text(2.5e-5, ".2g")
    ('20000', '0.000025')
    """
    if isinstance(value, str):
        return value
    text = format(value, form)
    return text if "e" not in text else f"{Decimal(text):f}"


def _listed(numbers: Sequence[int]) -> str:
    """Return ascending numbers as text, three or more in a row as a range.

    >>> _listed([2, 3, 4, 7, 8])
    '2 to 4, 7, 8'
    """
    groups = groupby(enumerate(numbers), lambda pair: pair[1] - pair[0])
    runs = ([number for _, number in group] for _, group in groups)
    return ", ".join(
        f"{run[0]} to {run[-1]}" if len(run) > 2 else ", ".join(map(str, run))  # noqa: PLR2004
        for run in runs
    )
