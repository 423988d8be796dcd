"""Check of the arguments of public functions by their annotations."""

from __future__ import annotations

import inspect
import os
import re
from collections.abc import Iterable, Mapping
from functools import cache, wraps
from itertools import zip_longest
from typing import TYPE_CHECKING, Any, Literal, ParamSpec, TypeVar, get_origin

import numpy as np

from thud.base import _schema
from thud.base.checks import refuse_value
from thud.base.key import refuse_keyword

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
    annotations = {name: str(entry.annotation) for name, entry in parameters.items()}
    label = f"{function.__name__}()"

    @cache
    def expect(name: str) -> tuple[list[str], tuple[type, ...]]:
        annotation = annotations.get(name, "")
        while "[" in annotation:
            annotation = re.sub(r"\[[^\[\]]*\]", "", annotation)
        expected = annotation.split(" | ")
        return expected, _known_types(expected, function.__globals__)

    def plain(name: str, value: Any) -> Any:  # noqa: ANN401 - of a user
        expected, types = expect(name)
        if isinstance(value, np.generic | np.ndarray) and types and not value.shape:
            value = value.item()
        is_number = not isinstance(value, bool) or bool in types
        if types and not (isinstance(value, types) and is_number):
            words = " or ".join(_WORDS.get(kind, kind) for kind in expected if kind != "None")
            refuse_value(f"{label}: {name}", value, words)
        return value

    @wraps(function)
    def checked(*arguments: P.args, **keywords: P.kwargs) -> R:
        for word in keywords.keys() - annotations:
            refuse_keyword(label, word, annotations)
        names = list(annotations)[: len(arguments)]
        positional = [plain(*entry) for entry in zip_longest(names, arguments, fillvalue="")]
        named = {name: plain(name, value) for name, value in keywords.items()}
        return function(*positional, **named)

    return checked


def _known_types(expected: Iterable[str], names: Mapping[str, object]) -> tuple[type, ...]:
    """Return the types of names in an annotation; none if one of them is not known.

    Known are those of `_TYPES`, of the schema, and of the names of the module.
    """
    result: list[type] = []
    for name in expected:
        entry = names.get(name) or vars(_schema).get(name)
        if name in _TYPES:
            result += _TYPES[name]
        elif isinstance(entry, type):
            result.append(entry)
        elif get_origin(entry) is Literal:
            result.append(str)
        else:
            return ()
    return tuple(result)
