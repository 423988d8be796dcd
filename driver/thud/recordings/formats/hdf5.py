"""HDF5, NetCDF 4 and MATLAB 7.3 by h5py."""

from __future__ import annotations

import os
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from thud.base.checks import refuse, shown_text
from thud.base.extras import library
from thud.recordings.formats import Channel, guarded
from thud.recordings.formats.variables import Header, Vector, channels_of, header_entry, vectors_of

if TYPE_CHECKING:
    from collections.abc import Collection
    from pathlib import Path

    from numpy.typing import NDArray

# Files are read without a lock, which some file systems of networks do not have.
LOCKING = False
# Maximum size of a header value, bytes.
MAX_VALUE = 4096
# Factor and offset of NetCDF, which are applied, and their defaults.
SCALING = {"scale_factor": 1.0, "add_offset": 0.0}
# Name under which MATLAB stores the contents of cells.
CELLS = "#refs#"
# MATLAB classes that are stored as numbers but are no recordings.
MATLAB_OTHERS = {b"cell", b"struct", b"function_handle", b"canonical empty"}


def _read(
    path: Path, key: str, scaling: dict[str, float], index: tuple[int | slice, ...]
) -> NDArray[np.float64]:
    h5py = library("h5py", "recordings")
    with guarded(path, "HDF5"), h5py.File(os.fsencode(path), "r", locking=LOCKING) as file:
        values = np.asarray(file[key][index], dtype=np.float64)
    return values * scaling["scale_factor"] + scaling["add_offset"]


def read_channels(path: Path) -> list[Channel]:
    """Return the numeric vectors of a file, and the columns of its slender matrices.

    Links to other files are not followed.
    """
    h5py = library("h5py", "recordings")
    name = shown_text(path)
    vectors: list[Vector] = []
    header: Header = []

    def visit(key: str, entry: Any) -> None:  # noqa: ANN401 - of the library
        if key.startswith(CELLS):
            return
        matlab_class = entry.attrs.get("MATLAB_class")
        is_dataset = isinstance(entry, h5py.Dataset)
        scaling = _scaling(entry) if is_dataset else {}
        header.extend(_attributes(h5py, f"{key}/".lstrip("/"), entry, scaling))
        if not is_dataset or entry.shape is None:
            return
        read = partial(_read, path, key, SCALING | scaling)
        if matlab_class == b"char":
            header.append((key, "".join(map(chr, entry[()].ravel()[:MAX_VALUE]))))
        elif matlab_class in MATLAB_OTHERS:
            return
        elif found := vectors_of(key, entry.dtype.kind, entry.shape, read):
            if entry.is_virtual or entry.external:
                refuse(f"{name}: {shown_text(key)}: is stored in another file", "the other file")
            vectors.extend(found)
        elif _is_header(h5py, entry):
            header.append(header_entry(key, entry[()]))

    with h5py.File(os.fsencode(path), "r", locking=LOCKING) as file:
        visit("", file)
        file.visititems(visit)
        return channels_of(vectors, header, name)


def _scaling(dataset: Any) -> dict[str, float]:  # noqa: ANN401 - of the library
    """Return the factor and the offset of a dataset that are applied: finite, the factor not 0."""
    values = {key: np.asarray(dataset.attrs[key]) for key in SCALING if key in dataset.attrs}
    return {
        key: value.item()
        for key, value in values.items()
        if value.size == 1 and value.dtype.kind in "iuf" and np.isfinite(value).all()
        and (value.any() or key == "add_offset")
    }  # fmt: skip


def _attributes(
    h5py: Any, owner: str, entry: Any, applied: Collection[str]  # noqa: ANN401 - of a library
) -> Header:  # fmt: skip
    """Return the attributes of an object that are numbers or texts and are not applied."""
    header = []
    for key in entry.attrs:
        if key not in applied and _is_header(h5py, entry.attrs.get_id(key)):
            value = entry.attrs[key]
            is_empty = isinstance(value, h5py.Empty)
            header.append(header_entry(owner + key.replace("/", " "), [] if is_empty else value))
    return header


def _is_header(h5py: Any, entry: Any) -> bool:  # noqa: ANN401 - a library
    """Whether an attribute or a dataset is some numbers or texts of limited size."""
    is_text = h5py.check_string_dtype(entry.dtype) is not None
    size = 1 if entry.shape is None else np.prod(entry.shape, dtype=object)
    return (entry.dtype.kind in "iufSU" or is_text) and size * entry.dtype.itemsize <= MAX_VALUE
