"""Result files: written atomically and under locks; files of the user are not replaced."""

from __future__ import annotations

import errno
import fcntl
import os
import platform
import re
import secrets
import shutil
import signal
import stat
import threading
import time
import tomllib
import warnings
import zlib
from abc import ABC, abstractmethod
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, NoReturn

from thud.base.checks import refuse
from thud.base.errors import InputError, LockWarning

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

# Name and first line of the list of files that thud has written to a directory.
MANIFEST = ".thud"
FIRST_LINE = "# files that thud has written, with checksums (CRC-32)"
# Temporary name of a file in a result directory.
TEMPORARY = f"{MANIFEST}.new"
# Age from which a temporary file of another host counts as abandoned, s.
_MAX_AGE = 86400.0
# Errors of a file system that has no locks.
_NO_LOCKS = (errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS, errno.EBADF, errno.EINVAL)
# Errors of a path that leads to no regular file.
_NO_FILE = (
    errno.EINVAL, errno.EISDIR, errno.ELOOP, errno.ENAMETOOLONG, errno.ENOENT, errno.ENOTDIR
)  # fmt: skip


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Defer signals until a short operation is done, as file libraries print errors if interrupted.

    Other threads than the main thread receive no signals: there this does nothing.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    pending: list[int] = []
    handlers = {
        number: signal.signal(number, lambda number, _: pending.append(number))
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        if pending:
            signal.raise_signal(pending[0])


def replace_file(path: str | os.PathLike[str], content: bytes) -> None:
    """Write a file atomically, replacing an existing one; an OSError names the path."""
    try:
        target = Path(path)
        if target.exists():
            _require_regular(target.stat(), target)
        _replace(target, content, target.with_name(f".{target.name}.part"))
    except ValueError as error:  # a path that no file system can hold
        refuse(f"{path!r} is not allowed", "the path of a file", error)


class Page(ABC):
    """Base of comparisons that are saved as a figure and an HTML page."""

    # The subcommand of `thud` that saves the files.
    _command: ClassVar[str]

    @abstractmethod
    def files(self) -> dict[str, bytes]:
        """Return the contents of the files by name."""

    def save(self, directory: str | os.PathLike[str], *, replace: bool = False) -> list[Path]:
        """Write the contents of `files` and return the paths.

        Files that thud has not written are replaced only if `replace` is true. Raise InputError if
        such a file exists otherwise, and OSError if a file cannot be written.
        """
        return Results(Path(directory), self._command, replace=replace).write(self.files())


@dataclass(frozen=True)
class Results:
    """A directory for results, in which thud replaces only files that it has written.

    The manifest of the directory lists the names and checksums of its files. Files that are not
    listed, not regular, or changed since thud wrote them belong to the user.

    Attributes
    ----------
    folder : Path
        The directory; created if it is missing.
    command : str
        The subcommand that writes the files; empty for the results of a case and their figures,
        which the next input replaces as a whole.
    inputs : tuple of path-like
        Files that the results depend on, never replaced.
    replace : bool
        Also replace files that thud has not written.
    is_locked : bool
        Whether the caller holds the lock of the directory.
    """

    folder: Path
    command: str = ""
    inputs: tuple[str | os.PathLike[str], ...] = ()
    replace: bool = False
    is_locked: bool = False

    def require(self, names: Iterable[str], listed: Mapping[str, Entry] | None = None) -> None:
        """Raise InputError for an existing file that may not be replaced.

        `listed` are entries of files by thud, by default those of the manifest.
        """
        listed = self._listed() if listed is None else listed
        for name in names:
            path = self.folder / name
            if not os.path.lexists(path):
                continue
            self.require_no_input(path)
            if is_directory(path) or not (self.replace or _is_listed(path, listed)):
                refuse_foreign(path)

    def written(self) -> list[str]:
        """Return the names of files that an earlier call of the command has written."""
        return [name for name, entry in self._listed().items() if entry.command == self.command]

    def write(
        self, contents: Mapping[str, bytes], stale: Iterable[str] = (), marker: bytes | None = None
    ) -> list[Path]:
        """Write files and return their paths.

        Files named in `stale` are removed if an earlier call of the command has written them. For
        files that belong to the results of a case, `marker` is the content of ``effective.nml`` or
        ``samples.nml``, which identifies the results. Raise InputError if a file of the user
        exists, or another run has replaced the results of the case, and OSError if a file cannot be
        written.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        with nullcontext() if self.is_locked else locked(self.folder):
            markers = {content_of(self.folder / name) for name in ("effective.nml", "samples.nml")}
            if marker not in {None, *markers}:
                refuse(f"{self.folder} now holds results of another input", "run the case again")
            listed = self._listed()
            written = {n: Entry((checksum(c),), self.command) for n, c in contents.items()}
            # A killed writer leaves files with old or new contents: both checksums are listed.
            allowed = listed | {
                n: Entry((*listed.get(n, Entry(())).checksums, *e.checksums), e.command)
                for n, e in written.items()
            }
            self.require(contents, allowed)
            removed = [
                n
                for n in {*stale} - {*contents}
                if _is_listed(self.folder / n, listed) and listed[n].command == self.command
            ]
            if not contents and not removed:
                return []
            self._put({MANIFEST: _manifest(allowed), **contents})
            for name in removed:
                (self.folder / name).unlink(missing_ok=True)
            remaining = {name: e for name, e in (listed | written).items() if name not in removed}
            if remaining:
                self._put({MANIFEST: _manifest(remaining)})
            else:
                (self.folder / MANIFEST).unlink(missing_ok=True)
        return [self.folder / name for name in contents]

    def _put(self, contents: Mapping[str, bytes]) -> None:
        for name, content in contents.items():
            _replace(self.folder / name, content, self.folder / TEMPORARY)

    def _listed(self) -> dict[str, Entry]:
        self.require_no_input(self.folder / MANIFEST)
        try:
            return read_manifest(self.folder)
        except InputError:
            if not self.replace or is_directory(self.folder / MANIFEST):
                raise
            return {}

    def require_no_input(self, path: Path) -> None:
        """Raise InputError if a path is an input."""
        if is_one_of(path, self.inputs):
            refuse(f"{path} is an input, which is never replaced", "another directory")


class Entry(NamedTuple):
    """Entry of a manifest: allowed checksums of a file, and the subcommand that wrote it."""

    checksums: tuple[str, ...]
    command: str = ""


def refuse_foreign(path: Path) -> NoReturn:
    """Raise InputError for a file or directory that thud has not written."""
    if is_directory(path):
        refuse(f"{path} is a directory that thud has not written", "another directory")
    refuse(
        f"{path} is in the way: thud has not written it, or it has changed since",
        "another directory, or --replace (replace=True) to replace it",
    )


def is_one_of(path: Path, others: Iterable[str | os.PathLike[str]]) -> bool:
    """Whether a path leads to one of several files, also by a link or another name."""
    for other in others:
        with suppress(OSError, ValueError):
            if path.samefile(other):
                return True
    return False


def is_directory(path: Path) -> bool:
    """Whether a path is a directory and not a symbolic link."""
    return path.is_dir() and not path.is_symlink()


def is_regular(path: Path) -> bool:
    """Whether a path is a regular file and not a symbolic link; opening other files may block."""
    try:
        return stat.S_ISREG(path.lstat().st_mode)
    except (OSError, ValueError):
        return False


def is_temporary(name: str) -> bool:
    """Whether a name is that of a temporary file, such as one of `unique_path`."""
    return re.fullmatch(r"\.(thud\.new|.+\.part)(\..*)?", name) is not None


def is_failure(error: BaseException) -> bool:
    """Whether a reading error is a failure of the system, not a missing or unsuitable file."""
    return isinstance(error, OSError) and error.errno not in (None, *_NO_FILE)


def read_input(path: Path) -> bytes:
    """Return the content of an input file; raise OSError if it is not a regular file."""
    _require_regular(path.stat(), path)
    return path.read_bytes()


def read_toml(path: Path) -> tuple[dict[str, Any], str]:
    """Return the tables and the text of a TOML file.

    Raise InputError with the path if the file cannot be read or is not TOML.
    """
    try:
        text = read_input(path).decode("utf-8-sig")
    except OSError as error:
        refuse(f"{path}: {error.strerror}", "a file that exists and can be read", error)
    except UnicodeDecodeError as error:
        refuse(f"{path}: byte {error.start + 1} is not UTF-8", "TOML, which is UTF-8", error)
    try:
        return tomllib.loads(text), text
    except (ValueError, RecursionError) as error:  # no TOML, or thousands of digits or brackets
        refuse(f"{path}: {error}", "TOML", error)


def inputs_folder() -> Path:
    """Return the folder of the inputs: those of the installed package, or of the clone.

    Raise InputError if there is none.
    """
    package = Path(__file__).parents[1]
    folders = (package / "inputs", package.parents[1] / "inputs")
    folder = next(filter(Path.is_dir, folders), None)
    if folder is None:
        refuse("this package has no inputs", "an installed package, or a clone")
    return folder


def _require_unlinked(status: os.stat_result, part: Path) -> None:
    _require_regular(status, part)
    # The file has another name: writing would change it there too.
    if status.st_nlink > 1:
        raise OSError(errno.EEXIST, f"{part.name} is a link", str(part))


def _require_regular(status: os.stat_result, path: Path) -> None:
    if not stat.S_ISREG(status.st_mode):
        raise OSError(errno.EINVAL, f"{path.name} is no regular file", str(path))


def content_of(path: Path) -> bytes | None:
    """Return the content of a regular file, None for anything else."""
    with suppress(OSError):
        return path.read_bytes() if is_regular(path) else None
    return None


def checksum(content: bytes) -> str:
    """Return the checksum that a manifest lists for a content: CRC-32 in hexadecimal digits."""
    return f"{zlib.crc32(content):08X}"


def read_manifest(folder: Path) -> dict[str, Entry]:
    """Return the entries of the manifest of a directory; empty if there is no manifest.

    The last checksum of an entry is that of the latest content. Raise InputError if a file with
    the name of a manifest is not by thud.
    """
    path = folder / MANIFEST
    if not os.path.lexists(path):
        return {}
    content = content_of(path)
    head, *lines = (content or b"").decode("utf-8", "surrogateescape").split("\n")
    if head != FIRST_LINE:
        refuse_foreign(path)
    listed: dict[str, Entry] = {}
    for line in lines:
        name, digest, command = [*line.split("\t"), "", ""][:3]
        previous = listed[name].checksums if name in listed else ()
        if digest:
            listed[name] = Entry((*previous, digest), command)
    return listed


def _manifest(listed: Mapping[str, Entry]) -> bytes:
    lines = [
        f"{name}\t{digest}\t{entry.command}".rstrip("\t")
        for name, entry in sorted(listed.items())
        for digest in entry.checksums
    ]
    return "\n".join([FIRST_LINE, *lines, ""]).encode("utf-8", "surrogateescape")


def _is_listed(path: Path, listed: Mapping[str, Entry]) -> bool:
    """Whether thud has written a file."""
    content = content_of(path) if path.name in listed else None
    return content is not None and checksum(content) in listed[path.name].checksums


@contextmanager
def locked(folder: Path, kind: int = fcntl.LOCK_EX) -> Iterator[None]:
    """Hold the lock of a result directory, so that no other run replaces or extends its files.

    Raise BlockingIOError if another run holds the lock and `kind` has LOCK_NB.
    """
    with _open_locked(folder, os.O_RDONLY | os.O_DIRECTORY, kind) as (_, _, is_locked):
        if kind & fcntl.LOCK_EX and not is_locked:
            advice = "the file system has no locks; let only one run at a time write there"
            warnings.warn(f"{folder}: {advice}", LockWarning, stacklevel=3)
        yield


@contextmanager
def _open_locked(path: Path, flags: int, kind: int) -> Iterator[tuple[Path, int, bool]]:
    """Open a path; yield the path, the descriptor, and whether the descriptor holds the lock.

    On a file system without locks a new file gets a unique name, as other runs may write to `path`.
    """
    while True:
        descriptor = os.open(path, flags, 0o666)
        try:
            is_locked = _flock(descriptor, kind)
            if flags & os.O_CREAT and not flags & os.O_EXCL and not is_locked:
                path.unlink(missing_ok=True)
                path, flags = unique_path(path), flags | os.O_EXCL
            # The previous holder of the lock may have renamed the file or replaced the directory.
            elif _is_open_as(path, descriptor):
                yield path, descriptor, is_locked
                return
        finally:
            os.close(descriptor)


def _flock(descriptor: int, kind: int) -> bool:
    """Lock an open file; return False if the file system has no locks."""
    try:
        fcntl.flock(descriptor, kind)
    except OSError as error:
        if error.errno not in _NO_LOCKS:
            raise
        return False
    return True


def _is_open_as(path: Path, descriptor: int) -> bool:
    try:
        return os.path.samestat(os.fstat(descriptor), path.stat())
    except FileNotFoundError:
        return False


def unique_path(part: Path) -> Path:
    """Return a unique temporary path, after removing the temporary files of ended processes.

    The name begins with the name of `part` and ends with the host and the number of this process.
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
    except PermissionError:  # a process of another user
        pass
    return True


def remove(path: Path) -> None:
    """Remove a file or a directory if it exists; an interrupt leaves it complete or absent."""
    if is_directory(path):
        moved = path.with_name(f".{path.name}.part")
        shutil.rmtree(moved, ignore_errors=True)
        path.rename(moved)
        shutil.rmtree(moved)
    else:
        path.unlink(missing_ok=True)


def _replace(target: Path, content: bytes, part: Path) -> None:
    """Write a file under a temporary name in the same directory, then rename it.

    If the file system has locks, all writers use the same temporary name, one after the other, and
    overwrite what a killed writer left.
    """
    try:
        # Another user may have put a link to one of our files; opening a pipe could block.
        flags = os.O_WRONLY | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK
        with _open_locked(part, flags, fcntl.LOCK_EX) as (path, descriptor, _):
            _require_unlinked(os.fstat(descriptor), path)
            try:
                # Closed before it is renamed: some full disks raise an error only then.
                with os.fdopen(os.dup(descriptor), "wb") as file:
                    file.truncate(0)
                    file.write(content)
                path.replace(target)
            except BaseException:
                path.unlink(missing_ok=True)
                raise
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(target)) from error
