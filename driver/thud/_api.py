"""The one place where Python meets the Fortran library: status codes become exceptions."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

from thud import _core
from thud.errors import InputError, NumericalError

if TYPE_CHECKING:
    from collections.abc import Callable

api = _core.thud_api
level_api = _core.thud_level_api
ensemble_api = _core.thud_ensemble_api


def call(routine: Callable[..., tuple[Any, ...]], *arguments: object) -> tuple[Any, ...]:
    """Call a procedure of the library and return what it gives besides status and message.

    Parameters
    ----------
    routine
        Procedure of `api` whose last two results are a status and a message.
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
    return text(api.get_version())


def compiler() -> str:
    """Compiler of the library, with its options but for the places of files."""
    # Options that name places say nothing.
    return re.sub(r" (-[IJ] ?)?\S*/\S*", "", text(api.get_compiler()))
