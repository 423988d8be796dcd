"""Executors: the same results from each, also after lost workers and schedulers."""

from __future__ import annotations

import multiprocessing
import os
import re
import signal
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor
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

# Some of these samples fail; by this method of the levels they make several blocks.
STUDY: dict[str, Any] = {
    "name": "some",
    "fixed": {"method": "fft"},
    "design": {"kind": "latin_hypercube", "size": 2000, "seed": 2},
    "parameters": {
        "height": {"low": -0.1, "high": 60},
        "youngs_modulus": {"std": 0.5, "unit": "MPa"},
    },
}
# Of several blocks, too, which take some time.
MODAL: dict[str, Any] = {
    "design": {"kind": "random", "size": 160},
    "fixed": {"model": "modal_ball", "rings": 20},
    "parameters": {"height": {"low": 0.9, "high": 1.1}},
}
# A scheduler and a worker in one process, which can be killed.
DOOMED = """
from distributed import LocalCluster
cluster = LocalCluster(
    n_workers=1, threads_per_worker=1, processes=False, protocol="tcp", dashboard_address=":0"
)
print(cluster.scheduler_address, flush=True)
input()
"""
# A study whose samples a scheduler computes.
BY_DASK = """
import sys, thud
from distributed import Client
study, folder, address = sys.argv[1:]
executor = Client(address, set_as_default=False).get_executor()
thud.sweep(study, folder, executor=executor)
"""


@pytest.fixture(scope="module")
def cluster() -> Iterator[LocalCluster]:
    """Two workers in processes of their own."""
    with LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0"
    ) as running:
        yield running


@pytest.fixture(scope="module")
def expected() -> xr.Dataset:
    """Return the results of the study, computed one after the other, without their origin."""
    return thud.sweep(STUDY, workers=1).dataset.drop_attrs(deep=False)


@pytest.fixture(scope="module")
def expected_modal() -> xr.Dataset:
    """Return the results of the slow study."""
    return thud.sweep(MODAL, workers=2).dataset.drop_attrs(deep=False)


@pytest.mark.slow
def test_every_executor_gives_the_same(
    cluster: LocalCluster, expected: xr.Dataset, tmp_path: Path
) -> None:
    assert set(expected["status"].values) == {0, 1, 2}
    assert expected.sizes["sample"] > thud.read_study(STUDY).block_size
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(2, spawn) as processes, Client(cluster) as client:
        for executor in (None, processes, client.get_executor()):
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


def assert_goes_on(study: Path | dict[str, Any], partial: Path, expected: xr.Dataset) -> None:
    """Check that some blocks of a study are finished and that a further run computes the others."""
    finished = thud.read_sweep(partial).dataset.sizes["sample"]
    assert 0 < finished < MODAL["design"]["size"]
    found = thud.sweep(study, partial.parent).dataset
    assert found.drop_attrs(deep=False).identical(expected)


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


@pytest.mark.slow
def test_lost_scheduler_is_reported_and_its_study_goes_on_elsewhere(
    expected_modal: xr.Dataset, tmp_path: Path
) -> None:
    study = tmp_path / "some.toml"
    study.write_text(
        f"design = {{kind='random', size={MODAL['design']['size']}}}\n"
        "fixed = {model='modal_ball', rings=20}\nparameters.height = {low=0.9, high=1.1}"
    )
    with subprocess.Popen(
        [sys.executable, "-c", DOOMED], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as doomed:
        assert doomed.stdout
        address = doomed.stdout.readline().strip()
        command = [sys.executable, "-c", BY_DASK, str(study), str(tmp_path), address]
        process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
        while not list(tmp_path.glob("some.partial/block_*.nc")):
            assert process.poll() is None
            time.sleep(0.01)
        doomed.kill()
    _, errors = process.communicate()
    assert process.returncode == 1
    assert re.search(naming("NumericalError", "executor", "Cancelled"), errors)
    assert_goes_on(study, tmp_path / "some.partial", expected_modal)


def test_lost_process_is_reported_and_finished_blocks_are_kept(
    expected_modal: xr.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    others = set(multiprocessing.active_children())

    def kill() -> None:
        for child in set(multiprocessing.active_children()) - others:
            child.kill()

    kill_at_first_block(monkeypatch, kill)
    with (
        ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as processes,
        pytest.raises(thud.NumericalError, match=naming("executor", "run the study again")),
    ):
        thud.sweep(MODAL, tmp_path, executor=processes)
    assert_goes_on(MODAL, tmp_path / "python.partial", expected_modal)
