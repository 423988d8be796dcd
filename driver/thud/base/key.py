"""Declaration of an input key, and the base of the classes whose fields are keys."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Literal, Self

from thud.base.checks import refuse, refuse_unknown
from thud.base.immutable import Plain

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

Kind = Literal["real", "whole", "choice", "flag", "list", "text", "texts"]


@dataclass(frozen=True)
class Key:
    """Input key, declared by the library.

    Attributes
    ----------
    owner : str
        What uses the key: a source model, a floor, ``"modes"``, ``"compression"``, ``"unknowns"``,
        ``"floor"`` or ``"room"``; empty if every impact uses it.
    group, name : str
        Namelist group and name.
    kind : str
        ``"real"``, ``"whole"``, ``"choice"``, ``"flag"``, ``"list"`` (of numbers), ``"text"`` or
        ``"texts"`` (a list).
    unit : str
        SI unit; empty for pure numbers.
    meaning : str
        Description.
    choices : tuple of str
        Allowed values of a choice.
    lower, upper : float or str
        Limits of the allowed range; a text is the key of the group whose value is the limit.
    whole : bool
        Whether only whole numbers are allowed.
    needs : tuple of str
        Name of a choice and its values with which the key has an effect, that of the standard ball
        first; empty: with all.
    """

    owner: str
    group: str
    name: str
    kind: Kind = "real"
    unit: str = ""
    meaning: str = ""
    choices: tuple[str, ...] = ()
    lower: float | str = -math.inf
    upper: float | str = math.inf
    whole: bool = False
    needs: tuple[str, ...] = ()


class Group(Plain):
    """Base of the dataclasses whose fields are keys, or groups of them."""

    def __new__(cls, *_: object, **keywords: object) -> Self:
        """Raise InputError if a keyword is not a field."""
        names = [field.name for field in fields(cls)]  # type: ignore[arg-type]
        for word in keywords:
            if word not in names:
                refuse_keyword(f"{cls.__name__}()", word, names)
        return super().__new__(cls)

    def __post_init__(self) -> None:
        """Make a number or a text a list of one where a list is needed.

        Raise InputError if a list that has a default is empty.
        """
        super().__post_init__()
        for option in fields(self):  # type: ignore[arg-type]
            value = getattr(self, option.name)
            if not isinstance(option.default, tuple):
                continue
            if isinstance(value, int | float | str):
                object.__setattr__(self, option.name, (value,))
            elif option.default and isinstance(value, tuple | list) and not value:
                refuse(f"{type(self).__name__}: {option.name} is empty", "one number or more")


def _groups(base: type[Group]) -> Iterator[type[Group]]:
    """Return the classes of groups below a base that have no class below them."""
    for group in base.__subclasses__():
        yield from _groups(group) if group.__subclasses__() else (group,)


def refuse_keyword(label: str, word: str, allowed: Iterable[str]) -> None:
    """Raise InputError for an unknown keyword; its message names the classes with that field."""
    keys = {group.__name__: [field.name for field in fields(group)] for group in _groups(Group)}  # type: ignore[arg-type]
    if owners := [name for name, names in keys.items() if word in names]:
        refuse(
            f"{label}: {word!r} is a key of {' and '.join(owners)}",
            " or ".join(f"{name}({word}=...)" for name in owners),
        )
    also = [near for name, names in keys.items() for near in (name.lower(), *names)]
    refuse_unknown(label, [word], allowed, also)
