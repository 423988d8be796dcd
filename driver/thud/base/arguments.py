"""Check of the arguments of public functions by their annotations."""

from __future__ import annotations

import ast
import inspect
import os
from collections.abc import Iterable, Mapping
from functools import cache, wraps
from typing import TYPE_CHECKING, Any, Literal, ParamSpec, TypeVar, get_origin

import numpy as np

from thud.base import _schema
from thud.base.checks import refuse_value
from thud.base.key import Group, require_keywords

if TYPE_CHECKING:
    from collections.abc import Callable

P = ParamSpec("P")
R = TypeVar("R")

# Types of arguments by their names in annotations.
_TYPES: dict[str, tuple[type, ...]] = {
    "None": (type(None),), "float": (float, int), "int": (int,), "bool": (bool,), "str": (str,),
    "os.PathLike": (os.PathLike,), "Mapping": (Mapping,), "Iterable": (Iterable,),
    "Sequence": (Iterable,),
}  # fmt: skip
_WORDS = {"float": "a number", "int": "a whole number", "bool": "True or False", "str": "a text"}


def check_arguments(function: Callable[P, R]) -> Callable[P, R]:
    """Decorate a function so that it raises InputError for an unknown keyword or a wrong type.

    Types are checked where all types of an annotation are known, see `_known_types`; scalars of
    NumPy become those of Python.
    """
    parameters = inspect.signature(function).parameters
    allowed, label = list(parameters), f"{function.__name__}()"
    annotations = {name: entry.annotation for name, entry in parameters.items()}

    @cache
    def known_types(name: str) -> tuple[type, ...]:
        entry = annotations.get(name)
        names = function.__globals__
        return _known_types(entry, names) if isinstance(entry, str) else ()

    def plain(name: str, value: Any) -> Any:  # noqa: ANN401 - of a user
        types = known_types(name)
        if isinstance(value, np.generic | np.ndarray) and types and not value.shape:
            value = value.item()
        is_number = not isinstance(value, bool) or bool in types
        if types and not (isinstance(value, types) and is_number):
            expected = annotations[name].split(" | ")
            words = " or ".join(_WORDS.get(kind, kind) for kind in expected if kind != "None")
            refuse_value(f"{label}: {name}", value, words)
        return value

    @wraps(function)
    def checked(*arguments: P.args, **keywords: P.kwargs) -> R:
        require_keywords(label, keywords, allowed)
        positional = map(plain, [*allowed, *[""] * len(arguments)], arguments)
        named = {name: plain(name, value) for name, value in keywords.items()}
        return function(*positional, **named)

    return checked


def _known_types(annotation: str, names: Mapping[str, object]) -> tuple[type, ...]:
    """Return the types that an annotation allows; none if one of them is not known.

    Known are those of `_TYPES`, of the schema, and of the names of the module.
    """
    result: list[type] = []
    for part in _members(ast.parse(annotation, mode="eval").body):
        name = ast.unparse(part.value if isinstance(part, ast.Subscript) else part)
        entry = names.get(name) or vars(_schema).get(name)
        if name in _TYPES:
            result += _TYPES[name]
        elif isinstance(entry, type) and (name in names or issubclass(entry, Group)):
            result.append(entry)
        elif get_origin(entry) is Literal:
            result.append(str)
        else:
            return ()
    return tuple(result)


def _members(node: ast.expr) -> list[ast.expr]:
    """Return the members of a union of types."""
    if not isinstance(node, ast.BinOp):
        return [node]
    return [*_members(node.left), *_members(node.right)]
