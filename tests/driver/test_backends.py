"""Executors: the same results from each, also after lost workers and schedulers."""

from __future__ import annotations

import multiprocessing
import os
import signal
from concurrent.futures import CancelledError, Executor, Future, ProcessPoolExecutor
from typing import TYPE_CHECKING, Any

import pytest
from conftest import naming
from distributed import Client, LocalCluster

import thud
from thud.studies import run

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    import xarray as xr

# Samples of each status; by this method of the levels they make several blocks.
STUDY: dict[str, Any] = {
    "name": "some",
    "fixed": {"model": "hollow_sphere", "method": "fft"},
    "design": {"kind": "latin_hypercube", "size": 160, "seed": 2},
    "parameters": {
        "height": {"low": -2, "high": 60},
        "youngs_modulus": {"std": 0.5, "unit": "MPa"},
    },
}
# Of several blocks, too, which take some time.
MODAL: dict[str, Any] = {
    "design": {"kind": "random", "size": 160},
    "fixed": {"model": "modal_ball", "rings": 20},
    "parameters": {"height": {"low": 0.9, "high": 1.1}},
}


class Losing(Executor):
    """An executor that loses blocks with the given errors, None for a result."""

    def __init__(self, *lost: Exception | None) -> None:
        self.lost = iter(lost)

    def submit(self, function: Callable[..., Any], *block: Any) -> Future[Any]:  # type: ignore[override] # noqa: ANN401
        """Compute a block, or cancel it."""
        future: Future[Any] = Future()
        lost = next(self.lost, None)
        if isinstance(lost, CancelledError):
            future.cancel()
            future.set_running_or_notify_cancel()
        elif lost:
            future.set_exception(lost)
        else:
            future.set_result(function(*block))
        return future


@pytest.fixture(scope="module")
def cluster() -> Iterator[LocalCluster]:
    """Two workers in processes of their own."""
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as running:
        yield running


@pytest.fixture(scope="module")
def expected_modal() -> xr.Dataset:
    """Return the results of the slow study, without their origin."""
    return thud.sweep(MODAL, workers=2).dataset.drop_attrs(deep=False)


@pytest.mark.slow
def test_every_executor_gives_the_same(cluster: LocalCluster, tmp_path: Path) -> None:
    expected = thud.sweep(STUDY, workers=1).dataset.drop_attrs(deep=False)
    assert set(expected["status"].values) == {0, 1, 2}
    assert expected.sizes["sample"] > thud.read_study(STUDY).block_size
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(2, spawn) as processes, Client(cluster) as client:
        for executor in (None, processes, client.get_executor(), Losing(ValueError())):
            other = thud.sweep(STUDY, executor=executor).dataset
            assert other.drop_attrs(deep=False).identical(expected), executor
    other = thud.sweep(STUDY, tmp_path, workers=3).dataset
    assert other.drop_attrs(deep=False).identical(expected)


def kill_at_first_block(monkeypatch: pytest.MonkeyPatch, kill: Callable[[], None]) -> None:
    """Kill workers as soon as the first block is to be written."""
    write = run.write_dataset

    def kill_and_write(*block: Any) -> None:  # noqa: ANN401 - dataset and path
        monkeypatch.setattr(run, "write_dataset", write)
        kill()
        write(*block)

    monkeypatch.setattr(run, "write_dataset", kill_and_write)


@pytest.mark.slow
def test_killed_worker_of_dask_loses_nothing(
    cluster: LocalCluster,
    expected_modal: xr.Dataset,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with Client(cluster, set_as_default=False) as client:
        pids = list(client.run(os.getpid).values())
    kill_at_first_block(monkeypatch, lambda: os.kill(pids[0], signal.SIGKILL))
    with Client(cluster, set_as_default=False) as client:
        found = thud.sweep(MODAL, tmp_path, executor=client.get_executor()).dataset
    assert found.drop_attrs(deep=False).identical(expected_modal)


@pytest.mark.parametrize("is_killed", [True, False])
def test_lost_executor_is_reported_and_finished_blocks_are_kept(
    expected_modal: xr.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, is_killed: bool
) -> None:
    others = set(multiprocessing.active_children())

    def kill() -> None:
        for child in set(multiprocessing.active_children()) - others:
            child.kill()

    if is_killed:
        kill_at_first_block(monkeypatch, kill)
        executor: Executor = ProcessPoolExecutor(2, multiprocessing.get_context("spawn"))
    else:
        executor = Losing(None, None, *[CancelledError()] * 9)
    words = naming("executor", "run the study again", *([] if is_killed else ["Cancelled"]))
    with executor, pytest.raises(thud.NumericalError, match=words):
        thud.sweep(MODAL, tmp_path, executor=executor)
    finished = thud.read_sweep(tmp_path / "python.partial").dataset.sizes["sample"]
    assert 0 < finished < MODAL["design"]["size"]
    # A further run computes the others.
    found = thud.sweep(MODAL, tmp_path).dataset
    assert found.drop_attrs(deep=False).identical(expected_modal)
