"""Bases of the public types, frozen dataclasses whose arrays are read-only."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Immutable:
    """Base of results: arrays, also those in tuples and dictionaries, are read-only.

    Arrays that can be changed are copied, read-only ones are shared; lists become tuples.
    """

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        for name, value in vars(self).items():
            object.__setattr__(self, name, _read_only(value))


class Plain:
    """Base of inputs: lists and arrays become tuples, and NumPy's scalars Python's, as in files."""

    def __post_init__(self) -> None:
        """Store plain values."""
        for name, value in vars(self).items():
            object.__setattr__(self, name, plain(value))


def freeze(array: NDArray[Any]) -> NDArray[Any]:
    """Make an array read-only, and return it."""
    array.setflags(write=False)
    return array


def _read_only(value: Any) -> Any:  # noqa: ANN401 - values of any kind
    if isinstance(value, np.ndarray) and value.flags.writeable:
        value = freeze(value.copy())
    if isinstance(value, list | tuple):
        entries = map(_read_only, value)
        return value._make(entries) if hasattr(value, "_make") else tuple(entries)
    if type(value) is dict:
        return {key: _read_only(entry) for key, entry in value.items()}
    return value


def plain(value: Any) -> Any:  # noqa: ANN401 - values of any kind
    """Return a value with tuples in place of lists and arrays, and numbers of Python."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    return tuple(map(plain, value)) if isinstance(value, list | tuple) else value
