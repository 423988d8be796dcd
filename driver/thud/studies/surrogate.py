"""Surrogates as a kind of study: trained in a region of the parameters, used by other studies."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar, Unpack

from thud.base.checks import refuse
from thud.studies.parameter import Parameter
from thud.studies.sample_kind import DropsKind
from thud.studies.surrogate_training import surrogate_name, train
from thud.studies.trained_surrogate import Surrogate, read_surrogate

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping
    from pathlib import Path

    from thud.case.case import Case
    from thud.studies.directory import StudyDirectory
    from thud.studies.kind import RunOptions
    from thud.studies.samples import SampleStudy
    from thud.studies.study import Source, Study


class SurrogateKind(DropsKind[Surrogate]):
    """Surrogates as a kind of study."""

    name = "surrogate"
    own_keys: ClassVar[tuple[str, ...]] = ("surrogate",)
    designs = ("grid",)

    def new_parameter(
        self, name: str, entry: object, case: Case, density: float | None
    ) -> Parameter:
        """Return a parameter that varies from a minimum to a maximum."""
        result = super().new_parameter(name, entry, case, density)
        if result.low is None or result.count or result.scale != Parameter.scale:
            refuse(f"[parameters] {name} is not a range of a surrogate", "low, high and unit")
        # The samples of the study are the corners of the region.
        return replace(result, count=2)

    def complete(self, study: Study, content: Mapping[str, Any], folder: Path) -> SampleStudy:
        """Return a study with the plan of its training."""
        result = super().complete(study, {"surrogate": {}, **content}, folder)
        if result.plan is None:
            refuse(
                "[surrogate] file is not allowed for training a surrogate", "error, size and seed"
            )
        return result

    def compute(
        self, study: SampleStudy, results: StudyDirectory | None, **options: Unpack[RunOptions]
    ) -> Surrogate:
        """Return the surrogate, trained or read."""
        return train(study, results, options)

    def describe(self, study: SampleStudy) -> str:
        """Return what the surrogate is trained on, in one line."""
        names = ", ".join(p.name for p in study.parameters)
        size = study.plan.size if study.plan else 0
        return f"{study.name}: {study.model} by {names}, up to {size} drops"

    def identity_files(self, study: SampleStudy) -> list[str]:
        """Return the name of the file."""
        return [surrogate_name(study)]

    def identity_in(self, path: Path) -> dict[str, str]:
        """Return the identity of results."""
        return read_surrogate(path).identity


KIND = SurrogateKind()


def surrogate(
    study: Source, output: str | os.PathLike[str] | None = None, **options: Unpack[RunOptions]
) -> Surrogate:
    """Train a surrogate: a fast approximation of the model for the option `surrogate` of studies.

    Each parameter of the study has `low` and `high`. Arguments and errors are those of `sweep`. The
    drops are kept, and an interrupted training is continued. InputError is also raised if a drop
    has no result or drops differ in their number of peaks, NumericalError if the error exceeds its
    bound with all drops.
    """
    return KIND.run(study, output, **options)
