"""Backends: the same results from each, whatever happens to workers and schedulers."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from distributed import Client, LocalCluster

import thud
from thud import cli
from thud.studies import sets
from thud.studies.backends import run_blocks
from thud.studies.evaluation import Block, block_size, evaluate

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

# Some of these sets fail; by this method of the levels they make several blocks.
STUDY: dict[str, Any] = {
    "name": "some",
    "fixed": {"method": "fft"},
    "design": {"kind": "latin_hypercube", "size": 400, "seed": 2},
    "parameters": {
        "height": {"low": -0.1, "high": 60},
        "youngs_modulus": {"std": 0.5, "unit": "MPa"},
    },
}
BLOCKS = 12


@pytest.fixture(scope="module")
def cluster() -> Iterator[LocalCluster]:
    """Two workers in processes of their own."""
    with LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0"
    ) as running:
        yield running


def test_every_backend_gives_the_same(cluster: LocalCluster) -> None:
    one = thud.sweep(STUDY, workers=1)
    assert set(one["status"].values) == {0, 1, 2}
    assert one.sizes["set"] > block_size(thud.read_study(STUDY).base)
    for how in (
        {"workers": 3},
        {"backend": "processes", "workers": 2},
        {"scheduler": cluster.scheduler_address},
    ):
        other = thud.sweep(STUDY, **how)  # type: ignore[arg-type]
        assert other.drop_attrs(deep=False).identical(one.drop_attrs(deep=False)), how


def test_threads_of_a_block_do_not_matter() -> None:
    block = Block(0, thud.Case(), {"height": np.linspace(0, 60, 200)}, thud.__version__)
    one, more = evaluate(block), evaluate(block, 3)
    for name, values in one.items():
        np.testing.assert_array_equal(more[name], values)


def modal_blocks() -> list[Block]:
    """Return blocks that take long enough to lose their worker."""
    study = thud.read_study({"parameters": {"height": {"low": 1, "high": 2, "count": 20}}})
    base = thud.Case(model=thud.ModalBall())
    return [
        Block(20 * i, base, sets.parameter_columns(study, 0, 20), thud.__version__)
        for i in range(BLOCKS)
    ]


def test_killed_worker_of_dask_loses_nothing(cluster: LocalCluster) -> None:
    blocks = modal_blocks()
    with Client(cluster) as client:
        pids = list(client.run(os.getpid).values())
    kept: dict[int, dict[str, Any]] = {}

    def keep(block: Block, found: dict[str, Any]) -> None:
        if not kept:
            os.kill(pids[0], signal.SIGKILL)
        kept[block.start] = found

    run_blocks(blocks, keep, scheduler=cluster.scheduler_address)
    expected = evaluate(blocks[0])
    assert sorted(kept) == [block.start for block in blocks]
    for found in kept.values():
        for name, values in expected.items():
            np.testing.assert_array_equal(found[name], values)


def test_killed_process_is_told_and_loses_nothing() -> None:
    kept = []
    others = set(multiprocessing.active_children())

    def keep(block: Block, _: dict[str, Any]) -> None:
        kept.append(block.start)
        for child in set(multiprocessing.active_children()) - others:
            child.kill()

    with pytest.raises(thud.NumericalError, match=r"lost a block.*kept; allowed: run the study ag"):
        run_blocks(modal_blocks(), keep, "processes", 2)
    assert kept


def test_unreachable_scheduler_is_told_soon(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("thud.studies.backends.PATIENCE", 1)
    path = tmp_path / "study.toml"
    path.write_text("parameters.height.values = [1]")
    begin = time.monotonic()
    for address in ("tcp://127.0.0.1:9", "nonsense://"):
        arguments = ["sweep", "-q", str(path), "-o", str(tmp_path), "--scheduler", address]
        assert cli.main(arguments) == 1
        errors = capsys.readouterr().err
        assert f"scheduler = '{address}' does not answer" in errors
        assert errors.count("\n") == 1
    assert time.monotonic() - begin < 5


def test_scheduler_without_workers_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("thud.studies.backends.PATIENCE", 1)
    with (
        LocalCluster(n_workers=0, processes=False, dashboard_address=":0") as empty,
        pytest.raises(thud.InputError, match="has no workers; allowed: one with"),
    ):
        thud.sweep(STUDY, scheduler=empty.scheduler_address)


def test_other_version_is_told() -> None:
    block = Block(0, thud.Case(), {"height": np.ones(1)}, "0.0.1")
    with pytest.raises(thud.InputError, match=r"sets of thud 0\.0\.1; allowed: the same version"):
        evaluate(block)


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ({"backend": "gpu"}, "backend = 'gpu' is not known; allowed: threads, processes, dask"),
        ({"backend": "dask"}, "allowed: the address of a scheduler for dask"),
        ({"backend": "threads", "scheduler": "tcp://x:1"}, "and only there"),
        ({"workers": 0}, "workers = 0 is not allowed; allowed: 1 <= workers"),
        ({"workers": 2, "scheduler": "tcp://x:1"}, "not for dask"),
    ],
)
def test_useless_backends_are_told(how: dict[str, Any], words: str) -> None:
    with pytest.raises(thud.InputError, match=words):
        thud.sweep(STUDY, **how)
