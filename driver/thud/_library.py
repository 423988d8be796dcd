"""The one place where Python meets the Fortran library: status codes become exceptions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from thud import _core
from thud.errors import InputError, NumericalError

if TYPE_CHECKING:
    from collections.abc import Callable

door = _core.thud_door
level_door = _core.thud_level_door
ensemble_door = _core.thud_ensemble_door


def call(routine: Callable[..., tuple[Any, ...]], *arguments: object) -> tuple[Any, ...]:
    """Call a procedure of the library and return what it gives besides status and message.

    Parameters
    ----------
    routine
        Procedure of `door` whose last two results are a status and a message.
    *arguments
        Its arguments.

    Returns
    -------
    tuple
        The other results.

    Raises
    ------
    InputError, NumericalError
        With the sentence of the library.
    """
    *results, status, message = routine(*arguments)
    if status == InputError.exit_code:
        raise InputError(text(message))
    if status != 0:
        raise NumericalError(text(message))
    return tuple(results)


def text(value: bytes) -> str:
    """Text of the library without the blanks behind it."""
    return value.decode(errors="surrogateescape").rstrip()


def words(value: bytes) -> list[str]:
    """Words of a list with commas between."""
    return [word.strip() for word in text(value).split(",")] if text(value) else []


def version() -> str:
    """Version of the library."""
    return text(door.get_version())
