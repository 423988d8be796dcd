"""Results directories, each for one run at a time and one version of a study."""

from __future__ import annotations

import os
from contextlib import ExitStack, contextmanager
from fcntl import LOCK_EX, LOCK_NB
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Any

from thud.base.checks import refuse
from thud.base.files import Results, is_directory, is_failure, locked, refuse_foreign, remove

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    from thud.studies.kind import Kind
    from thud.studies.study import Study

# Endings of the figures.
FORMATS = (".svg",)
# Maximum number of listed differences; others are counted.
_MAX_SHOWN = 3


@contextmanager
def open_results(
    folder: str | os.PathLike[str],
    kind: Kind[Any, Any],
    study: Study,
    *,
    replace: bool = False,
    figures: bool = True,
) -> Iterator[Results]:
    """Yield a results directory, locked for one run.

    Raises InputError if another run uses it or, without `replace`, if it holds results of another
    version of the study or a file is in the way; OSError if nothing can be written.
    """
    directory = Path(folder)
    names = kind.identity_files(study)
    directory.mkdir(parents=True, exist_ok=True)
    with ExitStack() as stack:
        try:
            stack.enter_context(locked(directory, LOCK_EX | LOCK_NB))
        except BlockingIOError as error:
            refuse(f"{directory / names[0]} is being computed", "wait, or another directory", error)
        results = Results(directory, kind.name, study.inputs, replace=replace, is_locked=True)
        listed = kind.listed_files(study)
        results.require(n for n in listed if figures or not n.endswith(FORMATS))
        readers = dict.fromkeys((directory / name for name in names), kind.identity_in)
        require_version(readers, study, results, listed)
        if not (directory / names[0]).exists():
            with TemporaryFile(dir=directory):
                pass
        yield results


def require_version(
    readers: Mapping[Path, Callable[[Path], dict[str, str] | None]],
    study: Study,
    results: Results,
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
            if is_directory(path) or not results.replace:
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
    for path in outdated:
        remove(path)
    if outdated:
        results.write({}, stale=others)


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
