"""Directories of studies, which grow: every file is written aside and renamed."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from thud.base.checks import refuse, shown_text
from thud.base.files import is_failure, is_one_of
from thud.studies.dataset import read_identity

if TYPE_CHECKING:
    from collections.abc import Iterable

    from thud.studies.study import Study


def open_directory(
    folder: str | os.PathLike[str], study: Study, others: Iterable[str] = (), *, replace: bool
) -> tuple[Path, Path]:
    """Return the paths of the results of a study and of the directory of its blocks.

    Both are made by the caller; `others` are names of files that it writes beside them. Results of
    another version of the study and files that thud has not written are refused, or removed with
    `replace`; inputs of the study are never replaced.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    results = folder / f"{study.name}.nc", folder / f"{study.name}.partial"
    begun = [path for path in results if os.path.lexists(path)]
    beside = [folder / name for name in others if os.path.lexists(folder / name)]
    for path in (*begun, *beside):
        if is_one_of(path, study.inputs):
            refuse(f"{path} is an input, which is never replaced", "another directory")
        if path in beside and (_is_directory(path) or not (begun or replace)):
            _refuse_foreign(path)
    old = [path for path in begun if _is_outdated(path, study, replace=replace)]
    for path in (*old, *beside, folder / f"{study.name}.svg") if old else ():
        remove(path)
    return results


def _is_outdated(path: Path, study: Study, *, replace: bool) -> bool:
    """Return whether results are not of this study; raise InputError without `replace`."""
    try:
        before = {} if path.is_symlink() else read_identity(path)
    except (OSError, ValueError, LookupError, TypeError) as error:
        if is_failure(error):
            raise
        before = {}
    if before is None or before == study.identity:
        return False
    if not before and (not replace or _is_directory(path)):
        _refuse_foreign(path)
    if not replace:
        now = study.identity
        key = next(key for key in {**before, **now} if before.get(key) != now.get(key))
        one, other = (shown_text(identity.get(key, "not stated")) for identity in (before, now))
        refuse(
            f"{path} belongs to another version of this study: {key} = {one} is now {other}",
            "another directory, or --replace (replace=True) to compute the study again",
        )
    return True


def _refuse_foreign(path: Path) -> NoReturn:
    """Raise InputError for a file or directory that thud has not written."""
    problem = f"{path} is in the way: thud has not written it"
    refuse(problem, "another directory, or --replace (replace=True) to replace it")


def remove(path: Path) -> None:
    """Remove a file, or a directory of blocks unless it has other files."""
    if not _is_directory(path):
        path.unlink(missing_ok=True)
        return
    for block in path.glob("*block_*.nc*"):
        block.unlink(missing_ok=True)
    with suppress(OSError):
        path.rmdir()


def _is_directory(path: Path) -> bool:
    return path.is_dir() and not path.is_symlink()
