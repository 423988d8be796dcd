"""Copies of the project with environments of their own, where changes are made and tests run."""

from __future__ import annotations

import os
import queue
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from tqdm import tqdm

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from changes import Change

ROOT = Path(__file__).parents[2]
# Seconds that a test may take longer than three times what it took.
GRACE = 60
T = TypeVar("T")


class Tree:
    """A copy of the project.

    Parameters
    ----------
    folder
        Where it is made, or was made by an earlier run.
    flags
        Flags of the compilers.
    """

    def __init__(self, folder: Path, flags: str) -> None:
        self.root = folder / "project"
        self.build = folder / "build"
        self.venv = folder / "venv"
        self.python = self.venv / "bin/python"
        self._flags = flags
        self._changed = ""
        self._copy()

    def _copy(self) -> None:
        """Make the copy anew; the build goes on from the one before."""
        files = _run(["git", "ls-files"], ROOT).stdout.splitlines()
        shutil.rmtree(self.root, ignore_errors=True)
        for name in files:
            target = self.root / name
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, target)
        if not self.python.exists():
            _run([sys.executable, "-m", "venv", "--without-pip", str(self.venv)], ROOT)
            packages = next(self.venv.glob("lib/python*/site-packages"))
            known = next((ROOT / ".venv").glob("lib/python*/site-packages"))
            # Unlike a path alone, this heeds the files of the same kind there.
            (packages / "project.pth").write_text(f"import site; site.addsitedir({str(known)!r})\n")
        settings = {
            "build-dir": self.build,
            "cmake.build-type": "Mutants",
            "cmake.define.THUD_NATIVE": "ON",
            "cmake.define.THUD_TESTS": "ON",
            "cmake.define.CMAKE_Fortran_FLAGS": self._flags,
            "cmake.define.CMAKE_C_FLAGS": self._flags,
        }
        install = ["-m", "pip", "install", "--no-build-isolation", "--no-deps", "--force-reinstall"]
        given = [f"--config-settings={key}={value}" for key, value in settings.items()]
        done = _run([str(self.python), *install, *given, "."], self.root)
        if done.returncode:
            sys.exit(f"the build in {self.root} failed:\n{done.stdout[-3000:]}")
        self.installed = next(self.venv.glob("lib/python*/site-packages/thud")).parent

    def put(self, change: Change) -> bool:
        """Make a change in place of the one before; return whether it can be built."""
        text = (ROOT / change.path).read_text()
        stale = [change.path]
        if self._changed not in {"", change.path}:
            self._write(self._changed, (ROOT / self._changed).read_text())
            stale.append(self._changed)
        self._changed = change.path
        self._write(change.path, change.apply(text))
        return all(name.endswith(".py") for name in stale) or self._rebuild()

    def _write(self, name: str, text: str) -> None:
        installed = self.installed / Path(name).relative_to(Path(name).parts[0])
        for path in (self.root / name, installed):
            if path.exists():
                path.write_text(text)

    def _rebuild(self) -> bool:
        """Build what is installed; suites are built when they are run."""
        done = self._build("thud", "_core")
        for core in self.build.glob("src/api/_core*.so"):
            shutil.copy2(core, self.installed / "thud" / core.name)
        shutil.copy2(self.build / "src/thud", self.venv / "bin/thud")
        return done

    def _build(self, *targets: str) -> bool:
        command = ["cmake", "--build", str(self.build), "--target", *targets]
        return _run(command, self.root).returncode == 0

    def run_suite(self, name: str, **environment: str) -> bool:
        """Return whether a Fortran suite can be built and passes."""
        if not self._build(name):
            return False
        program = self.build / "tests/fortran" / name
        return _run([str(program)], program.parent, GRACE, **environment).returncode == 0

    def run_tests(
        self, names: Iterable[str], *more: str, seconds: float = 1800, **environment: str
    ) -> int:
        """Run Python tests up to the first that fails; return the exit code of pytest."""
        command = [str(self.python), *more] if more else [str(self.python), "-m", "pytest", "-x"]
        quiet = ["-q", "-p", "no:cacheprovider", "--no-header", "--tb=no"]
        listed = self.root.parent / "tests.txt"
        listed.write_text("\n".join(names))
        return _run([*command, *quiet, f"@{listed}"], self.root, seconds, **environment).returncode


def _run(
    command: list[str], folder: Path, seconds: float | None = None, **environment: str
) -> subprocess.CompletedProcess[str]:
    """Run a command in a session of its own, which ends as a whole when its time is over."""
    usual = {"PYTHONDONTWRITEBYTECODE": "1", "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    with subprocess.Popen(
        command,
        cwd=folder,
        env=os.environ | usual | environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        start_new_session=True,
        text=True,
        errors="replace",
    ) as process:
        try:
            said, _ = process.communicate(timeout=seconds)
        except BaseException:
            os.killpg(process.pid, 9)
            process.communicate()
            raise
    return subprocess.CompletedProcess(command, process.returncode, said)


def in_parallel(
    work: Callable[[Tree, T], None], trees: list[Tree], jobs: Iterable[T], unit: str
) -> None:
    """Do all jobs, one at a time in each tree, and show how many are done."""
    jobs = [*jobs]
    waiting: queue.SimpleQueue[T] = queue.SimpleQueue()
    for job in jobs:
        waiting.put(job)
    with (
        tqdm(total=len(jobs), unit=f" {unit}", disable=None) as bar,
        ThreadPoolExecutor(len(trees)) as pool,
    ):

        def go_on(tree: Tree) -> None:
            with suppress(queue.Empty):
                while True:
                    work(tree, waiting.get_nowait())
                    bar.update()

        try:
            for done in [pool.submit(go_on, tree) for tree in trees]:
                done.result()
        except BaseException:
            with suppress(queue.Empty):
                while True:
                    waiting.get_nowait()
            raise
