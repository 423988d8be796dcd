"""Results directories: one run at a time, and results of one version of a study."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Any, Self

from thud.errors import InputError
from thud.files import lock, replace_file

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure

    from thud.studies.kind import Kind
    from thud.studies.study import Study

FORMATS = (".png", ".svg")
# More differences than this are counted only.
_MAX_SHOWN = 3


class Directory:
    """A results directory, locked for one run in a ``with`` block.

    Raises InputError where another run uses it or it holds other results (of another version of the
    study only without `replace`), OSError where nothing can be written.
    """

    def __init__(
        self,
        folder: str | os.PathLike[str],
        kind: Kind[Any, Any],
        study: Study,
        *,
        replace: bool = False,
    ) -> None:
        self.folder = Path(folder)
        self._kind, self._study, self._replace = kind, study, replace
        self._descriptor: int | None = None

    def __enter__(self) -> Self:
        """Lock the directory and check its results."""
        results = [self.folder / name for name in self._kind.results(self._study)]
        self.folder.mkdir(parents=True, exist_ok=True)
        self._descriptor = lock(self.folder, results[0])
        try:
            for path in results:
                self._take(path)
            if not results[0].exists():
                with TemporaryFile(dir=self.folder):
                    pass
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        """Unlock the directory."""
        if self._descriptor is not None:
            os.close(self._descriptor)
        self._descriptor = None

    def _take(self, path: Path) -> None:
        """Raise InputError for results of something else, or remove them if asked."""
        if not path.exists():
            return
        try:
            before = self._kind.identity_in(path)
        except InputError:
            raise
        except (ValueError, LookupError, TypeError, FileNotFoundError) as error:
            message = (
                f"{path} is of something else, or of an older thud; "
                "allowed: another directory, or remove it"
            )
            raise InputError(message) from error
        if before is None:
            return
        changes = differences(before, self._study.identity)
        if not changes:
            return
        if not self._replace:
            message = (
                f"{path} belongs to another version of this study: {changes}; "
                "allowed: another directory, or --replace (replace=True) to compute it anew"
            )
            raise InputError(message)
        for name in (*self._kind.results(self._study), *self._kind.other_files(self._study)):
            remove(self.folder / name)


def save(folder: Path, files: Mapping[str, bytes], figures: Mapping[str, Figure]) -> list[Path]:
    """Write files, and figures as PNG and SVG, by name; return their paths."""
    paths = []
    for name, content in files.items():
        paths.append(folder / name)
        replace_file(paths[-1], content)
    if figures:
        from thud.plot import save_all  # noqa: PLC0415 - matplotlib takes its time

        paths += save_all(figures, folder)
    return paths


def remove(path: Path) -> None:
    """Remove a file or a directory, if it exists."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def differences(before: Mapping[str, str], now: Mapping[str, str]) -> str:
    """Return in which places and keys two versions of a study differ, or nothing.

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
