"""Errors and checks of the entries of studies and targets."""

from __future__ import annotations

from typing import TYPE_CHECKING, NoReturn

from thud.checks import shown
from thud.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterable


def refuse(what: str, allowed: str, cause: Exception | None = None) -> NoReturn:
    """Raise InputError: what cannot be used, and what is allowed."""
    message = f"{what}; allowed: {allowed}"
    raise InputError(message) from cause


def refuse_value(place: str, value: object, allowed: str) -> NoReturn:
    """Raise InputError for a value."""
    refuse(f"{place} = {shown(value)} is not allowed", allowed)


def require_choice(place: str, value: object, allowed: Iterable[str]) -> None:
    """Raise InputError where a value is not among those allowed."""
    known = list(allowed)
    if value not in known:
        refuse(f"{place} = {shown(value)} is not known", ", ".join(known))
