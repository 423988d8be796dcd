"""Results directories: one run at a time, and results of one version of a study."""

from __future__ import annotations

import os
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Any

from thud.checks import refuse
from thud.errors import InputError
from thud.files import Results, lock, refuse_foreign, remove

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    from thud.studies.kind import Kind
    from thud.studies.study import Study

FORMATS = (".png", ".svg")
# Further differences are only counted.
_MAX_SHOWN = 3


@contextmanager
def take(
    folder: str | os.PathLike[str],
    kind: Kind[Any, Any],
    study: Study,
    *,
    replace: bool = False,
    figures: bool = True,
) -> Iterator[Results]:
    """Yield a results directory, locked for one run.

    Raises InputError where another run uses it, it holds results of another version of the study or
    a file is in the way (both only without `replace`), OSError where nothing can be written.
    """
    place = Path(folder)
    names = kind.results(study)
    place.mkdir(parents=True, exist_ok=True)
    descriptor = lock(place, place / names[0])
    try:
        results = Results(place, kind.name, study.inputs, replace=replace, is_locked=True)
        others = [n for n in kind.other_files(study) if figures or not n.endswith(FORMATS)]
        results.require(others)
        readers = dict.fromkeys((place / name for name in names), kind.identity_in)
        require_version(readers, study, results, kind.other_files(study))
        if not (place / names[0]).exists():
            with TemporaryFile(dir=place):
                pass
        yield results
    finally:
        os.close(descriptor)


def require_version(
    readers: Mapping[Path, Callable[[Path], dict[str, str] | None]],
    study: Study,
    results: Results,
    others: Iterable[str] = (),
) -> None:
    """Raise InputError where results belong to another study, or else remove them.

    `readers` return the identity of results by their paths; `others` are names of files that are
    removed with them.
    """
    for path, identity_in in readers.items():
        if not os.path.lexists(path):
            continue
        results.require_no_input(path)
        try:
            before = identity_in(path)
        except (InputError, ValueError, LookupError, TypeError, OSError):
            if path.is_dir() and not path.is_symlink():
                refuse(f"{path} is in the way: a directory of something else", "another directory")
            if not results.replace:
                refuse_foreign(path)
            path.unlink()
            continue
        changes = "" if before is None else differences(before, study.identity)
        if changes and not results.replace:
            refuse(
                f"{path} belongs to another version of this study: {changes}",
                "another directory, or --replace (replace=True) to compute it again",
            )
        if changes:
            for one in readers:
                remove(one)
            results.write({}, stale=others)


def _changes(path: Path, identity_in: Callable[[Path], dict[str, str] | None], study: Study) -> str:
    """Return the differences of a study from that of existing results."""
    try:
        before = identity_in(path)
    except InputError:
        raise
    except (ValueError, LookupError, TypeError, FileNotFoundError) as error:
        refuse(
            f"{path} holds something else, or results of an older thud",
            "another directory, or remove it",
            error,
        )
    return "" if before is None else differences(before, study.identity)


def differences(before: Mapping[str, str], now: Mapping[str, str]) -> str:
    """Return the keys in which two versions of a study differ, or nothing.

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
