"""Errors of the library as Python exceptions, and warnings."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from typing import Self

    from thud.base.note import Note


class ThudError(Exception):
    """Base of the errors of thud; the message is one sentence for the user.

    Attributes
    ----------
    exit_code : int
        Exit code that the commands use for this error.
    note : Note or None
        What the error is about, if that is a key or an argument: its name is the subject,
        ``"group.key"`` for a key of the library, with the value that is not allowed and its range;
        the message is the text ``"name"`` and, behind a blank, the text ``"text"``.
    """

    exit_code = 2

    def __init__(self, message: object = "", note: Note | None = None) -> None:
        super().__init__(message)
        self.note = note

    def within(self, place: object) -> Self:
        """Return the error with a place, such as a path, in front of its message.

        It is the beginning of the text ``"place"`` of the note, too.
        """
        note = self.note
        if note:
            before = f"{place}: {note.others.get('place', '')}"
            note = replace(note, others={**note.others, "place": before})
        return type(self)(f"{place}: {self}", note)


class FitWarning(UserWarning):
    """A result of a fit is unreliable in some respect; its argument is a `Note`."""


class PlausibilityWarning(UserWarning):
    """A result is possible but implausible; its argument is a `Note` or a sentence."""


class ReportWarning(UserWarning):
    """A report lacks a figure, a file or characters, or replaces another report."""


class InputError(ThudError, ValueError):
    """The input is invalid; the message names group, key, value and allowed range."""

    exit_code = 1


class WrongTypeError(InputError, TypeError):
    """An argument or a value of a key has a wrong type."""


class NumericalError(ThudError, ArithmeticError):
    """The computation failed."""
