"""The engine of studies: samples in blocks, by threads or an executor, resumed where they are."""

from __future__ import annotations

from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, TypeVar, Unpack

from tqdm import tqdm

from thud.base.bridge import api, version
from thud.base.checks import refuse, refuse_unknown, require_kind, shown, thread_count
from thud.base.errors import InputError, NumericalError, ThudError
from thud.base.files import replace_file
from thud.impact.ensemble import solve_many
from thud.studies.dataset import (
    join_blocks,
    new_dataset,
    open_directory,
    provenance_of,
    read_dataset,
    remove,
    write_dataset,
)
from thud.studies.kinds import KINDS
from thud.studies.study import read_study, with_surrogate

if TYPE_CHECKING:
    import os
    from collections.abc import Iterable, Iterator

    import xarray as xr

    from thud.case.case import Case
    from thud.studies.arrays import Columns
    from thud.studies.study import Source, Study
    from thud.studies.study_result import SampleResult
    from thud.studies.trained_surrogate import Surrogate

R = TypeVar("R", bound="SampleResult")

# Number of blocks that an executor of the caller has at a time: its width is not known.
_SUBMITTED = 256


class RunOptions(TypedDict, total=False):
    """How a study is computed.

    Attributes
    ----------
    workers : int or None
        Number of threads; by default one per processor.
    executor : concurrent.futures.Executor or None
        Computes the samples instead, with the same results: processes, or machines by the
        `get_executor` of a Dask client.
    progress : bool
        Show a progress bar.
    replace : bool
        Replace results of another version of the study, and files not written by thud.
    case : Case or None
        The case of a study that states none; by default the standard ball.
    surrogate : Surrogate or str or None
        Surrogate, or the path of its file, that predicts the samples instead of the model.
    """

    workers: int | None
    executor: Executor | None
    progress: bool
    replace: bool
    case: Case | None
    surrogate: Surrogate | str | os.PathLike[str] | None


def compute(
    result: type[R],
    source: Source,
    output: str | os.PathLike[str] | None = None,
    **options: Unpack[RunOptions],
) -> R:
    """Return the result of a study, also written to a directory; see `thud.sweep` and `run`.

    Raises InputError, with the first reason, if no sample has a result.
    """
    refuse_unknown("keywords", options, RunOptions.__annotations__)
    study = read_study(source, result.kind, options.get("case"))
    if (surrogate := options.get("surrogate")) is not None:
        study = with_surrogate(study, surrogate)
    result.check(study)
    try:
        dataset = run(study, output, **options)
        if dataset["status"].all():
            reason = dataset["reason"].to_numpy().flat[0]
            message = f"none of {study.count} samples has a result: {reason}"
            raise InputError(message)
        computed = result(dataset)
    except MemoryError as error:
        refuse(f"{study.count} samples do not fit in memory", "fewer samples", error)
    if output is not None and (end := KINDS[study.kind].table):
        table = computed.to_dataframe()
        text = table.to_csv(float_format="%.6g", na_rep="nan", lineterminator="\n")
        replace_file(Path(output, f"{study.name}{end}"), text.encode())
    return computed


def run(
    study: Study, path: str | os.PathLike[str] | None = None, **options: Unpack[RunOptions]
) -> xr.Dataset:
    """Return the results of all samples of a study; a sample that fails has a status and a reason.

    With a directory, each block of samples is a file in ``NAME.partial`` as soon as it is done, and
    ``NAME.nc`` has all of them in the end; finished blocks are not computed again.

    Parameters
    ----------
    study
        The study.
    path
        Directory of the results.
    **options
        See `RunOptions`.

    Raises
    ------
    InputError
        If an option cannot be used, or files are in the way.
    NumericalError
        If the executor loses samples.
    OSError
        If results cannot be read or written.
    """
    # Raises InputError for a design that does not fit in memory.
    study.parameter_columns(0, 1)
    file = partial = None
    if path is not None:
        file, partial = open_directory(path, study, replace=options.get("replace", False))
        if file.exists():
            remove(partial)
            return read_dataset(file)
        partial.mkdir(exist_ok=True)
    starts = range(0, study.count, study.block_size)
    missing = [s for s in starts if not (partial and _block(partial, s).exists())]
    finished: dict[int, xr.Dataset] = {}
    provenance = provenance_of(study)
    with (
        _executor(options) as (executor, limit),
        tqdm(total=study.count, unit="sample", disable=not options.get("progress")) as bar,
    ):
        bar.update(max(0, study.count - len(missing) * study.block_size))
        for start, columns, result in _compute(study, missing, executor, limit):
            block = new_dataset(study, columns, result, provenance)
            if partial:
                write_dataset(block, _block(partial, start))
            else:
                finished[start] = block
            bar.update(block.sizes["sample"])
    if file is None or partial is None:
        return join_blocks(study, [finished[start] for start in starts])
    blocks = [read_dataset(_block(partial, start)) for start in starts]
    # A run of another version that replaces the results at the same time writes there as well.
    if any(block.attrs["identity"] != provenance["identity"] for block in blocks):
        remove(partial)
        refuse(f"{partial} has got blocks of another version of this study", "run it again")
    write_dataset(join_blocks(study, blocks), file)
    remove(partial)
    return read_dataset(file)


def describe(study: Study) -> str:
    """Return the number of samples of a study, and what computes them."""
    by = f" by a surrogate of {len(study.surrogate.points)} drops" if study.surrogate else ""
    return f"{study.name}: {study.count} samples of {study.model}{by}"


def _block(partial: Path, start: int) -> Path:
    """Return the file of the block that begins with a sample."""
    return partial / f"block_{start:012d}.nc"


@contextmanager
def _executor(options: RunOptions) -> Iterator[tuple[Executor, int]]:
    """Yield the executor, and the number of blocks that it has at a time."""
    workers, executor = options.get("workers"), options.get("executor")
    if executor is not None:
        require_kind("executor", executor, Executor)
        if workers is not None:
            refuse(f"workers = {shown(workers)} with an executor", "none: it has its own workers")
        yield executor, _SUBMITTED
        return
    width = thread_count("workers", workers)
    with ThreadPoolExecutor(width) as threads:
        try:
            yield threads, 2 * width
        except KeyboardInterrupt:
            threads.shutdown(wait=False, cancel_futures=True)
            api.end_calls()
            raise


def _compute(
    study: Study, starts: Iterable[int], executor: Executor, limit: int
) -> Iterator[tuple[int, Columns, Columns]]:
    """Yield first sample, parameters and results of each block, in the order of their results.

    Raises NumericalError if the executor loses a block twice, after all blocks that are done.
    """
    waiting = iter(starts)
    lost: set[int] = set()
    running: dict[Future[Columns], tuple[int, Columns]] = {}
    try:
        while True:
            for start in islice(waiting, limit - len(running)):
                stop = min(start + study.block_size, study.count)
                columns = study.parameter_columns(start, stop)
                future = _submit(executor, study, study.key_columns(columns), version())
                running[future] = start, columns
            if not running:
                return
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            # Blocks that the executor has lost are the last.
            for future in sorted(done, key=lambda f: f.cancelled() or f.exception() is not None):
                start, columns = running.pop(future)
                try:
                    result = future.result()
                except ThudError:
                    raise
                except Exception as error:
                    # Dask loses one if the worker ends while its result is on the way.
                    if start not in lost and not future.cancelled():
                        lost.add(start)
                        again = _submit(executor, study, study.key_columns(columns), version())
                        running[again] = start, columns
                        continue
                    reason = f"{type(error).__name__}: {error}".partition("\n")[0]
                    message = (
                        f"the executor lost a block of samples ({reason.removesuffix(': ')}); "
                        "finished samples are kept; allowed: run the study again"
                    )
                    raise NumericalError(message) from error
                yield start, columns, result
    finally:
        for future in running:
            future.cancel()


def _submit(executor: Executor, *block: Any) -> Future[Columns]:  # noqa: ANN401 - of `evaluate`
    """Return the future of a block; of an executor that has ended, one that failed."""
    try:
        return executor.submit(evaluate, *block)
    except Exception as error:  # noqa: BLE001 - those of any executor
        lost: Future[Columns] = Future()
        lost.set_exception(error)
        return lost


def evaluate(study: Study, columns: Columns, required: str) -> Columns:
    """Return the results of samples by names as in `RESULTS`; NaN for a failed sample.

    `columns` are the values, shape (n_sample,), of the keys in which samples differ from the case
    of the study. Raise InputError if this is not the required version of thud, that of the process
    which submits the samples.
    """
    if required != version():
        refuse(
            f"thud {version()} cannot compute samples of thud {required}",
            "the same version everywhere",
        )
    if study.surrogate:
        return study.surrogate.predict(study.case, columns)
    # The number of peaks, which a surrogate must know, follows from the forces.
    forces = study.kind == "surrogate"
    results = solve_many(columns, study.case, threads=1, forces=forces).results
    results["status"] = results["status"].astype("int8")
    return results
