"""Files and directories of results: written whole, or not at all; the user's files stay."""

from __future__ import annotations

import errno
import os
import secrets
import shutil
import stat
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from thud.base.bridge import ask
from thud.base.checks import refuse, require_kind, shown_text

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

# Maximum size of files that are read as a whole, bytes.
MAX_IN_MEMORY = 2**27
MIB = 2**20
# Errors of a path that leads to no regular file.
_NO_FILE = (
    errno.EINVAL, errno.EISDIR, errno.ELOOP, errno.ENAMETOOLONG, errno.ENOENT, errno.ENOTDIR
)  # fmt: skip


def replace_file(path: str | os.PathLike[str], content: bytes) -> None:
    """Write a file under a temporary name beside it, then rename it; an OSError names the path."""
    try:
        target = Path(path)
        if target.exists():
            require_regular(target)
        part = target.with_name(f".{target.name}.{secrets.token_hex(8)}.new")
        try:
            part.write_bytes(content)
            part.replace(target)
        finally:
            part.unlink(missing_ok=True)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error
    except ValueError as error:  # a path that no file system can hold
        refuse(f"{path!r} is not allowed", "the path of a file", error)


def require_ending(path: str | os.PathLike[str], *endings: str) -> Path:
    """Return a path; raise InputError unless it has one of the endings, in small letters or not."""
    if not Path(path).name.lower().endswith(endings):
        refuse(f"{path}: this ending is not known", ", ".join(endings))
    return Path(path)


@dataclass(frozen=True)
class Results:
    """A directory of results, replaced as a whole; see `thud_result_directory` of the library."""

    # The directory, which may be missing, and the subcommand that writes the results.
    folder: Path
    command: str
    # What they are results of, such as the name of a case; others are replaced with `replace` only.
    subject: str = ""
    # Files that the results depend on, never replaced.
    inputs: tuple[str | os.PathLike[str], ...] = ()
    replace: bool = False

    def require(self, names: Iterable[str] = ()) -> None:
        """Raise InputError if the directory may not be replaced by files of these names.

        Without names, they are not known yet, and are checked when the directory is replaced.
        """
        self._ask("check_results", names=_lines(*names))

    @contextmanager
    def new_folder(self) -> Iterator[Path]:
        """Yield a new directory, which then takes the place of the old one.

        After an error it is removed. Raise InputError if the old one may not be replaced.
        """
        part = Path(self._ask("open_results")["folder"])
        try:
            yield part
        except BaseException:
            shutil.rmtree(part, ignore_errors=True)
            raise
        self._ask("close_results", folder=os.fsencode(part))

    def write(self, contents: Mapping[str, bytes]) -> list[Path]:
        """Replace the directory by files with these contents; return their paths.

        Raise InputError if the directory may not be replaced, and OSError if a file cannot be
        written.
        """
        if contents:
            with self.new_folder() as part:
                self.write_into(part, contents)
        return [self.folder / name for name in contents]

    def write_into(self, part: Path, contents: Mapping[str, bytes]) -> None:
        """Write files into the new directory; an OSError names the path of the results."""
        for name, content in contents.items():
            try:
                (part / name).write_bytes(content)
            except OSError as error:
                raise OSError(error.errno, error.strerror, str(self.folder / name)) from error

    def _ask(self, question: str, **more: bytes) -> dict[str, Any]:
        return ask(
            question, path=_lines(self.folder), command=self.command, subject=self.subject,
            replace=self.replace, inputs=_lines(*self.inputs), **more,
        )  # fmt: skip


def _lines(*paths: str | os.PathLike[str]) -> bytes:
    """Return paths as lines for a request; raise InputError for line ends and zero bytes."""
    for path in map(os.fsdecode, paths):
        if {"\n", "\0"} & {*path}:
            refuse(f"{path!r} is not allowed", "a path in one line without zero bytes")
    return b"\n".join(map(os.fsencode, paths))


def is_one_of(path: Path, others: Iterable[str | os.PathLike[str]]) -> bool:
    """Whether a path leads to one of several files, also by a link or another name."""
    for other in others:
        with suppress(OSError, ValueError):
            if path.samefile(other):
                return True
    return False


def is_failure(error: BaseException) -> bool:
    """Whether a reading error is a failure of the system, not a missing or unsuitable file."""
    return isinstance(error, OSError) and error.errno not in (None, *_NO_FILE)


def require_regular(path: Path) -> Path:
    """Return a path; raise OSError if it is no regular file: opening others may block."""
    if not stat.S_ISREG(path.stat().st_mode):
        raise OSError(errno.EINVAL, f"{path.name} is no regular file", str(path))
    return path


def regular_file(path: str | os.PathLike[str]) -> Path:
    """Return a path; raise InputError if it is no readable regular file (a pipe could block)."""
    require_kind("path", path, str | os.PathLike)
    file = Path(path)
    try:
        require_regular(file)
        file.open("rb").close()
    except (OSError, ValueError) as error:  # a zero byte
        reason = getattr(error, "strerror", "no path")
        refuse(f"{shown_text(file)}: cannot be read ({reason})", "a file that can be read", error)
    return file


def require_small(path: Path, kind: str, limit: int = MAX_IN_MEMORY) -> None:
    """Raise InputError if a file that is read as a whole is too large."""
    size = path.stat().st_size
    if size > limit:
        refuse(
            f"{shown_text(path)}: {size / MIB:.0f} MiB of {kind}, which is read as a whole",
            f"up to {limit // MIB} MiB; longer recordings as WAV, RF64, FLAC, HDF5 or TDMS",
        )


def inputs_folder() -> Path:
    """Return the folder of the inputs: those of the installed package, or of the clone."""
    package = Path(__file__).parents[1]
    installed = package / "inputs"
    return installed if installed.is_dir() else package.parents[1] / "inputs"
