"""All calls of the Fortran library: its bundles become dictionaries, its statuses exceptions."""

from __future__ import annotations

import math
import re
import threading
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

    The answer has texts, numbers and arrays by name; items named ``group.name`` are in a
    dictionary for each group. Bytes of texts that are not UTF-8 become surrogate escapes. An
    interrupt ends the computation early: the main thread runs the signal handlers and asks again if
    they raise nothing; other threads raise KeyboardInterrupt. Raise InputError or NumericalError
    with the message of the library.
    """
    header, texts = "", b""
    count, arrays = 0, [np.zeros(0)]
    for name, value in request.items():
        if isinstance(value, str | bytes):
            content = value.encode(errors="surrogateescape") if isinstance(value, str) else value
            header += f"{name}\t{len(texts) + 1} {len(content)}\n"
            texts += content
        else:
            arrays.append(np.ravel(value, order="F"))
            header += f"{name}\t{count + 1} {len(arrays[-1])}\n"
            count += len(arrays[-1])
    # f2py does not pass empty arrays.
    values = np.concatenate(arrays) if count else np.zeros(1)
    while (answer := api.ask(question, header, texts, values))[0] > _INTERRUPTED:
        api.collect(*answer[1:])
        if threading.current_thread() is not threading.main_thread():
            raise KeyboardInterrupt
    return _collect(*answer)


def _collect(status: int, handle: int, n_byte: int, n_value: int) -> Bundle:
    """Return the answer that the library holds under a handle; see `ask`."""
    data, values = api.collect(handle, n_byte, n_value)
    header, _, texts = data.tobytes().partition(b"\0")
    answer: Bundle = {}
    for line in header.decode().splitlines():
        full, _, form = line.partition("\t")
        group, _, name = full.rpartition(".")
        items = answer.setdefault(group, {}) if group else answer
        if form.startswith("t"):
            length = int(form[1:])
            items[name] = texts[:length].decode(errors="surrogateescape")
            texts = texts[length:]
        else:
            extents = [int(extent) for extent in form.split(",") if extent]
            length = math.prod(extents)
            array = values[:length].reshape(extents, order="F")
            items[name] = array if extents else float(array)
            values = values[length:]
    if status:
        note = None
        if "group" in answer:
            *numbers, low_open, high_open = answer.get("range", [math.nan] * 3 + [0.0] * 2)
            subject = f"{answer['group']}.{answer['key']}".rstrip(".")
            note = _note(
                "refused", subject, answer["problem"], *numbers, low_open=low_open,
                high_open=high_open,
            )  # fmt: skip
        raise _ERRORS.get(status, NumericalError)(answer["message"], note)
    return answer


def notes(group: Mapping[str, Any]) -> tuple[Note, ...]:
    """Return the warnings in a group of an answer, if there are any."""
    if not group:
        return ()
    words = (group[name].split("\n") for name in ("code", "subject", "text"))
    numbers = (group[name] for name in ("value", "low", "high"))
    return tuple(map(_note, *words, *numbers))


def _note(code: str, subject: str, text: str, *numbers: float, **others: float) -> Note:
    """Return a note on a key, ``"group.key"``, or a group of the library."""
    # Equal notes have the same NaN.
    value, low, high = (math.nan if math.isnan(number) else float(number) for number in numbers)
    name, _, key = subject.partition(".")
    words: dict[str, float | str] = {"name": f"&{name}: {key}".rstrip(), "text": text}
    return Note(code, subject, value, low, high, others=words | others)


def without_units(columns: Mapping[str, Any]) -> dict[str, Any]:
    """Return the columns of a table of the library by their names without units."""
    return {_UNIT.sub("", name): values for name, values in columns.items()}


def version() -> str:
    """Return the version of the library."""
    return str(ask("library")["version"])


def compiler() -> str:
    """Return the compiler of the library and its options, except options with paths."""
    return re.sub(r" (-[IJ] ?)?\S*/\S*", "", ask("library")["compiler"])
