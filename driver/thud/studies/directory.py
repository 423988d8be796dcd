"""Results directories: one run at a time, and results of one version of a study."""

from __future__ import annotations

import os
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Any

from thud.checks import refuse
from thud.display import left_out
from thud.errors import InputError
from thud.files import lock, remove, replace_file

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    from matplotlib.figure import Figure

    from thud.studies.kind import Kind
    from thud.studies.study import Study

FORMATS = (".png", ".svg")
# Further differences are only counted.
_MAX_SHOWN = 3


@contextmanager
def take(
    folder: str | os.PathLike[str], kind: Kind[Any, Any], study: Study, *, replace: bool = False
) -> Iterator[Path]:
    """Yield a results directory, locked for one run.

    Raises InputError where another run uses it or it holds other results (of another version of the
    study only without `replace`), OSError where nothing can be written.
    """
    place = Path(folder)
    results = [place / name for name in kind.results(study)]
    place.mkdir(parents=True, exist_ok=True)
    descriptor = lock(place, results[0])
    try:
        others = [place / name for name in kind.other_files(study)]
        require_version(dict.fromkeys(results, kind.identity_in), study, others, replace=replace)
        if not results[0].exists():
            with TemporaryFile(dir=place):
                pass
        yield place
    finally:
        os.close(descriptor)


def require_version(
    readers: Mapping[Path, Callable[[Path], dict[str, str] | None]],
    study: Study,
    others: Iterable[Path],
    *,
    replace: bool,
) -> None:
    """Raise InputError where results belong to another study; with `replace`, remove them.

    `readers` return the identity of results by their paths; `others` are removed with them.
    """
    for path, identity_in in readers.items():
        changes = _changes(path, identity_in, study) if path.exists() else ""
        if changes and not replace:
            refuse(
                f"{path} belongs to another version of this study: {changes}",
                "another directory, or --replace (replace=True) to compute it again",
            )
        if changes:
            for one in (*readers, *others):
                remove(one)


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


def save(
    folder: Path,
    files: Mapping[str, bytes],
    draw: Callable[[], Mapping[str, Figure]] | None = None,
) -> list[Path]:
    """Write files, and what is drawn as PNG and SVG, by name; return their paths."""
    paths = [folder / name for name in files]
    for path in paths:
        replace_file(path, files[path.name])
    figures: Mapping[str, Figure] = {}
    if draw is not None:
        with left_out("the figure of the study"):
            figures = draw()
    if figures:
        from thud.plot import save_all  # noqa: PLC0415 - matplotlib takes its time

        paths += save_all(figures, folder)
    return paths


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
