"""Base of the public types, with read-only arrays and comparison by value."""

from __future__ import annotations

import sys
from dataclasses import fields, is_dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

Array = TypeVar("Array", bound="NDArray[Any]")


class Immutable:
    """Base of frozen dataclasses, which are declared with ``eq=False``.

    Arrays, also those in tuples, dictionaries and datasets, are read-only: arrays that can be
    changed are copied, read-only ones are shared. Lists become tuples. Objects are equal if their
    class and fields are equal; NaN equals NaN. The hash is the hash of the fields, so objects that
    hold an array or a dictionary have none.
    """

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        for name, value in vars(self).items():
            object.__setattr__(self, name, self._stored(value))

    def _stored(self, value: Any) -> Any:  # noqa: ANN401 - values of any kind
        """Return the stored form of a value; columns of tables become arrays."""
        if type(value) in {list, tuple}:
            return tuple(map(self._stored, value))
        if type(value) is dict:
            return {key: self._stored(entry) for key, entry in value.items()}
        # If xarray is not imported, no dataset exists.
        if (xarray := sys.modules.get("xarray")) and isinstance(value, xarray.Dataset):
            value = value.copy(deep=True)
            for name in value.variables.keys() - value.indexes.keys():
                freeze(value[name].values)
        elif hasattr(value, "__array__") and not isinstance(value, np.generic):
            return self._stored_array(np.asarray(value))
        return value

    def _stored_array(self, array: NDArray[Any]) -> object:
        """Return an array, or a read-only copy if it, or an array that it views, can be changed."""
        owner: object = array
        while isinstance(owner, np.ndarray):
            if owner.flags.writeable:
                return freeze(array.copy())
            owner = owner.base
        return array

    def __setstate__(self, state: dict[str, object]) -> None:
        """Restore the fields of a copy or a pickle and make their arrays read-only again."""
        vars(self).update(state)
        Immutable.__post_init__(self)

    def __eq__(self, other: object) -> bool:
        """Return whether the other is of the same class and has equal fields."""
        if other.__class__ is not self.__class__:
            return NotImplemented
        return _equal(_fields(self), _fields(other))

    def __hash__(self) -> int:
        """Return the hash of the fields; raise TypeError if a field is not hashable."""
        return hash((type(self), _hashed(_fields(self))))


class Plain(Immutable):
    """Base of inputs: arrays become tuples of numbers, as in files."""

    def _stored_array(self, array: NDArray[Any]) -> object:
        return self._stored(array.tolist())


def freeze(array: Array) -> Array:
    """Make an array and the arrays that it views read-only, and return the array."""
    owner: object = array
    while isinstance(owner, np.ndarray):
        owner.setflags(write=False)
        owner = owner.base
    return array


def _fields(owner: object) -> tuple[object, ...]:
    """Return the values of the fields that are compared."""
    return tuple(getattr(owner, field.name) for field in fields(owner) if field.compare)  # type: ignore[arg-type]


def _equal(value: Any, other: Any) -> bool:  # noqa: ANN401 - values of any kind
    """Return whether two values are equal; NaN equals NaN."""
    if np.isscalar(value) and np.isscalar(other):
        return bool(value == other) or bool(value != value and other != other)  # noqa: PLR0124 - NaN
    if isinstance(value, np.ndarray) and isinstance(other, np.ndarray):
        has_nan = value.dtype.kind in "fc" and other.dtype.kind in "fc"
        return np.array_equal(value, other, equal_nan=has_nan)
    if type(value) is not type(other):
        return False
    if is_dataclass(value):
        value, other = _fields(value), _fields(other)
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
