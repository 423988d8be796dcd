"""Kinds of studies: how they are read, computed and saved."""

from __future__ import annotations

import dataclasses
import os
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypedDict, TypeVar, Unpack

from thud.base.checks import refuse, refuse_unknown
from thud.studies.directory import StudyDirectory, open_directory
from thud.studies.study import Study, named_files, read_common, read_tables
from thud.studies.study_result import StudyResult
from thud.studies.trained_surrogate import get_surrogate

if TYPE_CHECKING:
    from concurrent.futures import Executor
    from pathlib import Path

    from thud.case.case import Case
    from thud.studies.parameter import Parameter
    from thud.studies.study import Source
    from thud.studies.trained_surrogate import Surrogate

S = TypeVar("S", bound=Study)
R = TypeVar("R", bound=StudyResult)


class RunOptions(TypedDict, total=False):
    """How a study is computed.

    Attributes
    ----------
    workers : int or None
        Number of threads; by default one per processor.
    executor : concurrent.futures.Executor or None
        Computes the samples instead, with the same results: processes, or machines by the
        `get_executor` of a Dask client.
    allow_large : bool
        Allow any number of samples.
    progress : bool
        Show a progress bar.
    replace : bool
        Replace results of another version of the study, and files not written by thud.
    surrogate : Surrogate or str or None
        Surrogate, or the path of its file, that predicts the samples instead of the model.
    """

    workers: int | None
    executor: Executor | None
    allow_large: bool
    progress: bool
    replace: bool
    surrogate: Surrogate | str | os.PathLike[str] | None


class Kind(ABC, Generic[S, R]):
    """A kind of study: how its file is read, how it is computed, which files it writes."""

    name: ClassVar[str]
    # Keys and tables of its file besides those of every study.
    own_keys: ClassVar[tuple[str, ...]]

    def read_study(self, source: Source) -> S:
        """Return a study of this kind; see `thud.studies.kinds.read_study`."""
        if isinstance(source, Study):
            if source.kind != self.name:
                refuse(f"{source.name} is a {source.kind} study", f"a {self.name} study")
            return source  # type: ignore[return-value]
        with read_tables(source) as (content, folder, text):
            common = read_common(content, folder, self.name, self.own_keys, self.new_parameter)
            own = () if isinstance(source, Mapping) else (source,)
            inputs = (*own, *named_files(content, folder))
            common = dataclasses.replace(common, text=text, inputs=inputs)
            return self.complete(common, content, folder)

    def run(
        self,
        source: Source,
        output: str | os.PathLike[str] | None = None,
        **options: Unpack[RunOptions],
    ) -> R:
        """Return the result of a study, also written to an output directory."""
        refuse_unknown("keywords", options, RunOptions.__annotations__)
        study = self.read_study(source)
        if (surrogate := options.get("surrogate")) is not None:
            study = self.with_surrogate(study, get_surrogate(surrogate))
            if isinstance(surrogate, str | os.PathLike):
                study = dataclasses.replace(study, inputs=(*study.inputs, surrogate))
        self.require_runnable(study, **options)
        if output is None:
            return self.compute(study, None, **options)
        replace = options.get("replace", False)
        directory = open_directory(output, self, study, replace=replace, figures=False)
        result = self.compute(study, directory, **options)
        directory.write(self.files(result, study))
        return result

    @abstractmethod
    def new_parameter(
        self, name: str, entry: object, case: Case, density: float | None
    ) -> Parameter:
        """Return a parameter by its name and table; `density` is the fixed one of the wall."""

    @abstractmethod
    def complete(self, study: Study, content: Mapping[str, Any], folder: Path) -> S:
        """Return a study with the keys and tables of this kind."""

    def with_surrogate(self, study: S, trained: Surrogate) -> S:  # noqa: ARG002
        """Return a study whose drops a surrogate predicts."""
        refuse(f"surrogate is not allowed for a {self.name} study", "studies of samples of drops")

    def require_runnable(self, study: S, **options: Unpack[RunOptions]) -> None:
        """Raise InputError if a study cannot be computed with these options."""

    def describe(self, study: S) -> str:
        """Return a study in one line."""
        return f"{study.name}: {', '.join(p.name for p in study.parameters)} of {study.model}"

    @abstractmethod
    def compute(self, study: S, results: StudyDirectory | None, **options: Unpack[RunOptions]) -> R:
        """Return the result; finished samples are kept in a directory, if any."""

    @abstractmethod
    def identity_files(self, study: S) -> list[str]:
        """Return the names of files with an identity; the first exists once the study is done."""

    @abstractmethod
    def identity_in(self, path: Path) -> dict[str, str] | None:
        """Return the identity of saved results; None if they have no finished sample."""

    @abstractmethod
    def listed_files(self, study: S) -> list[str]:
        """Return the names of files that a study may write beside its results."""

    def files(self, result: R, study: S) -> dict[str, bytes]:  # noqa: ARG002 - most have none
        """Return the contents of additional files by name."""
        return {}
