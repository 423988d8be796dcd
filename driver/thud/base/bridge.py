"""All calls of the Fortran library.

Bundles of the library become dictionaries, and its status codes become exceptions.
"""

from __future__ import annotations

import math
import re
import threading
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from thud import _core
from thud.base.errors import InputError, NumericalError
from thud.base.note import Note

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    # Texts, numbers, arrays and dictionaries of them, by name.
    Bundle = dict[str, Any]

api = _core.thud_api

# The status of an interrupt is this number plus the number of the signal.
_INTERRUPTED = 128
# Units at the ends of the names of columns.
_UNIT = re.compile("_(m|s|N|J|Hz|Pa|dB|m_per_s|m_per_Ns|s_kg)$")
_ERRORS = {error.exit_code: error for error in (InputError, NumericalError)}


def ask(question: str, /, **request: str | bytes | float | NDArray[np.float64]) -> Bundle:
    """Ask the library a question of `thud_answer`; return its answer.

    The answer holds texts, numbers and arrays by name; items named ``group.name`` are in a
    dictionary for each group. An interrupt ends the computation early: the main thread runs the
    signal handlers and asks again if they raise nothing; other threads raise KeyboardInterrupt.
    Raise InputError or NumericalError with the message of the library.
    """
    packed = _packed(request)
    while (answer := api.ask(question, *packed))[0] > _INTERRUPTED:
        api.collect(*answer[1:])
        if threading.current_thread() is not threading.main_thread():
            raise KeyboardInterrupt
    return _collect(*answer)


def _packed(
    request: Mapping[str, str | bytes | float | NDArray[np.float64]],
) -> tuple[str, bytes, NDArray[np.float64]]:
    """Return header, texts and values of a request; arrays are flattened in Fortran order."""
    header = ""
    texts = b""
    arrays = []
    count = 0
    for name, value in request.items():
        if isinstance(value, str | bytes):
            encoded = value.encode(errors="surrogateescape") if isinstance(value, str) else value
            header += f"{name}\t{len(texts) + 1} {len(encoded)}\n"
            texts += encoded
        else:
            size = value.size if isinstance(value, np.ndarray) else 1
            header += f"{name}\t{count + 1} {size}\n"
            arrays.append((slice(count, count + size), value))
            count += size
    values = np.zeros(max(1, count))  # f2py does not pass empty arrays
    for span, value in arrays:
        values[span] = value.ravel(order="F") if isinstance(value, np.ndarray) else value
    return header, texts, values


def _collect(status: int, handle: int, n_byte: int, n_value: int) -> Bundle:
    """Return the answer that the library holds under a handle; see `ask`."""
    data, values = api.collect(handle, n_byte, n_value)
    header, _, texts = data.tobytes().partition(b"\0")
    answer: Bundle = {}
    at = {"text": 0, "values": 0}
    for group, name, extents, length in _items(header):
        items = answer.setdefault(group, {}) if group else answer
        if extents is None:
            items[name] = texts[at["text"] : at["text"] + length]
            at["text"] += length
        else:
            chunk = values[at["values"] : at["values"] + length]
            items[name] = chunk.reshape(extents, order="F") if extents else float(chunk[0])
            at["values"] += length
    if status:
        kind = _ERRORS.get(status, NumericalError)
        raise kind(text(answer["message"]), _refused(answer) if "group" in answer else None)
    return answer


def _refused(answer: Bundle) -> Note:
    """Return what an error of the library is about."""
    subject = ".".join(text(answer[name]) for name in ("group", "key") if answer[name])
    value, low, high, low_open, high_open = answer.get("range", [math.nan] * 3 + [0.0] * 2)
    others = {"name": _name(subject), "text": text(answer["problem"])}
    others |= {"low_open": low_open, "high_open": high_open}
    return Note("refused", subject, value, low, high, others=others)


def _name(subject: str) -> str:
    """Return how messages of the library call a group, or a group and a key."""
    group, _, key = subject.partition(".")
    return f"&{group}: {key}".rstrip()


@lru_cache(maxsize=64)
def _items(header: bytes) -> list[tuple[str, str, tuple[int, ...] | None, int]]:
    """Return group, name, extents and length of each item of a header; texts have no extents."""
    items: list[tuple[str, str, tuple[int, ...] | None, int]] = []
    for line in header.decode().splitlines():
        full, _, form = line.partition("\t")
        group, _, name = full.rpartition(".")
        if form.startswith("t"):
            items.append((group, name, None, int(form[1:])))
            continue
        extents = tuple(int(extent) for extent in form.split(",") if extent)
        items.append((group, name, extents, math.prod(extents)))
    return items


def text(value: bytes) -> str:
    """Return the text in bytes of the library; invalid UTF-8 becomes surrogate escapes."""
    return value.decode(errors="surrogateescape")


def notes(group: Mapping[str, Any]) -> tuple[Note, ...]:
    """Return the warnings in a group of an answer, if there are any."""
    if not group:
        return ()
    words = (text(group[name]).split("\n") for name in ("code", "subject", "text"))
    # Equal notes have the same NaN.
    numbers = (
        [math.nan if math.isnan(value) else float(value) for value in group[name]]
        for name in ("value", "low", "high")
    )
    return tuple(
        Note(code, subject, value, low, high, others={"name": _name(subject), "text": said})
        for code, subject, said, value, low, high in zip(*words, *numbers, strict=True)
    )


def without_units(columns: Mapping[str, Any]) -> dict[str, Any]:
    """Return the columns of a table of the library by their names without units."""
    return {_UNIT.sub("", name): values for name, values in columns.items()}


def version() -> str:
    """Return the version of the library."""
    return text(ask("library")["version"])


def compiler() -> str:
    """Return the compiler of the library and its options, except options with paths."""
    return re.sub(r" (-[IJ] ?)?\S*/\S*", "", text(ask("library")["compiler"]))


def progress() -> float:
    """Return the completed fraction, 0 to 1, of the latest long computation of this process."""
    return float(api.get_progress())
