"""The one place where Python meets the Fortran library.

Bundles of the library become dictionaries, its status codes exceptions.
"""

from __future__ import annotations

import math
import re
import threading
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from thud import _core
from thud.base.errors import InputError, NumericalError

if TYPE_CHECKING:
    from collections.abc import Callable

    # By name: text, number, array, or more of them.
    Bundle = dict[str, Any]

api = _core.thud_api
floor_api = _core.thud_floor_api
level_api = _core.thud_level_api
ensemble_api = _core.thud_ensemble_api
mobility_api = _core.thud_mobility_api

# The status of an interrupt is this plus the number of the signal.
_INTERRUPTED = 128
# Place of the status among the results of procedures that leave a bundle.
_OF_BUNDLE = -4
_ERRORS = {error.exit_code: error for error in (InputError, NumericalError)}


def call(routine: Callable[..., tuple[Any, ...]], *arguments: object) -> Bundle:
    """Call a procedure whose results are a status, a handle and sizes; return its bundle.

    It holds texts, numbers and arrays by name; those named ``group.name`` are in a dictionary for
    each group. Raise InputError or NumericalError with the message of the library.
    """
    return collect(*call_through(routine, *arguments))


def call_through(
    routine: Callable[..., tuple[Any, ...]], *arguments: object, status: int = _OF_BUNDLE
) -> tuple[Any, ...]:
    """Call a procedure whose status is the result of that number; return all results.

    An interrupt ends it early. Handlers of signals have run by then, in the main thread: where they
    have raised nothing, the work is to go on and is done again. Other threads raise
    KeyboardInterrupt.
    """
    while (results := routine(*arguments))[status] > _INTERRUPTED:
        if status == _OF_BUNDLE:
            api.collect(*results[-3:])
        if threading.current_thread() is not threading.main_thread():
            raise KeyboardInterrupt
    return results


def call_direct(routine: Callable[..., tuple[Any, ...]], *arguments: object) -> tuple[Any, ...]:
    """Call a procedure whose last two results are a status and a message; return the others.

    Raise InputError or NumericalError with the message.
    """
    *results, status, message = call_through(routine, *arguments, status=-2)
    if status:
        raise _ERRORS.get(status, NumericalError)(trimmed(message))
    return tuple(results)


def collect(status: int, handle: int, n_byte: int, n_value: int) -> Bundle:
    """Return the results that the library holds under a handle; see `call`."""
    data, values = api.collect(handle, n_byte, n_value)
    header, _, texts = data.tobytes().partition(b"\0")
    found: Bundle = {}
    at = {"text": 0, "values": 0}
    for group, name, extents, length in _items(header):
        place = found.setdefault(group, {}) if group else found
        if extents is None:
            place[name] = texts[at["text"] : at["text"] + length]
            at["text"] += length
        else:
            chunk = values[at["values"] : at["values"] + length]
            place[name] = chunk.reshape(extents, order="F") if extents else float(chunk[0])
            at["values"] += length
    if status:
        raise _ERRORS.get(status, NumericalError)(text(found["message"]))
    return found


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
    """Return a text of the library; invalid UTF-8 is kept by surrogate escapes."""
    return value.decode(errors="surrogateescape")


def trimmed(value: bytes) -> str:
    """Return a text of the library without trailing blanks."""
    return text(value).rstrip()


def version() -> str:
    """Return the version of the library."""
    return text(call(api.describe_library)["version"])


def compiler() -> str:
    """Return the compiler of the library and its options, without those that hold paths."""
    return re.sub(r" (-[IJ] ?)?\S*/\S*", "", text(call(api.describe_library)["compiler"]))


def progress() -> float:
    """Return the part of the latest long work of this process that is done, 0 to 1."""
    return float(api.get_progress())
