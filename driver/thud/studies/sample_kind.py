"""Kinds of studies that compute samples of drops: design, blocks, dataset."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar, Unpack

from thud.base._schema import KEYS
from thud.base.checks import refuse
from thud.case.case import impact_only
from thud.case.keys import DENSITY, OUTPUT_GROUP, value_in
from thud.studies.backends import require_workers
from thud.studies.blocks import compute_samples, read_identity, result_names
from thud.studies.dataset import disk_space
from thud.studies.directory import FORMATS, StudyDirectory
from thud.studies.kind import Kind
from thud.studies.parameter import read_varied
from thud.studies.samples import SampleStudy
from thud.studies.sampling import read_design
from thud.studies.study import table_of
from thud.studies.study_result import StudyResult
from thud.studies.temperature import read_temperature
from thud.studies.trained_surrogate import stated_surrogate

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    import xarray as xr

    from thud.case.case import Case
    from thud.studies.kind import RunOptions
    from thud.studies.parameter import Parameter
    from thud.studies.study import Study
    from thud.studies.trained_surrogate import Surrogate

R = TypeVar("R", bound=StudyResult)

# Maximum number of samples without `allow_large`.
MAX_SAMPLES = 100_000


def _require_no_floor(case: Case) -> None:
    """Raise InputError for a case with a floor, which surrogates do not model."""
    if case.floor:
        refuse("[surrogate] is not allowed with a floor", "a case without &floor")


class DropsKind(Kind[SampleStudy, R]):
    """A kind of study that computes many variations of its case."""

    own_keys: ClassVar[tuple[str, ...]] = ("design", "temperature", "surrogate")
    # Sampling designs that are allowed, the default first.
    designs: ClassVar[tuple[str, ...]]

    def new_parameter(
        self, name: str, entry: object, case: Case, density: float | None
    ) -> Parameter:
        """Return a parameter that varies."""
        if name == "bands":
            refuse(
                "[parameters] bands is not allowed", "bands in [fixed], the same for all samples"
            )
        mean = density if name == DENSITY.name else value_in(case, name)
        return read_varied(name, entry, case, mean)

    def complete(self, study: Study, content: Mapping[str, Any], folder: Path) -> SampleStudy:
        """Return a study with its sampling design."""
        table = table_of(content, "temperature") if "temperature" in content else None
        temperature = read_temperature(table, study.case, study.parameters)
        design = read_design(table_of(content, "design"), self.designs, study.parameters)
        # Samples need no snapshots, free modes, compression or unknowns.
        case = impact_only(study.case)
        model_keys = (key for key in KEYS if key.owner == study.model)
        files = {key.name: 0.0 for key in model_keys if key.group == OUTPUT_GROUP}
        if case.model and files:
            case = replace(case, model=replace(case.model, **files))  # type: ignore[arg-type]
        common = {**vars(study), "case": case}
        result = SampleStudy(**common, **design, temperature=temperature)
        if "surrogate" not in content:
            return result
        _require_no_floor(case)
        return self.with_surrogate(result, stated_surrogate(table_of(content, "surrogate"), folder))

    def with_surrogate(self, study: SampleStudy, trained: Surrogate) -> SampleStudy:
        """Return a study whose samples a surrogate predicts; raise InputError if it cannot."""
        _require_no_floor(study.case)
        trained.require(study.case, study.key_columns(study.parameter_columns(0, 1)))
        return replace(study, surrogate=trained)

    def require_runnable(self, study: SampleStudy, **options: Unpack[RunOptions]) -> None:
        """Raise InputError for too many samples or a useless number of workers."""
        if study.count > MAX_SAMPLES and not options.get("allow_large"):
            refuse(
                self.describe(study),
                f"up to {MAX_SAMPLES} samples, or allow_large=True (--yes)",
            )
        require_workers(options.get("workers"), options.get("executor"))

    def listed_files(self, study: SampleStudy) -> list[str]:
        """Return the names of the figures."""
        return [f"{study.name}{ending}" for ending in FORMATS]


class SampleKind(DropsKind[R]):
    """A kind of study that computes samples of drops."""

    def describe(self, study: SampleStudy) -> str:
        """Return the number of samples of a study and its size on disk."""
        space = disk_space(study) / 1e6
        amount = f"{space / 1e3:.3g} GB" if space > 1e3 else f"{space:.2g} MB"  # noqa: PLR2004
        by = ""
        if study.surrogate:
            by = f" by a surrogate of {len(study.surrogate.points)} drops"
        return f"{study.name}: {study.count} samples of {study.model}{by}, about {amount} on disk"

    def compute(
        self, study: SampleStudy, results: StudyDirectory | None, **options: Unpack[RunOptions]
    ) -> R:
        """Compute missing samples; return the result of all samples."""
        try:
            folder = results.folder if results else None
            return self.new_result(study, compute_samples(study, folder, options))
        except MemoryError as error:
            refuse(f"{study.count} samples do not fit in memory", "fewer samples", error)

    @abstractmethod
    def new_result(self, study: SampleStudy, dataset: xr.Dataset) -> R:
        """Return the result of all samples."""

    def identity_files(self, study: SampleStudy) -> list[str]:
        """Return the names of the dataset and of the directory of blocks."""
        return result_names(study)

    def identity_in(self, path: Path) -> dict[str, str] | None:
        """Return the identity of results."""
        return read_identity(path)
