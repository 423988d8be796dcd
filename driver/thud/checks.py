"""Checks of arguments."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from thud.errors import InputError
from thud.files import lock as lock  # noqa: PLC0414
from thud.files import replace_file as replace_file  # noqa: PLC0414
from thud.files import require_own as require_own  # noqa: PLC0414
from thud.files import uninterrupted as uninterrupted  # noqa: PLC0414

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from types import UnionType


# Longer values are told by their kind.
LONGEST_SHOWN = 80
# No key takes a larger number, and Python does not print the largest ones.
LARGEST = 10**300
# The libraries that draw points take no larger seed.
LARGEST_SEED = 2**32 - 1


def require_kind(name: str, value: object, kind: type[Any] | UnionType) -> None:
    """Complain about an argument of another kind."""
    if not isinstance(value, kind):
        expected = getattr(kind, "__name__", None) or " or ".join(
            k.__name__ for k in get_args(kind)
        )
        message = f"{name} = {shown(value)} is not allowed; allowed: an object of {expected}"
        raise InputError(message)


def require_whole(name: str, value: Any, least: int, most: int) -> None:  # noqa: ANN401
    """Complain about what is not a whole number between two others."""
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not whole or not least <= value <= most:
        message = (
            f"{name} = {shown(value)} is not allowed; allowed: whole numbers from {least} to {most}"
        )
        raise InputError(message)


def require_number(name: str, value: Any) -> None:  # noqa: ANN401 - that is the question
    """Complain about what is not a finite number."""
    number = isinstance(value, int | float | np.integer | np.floating) and not isinstance(
        value, bool
    )
    if not number or not -LARGEST <= (value if isinstance(value, int) else float(value)) <= LARGEST:
        message = f"{name} = {shown(value)} is not allowed; allowed: finite numbers"
        raise InputError(message)


def shown(value: object) -> str:
    """Return a value as a message shows it: what is long or has lines by its kind."""
    if isinstance(value, int) and abs(value) > LARGEST:
        return "a very large number"
    text = repr(value)
    fits = len(text) <= LONGEST_SHOWN and "\n" not in text
    return text if fits else f"an object of {type(value).__name__}"


def require_words(place: str, given: Mapping[str, object], known: Iterable[str]) -> None:
    """Complain about words that mean nothing."""
    allowed = list(known)
    for word in given:
        if word not in allowed:
            message = f"{place}: {word!r} is not known; allowed: {', '.join(allowed)}"
            raise InputError(message)


def require_output(output: str | None) -> None:
    """Complain about a directory of the command line that has no name."""
    if output is not None and not output.strip():
        message = "--output has no value; allowed: a directory"
        raise InputError(message)
