"""Facts about an input or a result that its user should know, and the sentences made of them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from thud.base.sentences import PROCESSING, WARNINGS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence


@dataclass(frozen=True, eq=True)
class Note:
    """A fact: a possible fault, an assumption, or a step of processing.

    Attributes
    ----------
    code : str
        Its entry in `thud.base.sentences`, from which `sentence` makes words.
    subject : str
        What it is about: a key as ``"group.key"``, a file, a drop, a band or a criterion.
    value, low, high : float
        Value, and the range that it should have; NaN if there is none.
    unit : str
        Unit of these numbers.
    effect : float
        Effect on the octave of 500 Hz that its uncertainty does not include, dB; zero if there is
        none, infinite if it is unknown.
    others : mapping
        Further values of the sentence, by name.
    """

    code: str
    subject: str = ""
    value: float = math.nan
    low: float = math.nan
    high: float = math.nan
    unit: str = ""
    effect: float = math.inf
    others: Mapping[str, float | str] = field(default_factory=dict)

    @property
    def is_warning(self) -> bool:
        """Whether it states what may be wrong, not what was done."""
        return self.code in WARNINGS

    def __str__(self) -> str:
        """Return the fact as a sentence, without its subject."""
        return sentence([self])


class _Range:
    """Values of one number in several notes, shown as its range."""

    def __init__(self, values: Sequence[float | str]) -> None:
        self.values = values

    def __format__(self, form: str) -> str:
        ordered = sorted(set(self.values), key=lambda value: (isinstance(value, str), value))
        texts = list(dict.fromkeys(format(value, form) for value in ordered))
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
    code = notes[0].code
    return (WARNINGS.get(code) or PROCESSING[code]).format(**values)
