"""Directories of studies, which grow: every file is written aside and renamed."""

from __future__ import annotations

import os
import shutil
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Any

from thud.base.checks import refuse
from thud.base.files import is_failure, is_one_of, refuse_foreign, replace_file

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from thud.studies.kind import Kind
    from thud.studies.study import Study

# Endings of the figures.
FORMATS = (".svg",)
# Maximum number of listed differences; others are counted.
_MAX_SHOWN = 3


@dataclass(frozen=True)
class StudyDirectory:
    """The directory of a study.

    Attributes
    ----------
    folder : Path
        The directory.
    inputs : tuple of path-like
        Files that the study depends on, never replaced.
    replace : bool
        Replace results of another version of the study, and files that belong to no study.
    """

    folder: Path
    inputs: tuple[str | os.PathLike[str], ...] = ()
    replace: bool = False

    def write(self, contents: Mapping[str, bytes]) -> list[Path]:
        """Write files and return their paths; raise InputError for the path of an input."""
        for name, content in contents.items():
            self.require_no_input(self.folder / name)
            replace_file(self.folder / name, content)
        return [self.folder / name for name in contents]

    def require_no_input(self, path: Path) -> None:
        """Raise InputError if a path is an input."""
        if is_one_of(path, self.inputs):
            refuse(f"{path} is an input, which is never replaced", "another directory")


def open_directory(
    folder: str | os.PathLike[str],
    kind: Kind[Any, Any],
    study: Study,
    *,
    replace: bool = False,
    figures: bool = True,
) -> StudyDirectory:
    """Return the directory of a study, created if it is missing.

    Raises InputError, without `replace`, if it holds results of another version of the study or a
    file of another origin is in the way; OSError if the directory cannot be made.
    """
    directory = StudyDirectory(Path(folder), study.inputs, replace)
    directory.folder.mkdir(parents=True, exist_ok=True)
    with TemporaryFile(dir=directory.folder):
        pass  # a directory that cannot be written is an error now, not after hours
    names = kind.identity_files(study)
    listed = kind.listed_files(study)
    readers = dict.fromkeys((directory.folder / name for name in names), kind.identity_in)
    begun = any(map(os.path.lexists, readers))
    for path in (directory.folder / n for n in listed if figures or not n.endswith(FORMATS)):
        directory.require_no_input(path)
        if _is_directory(path) or (os.path.lexists(path) and not (begun or replace)):
            refuse_foreign(path)
    require_version(readers, study, directory, listed)
    return directory


def require_version(
    readers: Mapping[Path, Callable[[Path], dict[str, str] | None]],
    study: Study,
    results: StudyDirectory,
    others: Iterable[str] = (),
) -> None:
    """Raise InputError if results belong to another version of a study, or remove them to replace.

    `readers` return the identity of the results at a path; `others` are names of files that are
    removed with them. All results are checked before any is removed.
    """
    outdated: list[Path] = []
    for path, identity_in in readers.items():
        if not os.path.lexists(path):
            continue
        results.require_no_input(path)
        try:
            changes = _changes(path, identity_in, study)
        except (OSError, ValueError, LookupError, TypeError) as error:
            if is_failure(error):
                raise
            if _is_directory(path) or not results.replace:
                refuse_foreign(path)
            outdated.append(path)
            continue
        if changes and not results.replace:
            refuse(
                f"{path} belongs to another version of this study: {changes}",
                "another directory, or --replace (replace=True) to compute the study again",
            )
        if changes:
            outdated.append(path)
    for path in [*outdated, *(results.folder / name for name in others if outdated)]:
        _remove(path)


def _is_directory(path: Path) -> bool:
    return path.is_dir() and not path.is_symlink()


def _remove(path: Path) -> None:
    if _is_directory(path):
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _changes(path: Path, identity_in: Callable[[Path], dict[str, str] | None], study: Study) -> str:
    """Return how a study differs from saved results; raise if these are not results."""
    if path.is_symlink():
        message = f"{path} is a link"
        raise ValueError(message)
    before = identity_in(path)
    return "" if before is None else differences(before, study.identity)


def differences(before: Mapping[str, str], now: Mapping[str, str]) -> str:
    """Return the differences of two versions of a study as text, empty if they agree.

    >>> differences({"[design] size": "500"}, {"[design] size": "1000", "[design] seed": "1"})
    '[design] size = 500 is now 1000, [design] seed = 1 is new'
    """
    changes = []
    for key in {**before, **now}:
        if key not in before:
            changes.append(f"{key} = {now[key]} is new")
        elif key not in now:
            changes.append(f"{key} = {before[key]} is gone")
        elif before[key] != now[key]:
            changes.append(f"{key} = {before[key]} is now {now[key]}")
    more = [f"{len(changes) - _MAX_SHOWN} more"] if len(changes) > _MAX_SHOWN else []
    return ", ".join(changes[:_MAX_SHOWN] + more)
