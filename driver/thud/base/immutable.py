"""Base of the public types, with read-only arrays and comparison by value."""

from __future__ import annotations

import sys
from dataclasses import fields
from typing import TYPE_CHECKING, Any, TypeVar
from weakref import WeakValueDictionary

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray


Array = TypeVar("Array", bound="NDArray[Any]")

# Arrays that `freeze` has made read-only, by identity; others may change through another view.
_FROZEN: WeakValueDictionary[int, NDArray[Any]] = WeakValueDictionary()


class Immutable:
    """Base of frozen dataclasses, which are declared with ``eq=False``.

    Arrays, also those in tuples, dictionaries and datasets, are read-only copies; lists become
    tuples. Objects are equal if their class and fields are equal; NaN equals NaN. The hash is the
    hash of the fields, so objects that hold an array or a dictionary have none.
    """

    def __post_init__(self) -> None:
        """Copy the arrays."""
        for name, value in vars(self).items():
            object.__setattr__(self, name, _stored(value, self._store_array))

    @staticmethod
    def _store_array(array: NDArray[Any]) -> object:
        """Return the stored form of an array."""
        return array if _is_frozen(array) else freeze(array.copy())

    def __setstate__(self, state: dict[str, object]) -> None:
        """Restore the fields of a copy or a pickle and make their arrays read-only again."""
        vars(self).update(state)
        Immutable.__post_init__(self)

    def __eq__(self, other: object) -> bool:
        """Return whether the other is of the same class and has equal fields."""
        if other.__class__ is not self.__class__:
            return NotImplemented
        return all(map(_equal, _fields(self), _fields(other)))

    def __hash__(self) -> int:
        """Return the hash of the fields; raise TypeError if a field is not hashable."""
        return hash((type(self), *map(_hashed, _fields(self))))


class Plain(Immutable):
    """Base of inputs: arrays become tuples of numbers, as in files."""

    @staticmethod
    def _store_array(array: NDArray[Any]) -> object:
        return _stored(array.tolist(), freeze)


def freeze(array: Array) -> Array:
    """Make an array and the arrays that it views read-only, and return the array.

    Immutable objects store a frozen array and its views without a copy.
    """
    owner: object = array
    while isinstance(owner, np.ndarray):
        owner.setflags(write=False)
        _FROZEN[id(owner)] = owner
        owner = owner.base
    return array


def _is_frozen(array: NDArray[Any]) -> bool:
    """Return whether `freeze` has made an array, or the array that it views, read-only."""
    owner = array if array.base is None else array.base
    return _FROZEN.get(id(owner)) is owner and not (array.flags.writeable or owner.flags.writeable)


def _stored(value: object, store_array: Callable[[NDArray[Any]], object]) -> object:
    """Return the stored form of a value."""
    if isinstance(value, np.ndarray):
        return store_array(value)
    if type(value) is dict:
        return {key: _stored(entry, store_array) for key, entry in value.items()}
    if isinstance(value, tuple) and hasattr(value, "_make"):
        return value._make(_stored(entry, store_array) for entry in value)
    if type(value) in {list, tuple}:
        return tuple(_stored(entry, store_array) for entry in value)  # type: ignore[attr-defined]
    return _stored_table(value, store_array)


def _stored_table(value: object, store_array: Callable[[NDArray[Any]], object]) -> object:
    """Return a copy of a dataset, the stored array of an array-like object, or another value."""
    # If xarray is not imported, no dataset exists.
    xarray = sys.modules.get("xarray")
    if xarray is not None and isinstance(value, xarray.Dataset):
        dataset = value.copy(deep=True)
        for name, variable in dataset.variables.items():
            if name not in dataset.indexes:
                freeze(variable.values)
        return dataset
    # Columns of tables, such as those of pandas.
    if hasattr(value, "__array__") and not isinstance(value, np.generic):
        return store_array(np.array(value))
    return value


def _fields(owner: object) -> list[object]:
    """Return the values of the fields that are compared."""
    return [getattr(owner, field.name) for field in fields(owner) if field.compare]  # type: ignore[arg-type]


def _equal(value: Any, other: Any) -> bool:  # noqa: ANN401 - values of any kind
    """Return whether two values are equal; NaN equals NaN."""
    if np.isscalar(value) and np.isscalar(other):
        return bool(value == other) or bool(value != value and other != other)  # noqa: PLR0124 - NaN
    if isinstance(value, np.ndarray) and isinstance(other, np.ndarray):
        has_nan = value.dtype.kind in "fc" and other.dtype.kind in "fc"
        return np.array_equal(value, other, equal_nan=has_nan)
    if type(value) is not type(other):
        return False
    if isinstance(value, dict):
        return value.keys() == other.keys() and all(_equal(value[key], other[key]) for key in value)
    if isinstance(value, tuple):
        return len(value) == len(other) and all(map(_equal, value, other))
    return bool(value.equals(other) if hasattr(value, "equals") else value == other)


def _hashed(value: object) -> object:
    """Return a value with equal hashes for equal values; hashes of NaN differ between objects."""
    if isinstance(value, tuple):
        return tuple(map(_hashed, value))
    return "nan" if np.isscalar(value) and value != value else value  # noqa: PLR0124
