"""Atomic writes, and locks of directories that one run at a time may write to."""

from __future__ import annotations

import errno
import fcntl
import os
import platform
import secrets
import shutil
import signal
import threading
import time
import warnings
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from thud.errors import InputError, LockWarning

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

# Lists the files of a result directory that runs may replace, and the checksums of some.
MANIFEST = ".thud"
# Temporary name of a file in a result directory; listed too, so that it is removed after a kill.
PART = ".thud.new"
# Age at which a temporary file of another host is no longer being written, s.
_MAX_AGE = 86400.0


def lock(folder: Path, result: Path) -> int:
    """Lock a directory until the returned descriptor is closed.

    Raises
    ------
    InputError
        Where another run holds the lock; names the result that it will write.
    """
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        if not _flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB):
            _warn_unlocked(folder)
    except BlockingIOError as error:
        os.close(descriptor)
        message = f"{result} is being computed; allowed: wait, or another directory"
        raise InputError(message) from error
    return descriptor


def _flock(descriptor: int, kind: int) -> bool:
    """Lock an open file; return False where the file system has no locks."""
    try:
        fcntl.flock(descriptor, kind)
    except BlockingIOError:
        raise
    except OSError:
        return False
    return True


def _warn_unlocked(folder: Path) -> None:
    message = f"{folder}: the file system has no locks; let only one run at a time write there"
    warnings.warn(message, LockWarning, stacklevel=4)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Defer signals until a short operation is done; file libraries print errors otherwise.

    Only the main thread handles signals; others have none to defer.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    held: list[int] = []
    usual = {
        number: signal.signal(number, lambda number, _: held.append(number))
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield
    finally:
        for number, handler in usual.items():
            signal.signal(number, handler)
        if held:
            signal.raise_signal(held[0])


def replace_file(path: str | os.PathLike[str], content: bytes) -> None:
    """Write a file atomically, also over an existing one; an OSError names the path."""
    try:
        target = Path(path)
        _replace(target, content, target.with_name(f".{target.name}.part"))
    except ValueError as error:  # a path that no file system can hold
        message = f"{path!r} is not allowed; allowed: the path of a file"
        raise InputError(message) from error


def add_files(
    directory: str | os.PathLike[str], files: Mapping[str, bytes], marker: bytes | None = None
) -> None:
    """Add files, such as figures, to the results of a run.

    Contents are given by name; existing files are replaced. A later run of another input in the
    same directory removes them. The marker is the content of the file that identifies the results,
    ``effective.nml`` or ``sets.nml``; raise InputError where another run has replaced them since.
    """
    if not files:
        return
    folder = Path(directory)
    with locked(folder):
        if marker is not None and marker not in _markers(folder):
            message = f"{folder} now holds results of another input; allowed: run the case again"
            raise InputError(message)
        listed = read_manifest(folder) | dict.fromkeys([PART, *files], "")
        # Written first: a file that is not listed counts as the user's.
        lines = [f"{name}\t{checksum}".rstrip() for name, checksum in sorted(listed.items())]
        manifest = "\n".join([*lines, ""]).encode("utf-8", "surrogateescape")
        for name, content in {MANIFEST: manifest, **files}.items():
            _replace(folder / name, content, folder / PART)


def read_manifest(folder: Path) -> dict[str, str]:
    """Return the checksums of the files of a result directory by name, "" where not known.

    They are CRC-32 in hexadecimal digits. Without a manifest there are none.
    """
    listed: dict[str, str] = {}
    with suppress(FileNotFoundError):
        for line in (folder / MANIFEST).read_text("utf-8", "surrogateescape").splitlines():
            name, _, checksum = line.partition("\t")
            listed[name] = checksum or listed.get(name, "")
    return listed


def _markers(folder: Path) -> Iterator[bytes]:
    """Yield the contents of the files that identify the results of a directory."""
    for name in ("effective.nml", "sets.nml"):
        with suppress(OSError):
            yield (folder / name).read_bytes()


@contextmanager
def locked(folder: Path, kind: int = fcntl.LOCK_EX) -> Iterator[None]:
    """Hold the lock of a result directory, so that no other run switches or adds to it."""
    with _held(folder, os.O_RDONLY | os.O_DIRECTORY, kind) as (_, _, is_locked):
        if kind == fcntl.LOCK_EX and not is_locked:
            _warn_unlocked(folder)
        yield


@contextmanager
def _held(path: Path, flags: int, kind: int) -> Iterator[tuple[Path, int, bool]]:
    """Open what has a path; yield the path, the descriptor, and whether that holds the lock.

    Where there are no locks a new file gets a name of its own: several may write one of this name.
    """
    while True:
        descriptor = os.open(path, flags, 0o666)
        is_locked = _flock(descriptor, kind)
        if flags & os.O_CREAT and not flags & os.O_EXCL and not is_locked:
            os.close(descriptor)
            path.unlink(missing_ok=True)
            path, flags = own_path(path), flags | os.O_EXCL
            continue
        # The previous holder of the lock may have renamed it, or switched the directory.
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(descriptor), path.stat()):
                break
        os.close(descriptor)
    try:
        yield path, descriptor, is_locked
    finally:
        os.close(descriptor)


def own_path(part: Path) -> Path:
    """Return a temporary path that no other writer has; remove those that killed ones have left.

    Its name begins with that of `part`, and ends with the writer's host and process.
    """
    host = platform.node()
    for path in part.parent.iterdir():
        if path.name.startswith(f"{part.name}."):
            with suppress(OSError, ValueError):
                name, _, process = path.name.rpartition(".")
                ended = name.endswith(f".{host}") and not _is_running(int(process))
                if ended or time.time() - path.lstat().st_mtime > _MAX_AGE:
                    remove(path)
    return part.with_name(f"{part.name}.{secrets.token_hex(8)}.{host}.{os.getpid()}")


def _is_running(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:  # of another user
        pass
    return True


def remove(path: Path) -> None:
    """Remove a file or a directory, if it exists; an interrupt leaves its name all or nothing."""
    if path.is_dir() and not path.is_symlink():
        gone = path.with_name(f".{path.name}.part")
        shutil.rmtree(gone, ignore_errors=True)
        path.rename(gone)
        shutil.rmtree(gone)
    else:
        path.unlink(missing_ok=True)


def _replace(target: Path, content: bytes, part: Path) -> None:
    """Write a file under a temporary name in the same directory, then rename it.

    Where there are locks the name is always the same, and one writer at a time has it: what a
    killed one leaves is taken up by the next.
    """
    try:
        if target.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(target))
        # A link of this name may be another user's, to a file of ours.
        flags = os.O_WRONLY | os.O_CREAT | os.O_NOFOLLOW
        with _held(part, flags, fcntl.LOCK_EX) as (own, descriptor, _):
            try:
                # Closed before it is renamed: some disks are found to be full only then.
                with os.fdopen(os.dup(descriptor), "wb") as file:
                    file.truncate(0)
                    file.write(content)
                own.replace(target)
            except BaseException:
                own.unlink(missing_ok=True)
                raise
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(target)) from error
