"""Checks of arguments."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NoReturn, get_args

import numpy as np

from thud.base.errors import InputError, WrongTypeError
from thud.base.immutable import plain
from thud.base.note import Note

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable
    from types import UnionType

    from numpy.typing import ArrayLike, NDArray

# Maximum lengths of a value, and of a text or a path, in a message; longer ones are cut.
MAX_SHOWN, MAX_TEXT = 80, 200
# Maximum magnitude of all numbers; Python does not print much larger integers.
MAX_NUMBER = 10**300
# Maximum seed of the libraries that draw random samples.
MAX_SEED = 2**32 - 1
# Maximum number of threads.
MAX_THREADS = 1024


def refuse(  # noqa: PLR0913 - the fields of a note
    problem: str,
    allowed: str,
    cause: Exception | None = None,
    *,
    name: str = "",
    subject: str = "",
    value: object = None,
    low: float = math.nan,
    high: float = math.nan,
    error: type[InputError] = InputError,
    **others: float | str,
) -> NoReturn:
    """Raise an error with a message: the name of an argument or key, its problem, the mend.

    `cause` is the exception that shows the problem, `subject` the key that would mend it, by
    default that of the name; `value`, `low` and `high` are a number and its range, `others` further
    values of the note.
    """
    others |= {"name": name, "text": f"{problem}; allowed: {allowed}"}
    number = math.nan
    if isinstance(value, int | float) and not (isinstance(value, bool) or math.isnan(low)):
        number = float(value) if abs(value) <= MAX_NUMBER else math.nan
    note = Note("refused", subject or name, number, low, high, others=others)
    raise error(str(note).lstrip(), note) from cause


def refuse_value(name: str, value: object, allowed: str, **more: Any) -> NoReturn:  # noqa: ANN401
    """Raise InputError for a value that is not allowed, or not within a range; see `refuse`."""
    refuse(f"= {shown(value)} is not allowed", allowed, name=name, value=value, **more)


def require_kind(name: str, value: object, kind: type[Any] | UnionType) -> None:
    """Raise WrongTypeError if an argument is not of a type."""
    if not isinstance(value, kind):
        expected = " or ".join(entry.__name__ for entry in get_args(kind) or (kind,))
        refuse(f"is of type {type(value).__name__}", expected, name=name, error=WrongTypeError)


def require_choice(name: str, value: object, allowed: Collection[str]) -> str:
    """Return a word; raise InputError if it is not one of the allowed words."""
    if not isinstance(value, str) or value not in allowed:
        unknown = f"= {shown(value)} is not known{suggestion(value, allowed)}"
        refuse(unknown, ", ".join(map(repr, allowed)), name=name)
    return str(value)


def require_mapping(name: str, value: object, entries: str) -> None:
    """Raise InputError if an argument is not a mapping with names as keys, or is empty."""
    if not isinstance(value, Mapping) or not value:
        refuse(f"{name} are not stated", f"a mapping of names to one or more {entries}")


def suggestion(word: object, known: Collection[str]) -> str:
    """Return the end of a message that suggests the known word closest to a misspelled one.

    >>> suggestion("heigth", ["gravity", "height"])
    " (did you mean 'height'?)"
    """
    import difflib

    by_small = {name.lower(): name for name in known}
    if not isinstance(word, str) or len(word) > MAX_SHOWN:
        return ""
    close = difflib.get_close_matches(word.lower(), by_small, 1, cutoff=0.7)
    return f" (did you mean {by_small[close[0]]!r}?)" if close else ""


def require_array(
    name: str, values: ArrayLike, dimensions: Collection[int], kinds: str = ""
) -> NDArray[Any]:
    """Return an array, of real numbers as float64 if `kinds` states which NumPy has for them.

    Raise InputError if it is ragged or masked, or if `ndim` or the kind is not allowed.
    """
    try:
        array = np.asarray(values)
    except (TypeError, ValueError):  # rows of different length
        array = np.empty((0,) * 9)
    is_other_kind = kinds and array.size and array.dtype.kind not in kinds
    if array.ndim not in dimensions or is_other_kind or np.ma.is_masked(values):
        allowed = f"{' or '.join(map(str, dimensions))} dimensions of real numbers, none masked"
        refuse(f"{name} is not an array of numbers", allowed)
    return np.asarray(array, dtype=np.float64, order="C") if kinds else array


def require_pair(
    name: str, values: object, allowed: str = "two finite numbers",
    low: float = -MAX_NUMBER, high: float = MAX_NUMBER,
) -> tuple[float, float]:  # fmt: skip
    """Return two numbers from low to high; raise InputError if the values are not `allowed`."""
    pair = plain(values)
    if not isinstance(pair, tuple) or len(pair) != 2:  # noqa: PLR2004
        refuse_value(name, values, allowed)
    first, last = (require_number(name, value, low, high) for value in pair)
    return first, last


def require_whole(name: str, value: Any, low: int, high: int) -> int:  # noqa: ANN401
    """Return a whole number from low to high; raise InputError if a value is none."""
    whole = plain(value)
    if type(whole) is not int or not low <= whole <= high:
        refuse_value(name, value, f"whole numbers from {low} to {high}")
    return whole


def thread_count(name: str, threads: int | None) -> int:
    """Return a number of threads after a check; if it is None, that of the process's processors."""
    if threads is None:
        # Windows states all processors.
        own = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
        threads = min(own or 1, MAX_THREADS)
    return require_whole(name, threads, 1, MAX_THREADS)


def require_number(
    name: str, value: object, low: float = -MAX_NUMBER, high: float = MAX_NUMBER, unit: str = ""
) -> float:
    """Return a number; raise InputError if a value is none from low to high, in a unit."""
    number = plain(value)
    if type(number) not in {int, float} or not low <= number <= high:
        if high == MAX_NUMBER:
            refuse_value(name, value, "finite numbers")
        refuse_value(name, value, f"{low:g} to {high:g} {unit}".rstrip(), low=low, high=high)
    return float(number)


def shown(value: object) -> str:
    """Return the text of a value for a message; of long ones, both ends."""
    if isinstance(value, int) and abs(value) > MAX_NUMBER:
        return "a very large number"
    if isinstance(value, np.generic):
        value = value.item()  # its repr names the type
    # Objects store the lists of files as tuples.
    return shown_text(repr(list(value) if type(value) is tuple else value), MAX_SHOWN)


def shown_text(text: object, limit: int = MAX_TEXT) -> str:
    """Return text of a file or a library, or a path, for a message: printable, in one line.

    Of long texts both ends are shown.
    """
    line = " ".join(str(text).split())
    if len(line) > limit:
        line = f"{line[: limit // 2]} ... {line[-limit // 2 :]}"
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in line)


def refuse_unknown(label: str, words: Iterable[str], known: Iterable[str]) -> None:
    """Raise InputError for an unknown word; its message suggests a known one."""
    allowed = list(known)
    for word in words:
        if word not in allowed:
            hint = suggestion(word, allowed)
            refuse(f"{label}: {shown(word)} is not known{hint}", ", ".join(allowed))
