"""Measured drops on disk, from which an interrupted measurement continues."""

from __future__ import annotations

import dataclasses
import hashlib
import io
import pickle
import sys
import time
import warnings
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from thud.base.bridge import version
from thud.base.errors import InputError, ReportWarning
from thud.base.files import is_regular, replace_file, uninterrupted
from thud.recordings.measured_drop import Drop

if TYPE_CHECKING:
    import os
    from types import TracebackType

    from thud.recordings.config import Config
    from thud.recordings.signal import Signal

# Measured drops are written at intervals of this, s: a crash loses no more.
INTERVAL = 5.0
PREFIX, SUFFIX = ".measured-", ".part"
# Names from NumPy that the pickle of an array refers to.
NUMPY = {"_reconstruct", "_frombuffer", "scalar", "ndarray", "dtype"}


class Checkpoint:
    """Measured drops, stored in a directory while others are measured; a context manager.

    Each file holds drops of one signal and one configuration, whose digest is in its name. The exit
    removes the opened files, and the directory if it is empty, unless the process is interrupted,
    killed, or fails for a reason other than its input.

    Parameters
    ----------
    folder
        Directory of the files, made if needed; None stores nothing.
    """

    def __init__(self, folder: str | os.PathLike[str] | None) -> None:
        self.folder = None if folder is None else Path(folder)
        self._new: dict[int, Drop] = {}
        self._digest = ""
        self._digests: set[str] = set()
        self._written = time.monotonic()

    def __enter__(self) -> Self:
        """Return the checkpoint."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Remove the files, or write the last drops if a repeated call may continue from them."""
        if self.folder is None:
            return
        if kind is not None and not issubclass(kind, InputError):
            try:
                self._write()
            except OSError as failure:
                message = (
                    f"{self.folder}: the last drops are not stored ({failure.strerror}); the next "
                    "call measures them again"
                )
                warnings.warn(message, ReportWarning, stacklevel=2)
            return
        # Files of other signals belong to another measurement.
        files = [file for digest in self._digests for file in self._files(digest)]
        with uninterrupted():
            for path in files:
                path.unlink(missing_ok=True)
        if files:
            with suppress(OSError):  # it holds something else
                self.folder.rmdir()

    def open(self, signal: Signal, config: Config) -> dict[int, Drop]:
        """Return the drops of a signal that were measured before, by their first sample."""
        if self.folder is None:
            return {}
        self._write()
        identity = "\n".join(map(str, (version(), signal.checksum, signal.name, config)))
        self._digest = hashlib.sha256(identity.encode("utf-8", "surrogateescape")).hexdigest()[:32]
        self._digests.add(self._digest)
        drops: dict[int, Drop] = {}
        for path in self._files(self._digest):
            drops |= _read(path)
        return drops

    def _files(self, digest: str) -> list[Path]:
        files = self.folder.glob(f"{PREFIX}{digest}-*{SUFFIX}") if self.folder else ()
        return sorted(filter(is_regular, files))

    def add(self, start: int, drop: Drop) -> None:
        """Store a drop by its first sample; it is on disk after some seconds."""
        if self.folder is None:
            return
        self._new[start] = drop
        if time.monotonic() - self._written > INTERVAL:
            self._write()

    def _write(self) -> None:
        self._written = time.monotonic()
        if self.folder is None or not self._new:
            return
        self.folder.mkdir(parents=True, exist_ok=True)
        path = self.folder / f"{PREFIX}{self._digest}-{min(self._new)}{SUFFIX}"
        replace_file(path, pickle.dumps(self._new))
        self._new = {}


def _read(path: Path) -> dict[int, Drop]:
    """Return the drops of a file, none if it is damaged or of another kind."""
    try:
        content = _DataOnly(io.BytesIO(path.read_bytes())).load()
    except Exception:  # noqa: BLE001 - a damaged pickle raises anything; its drops are measured again
        return {}
    valid = isinstance(content, dict) and all(isinstance(drop, Drop) for drop in content.values())
    return content if valid else {}


class _DataOnly(pickle.Unpickler):
    """Unpickler that creates only dataclasses of thud and arrays."""

    def find_class(self, module: str, name: str) -> Any:  # noqa: ANN401 - a class
        """Return a class; raise UnpicklingError if its instances are not data."""
        result = super().find_class(module, name) if module in sys.modules else None
        is_dataclass = module.startswith("thud.") and dataclasses.is_dataclass(result)
        if not is_dataclass and not (module.partition(".")[0] == "numpy" and name in NUMPY):
            message = f"{module}.{name} is no data"
            raise pickle.UnpicklingError(message)
        return result
