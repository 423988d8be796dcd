"""Commands in forks of a process that has imported all of thud, so that each starts at once.

`Forks` is the process as the campaign sees it; run as a script, this file is that process.
"""

from __future__ import annotations

import atexit
import ctypes
import importlib
import json
import os
import resource
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from functools import cache
from pathlib import Path
from pkgutil import walk_packages
from tempfile import TemporaryFile
from typing import IO, TYPE_CHECKING, NamedTuple, NoReturn

from injection import PATIENCE, executable, library

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

# Time for processes to follow the one that has started them, s.
FOLLOWING = 20.0
PR_SET_CHILD_SUBREAPER = 36
# Modules that thud imports when it needs them.
FURTHER = ("thud_driver", "distributed", "h5netcdf", "zarr", "matplotlib.backends.backend_agg",
           "matplotlib.backends.backend_svg", "xarray.backends.zarr")  # fmt: skip
# What is written where a study keeps a block, or a measurement a drop; see `_log_work`.
WORK = "work.log"


class Order(NamedTuple):
    """A command and what disturbs it.

    Attributes
    ----------
    command : list of str
        ``thud`` or ``thud-driver`` with its arguments.
    folder : str
        Its working directory.
    signals : sequence of tuple
        Pairs of a time after the start, s, and the signal that is sent then; a negative one goes to
        all processes that the command has started, too, as that of a terminal.
    env : mapping
        Changes of the environment, also those of `inject.c`.
    limits : mapping
        Limits of the process by the names of `resource`.
    humble : bool
        Take away the right of root to write everywhere.
    """

    command: list[str]
    folder: str
    signals: Sequence[tuple[float, int]] = ()
    env: Mapping[str, str] = {}
    limits: Mapping[str, int] = {}
    humble: bool = False


class Done(NamedTuple):
    """What became of a command: exit code, words on standard error, time, s, and the processes."""

    code: int
    said: str
    seconds: float
    left: bool


class Forks:
    """A process that has imported thud and forks for each command."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, __file__],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "LD_PRELOAD": library(), "LC_ALL": "C"},
        )

    def run(self, order: Order) -> Done:
        """Run a command."""
        assert self._process.stdin
        assert self._process.stdout
        self._process.stdin.write(json.dumps(order) + "\n")
        self._process.stdin.flush()
        return Done(*json.loads(self._process.stdout.readline()))


@cache
def forks() -> Forks:
    """Return the process that all parts share; it ends with this one."""
    return Forks()


def fail(order: Order, at: int, action: str) -> tuple[Done, list[str]]:
    """Run a command whose call of that number goes wrong, none for 0; return the calls, too.

    The action is that of `inject.c`; with "from there on" also all later calls go wrong.
    """
    log = Path(order.folder).with_suffix(".log")
    number, _, on = action.partition(" ")
    env = {"FAULT_AT": str(at), "FAULT_ACTION": number, "FAULT_LOG": str(log), **order.env}
    done = forks().run(order._replace(env=env | ({"FAULT_FROM": "1"} if on else {})))
    calls = log.read_text("utf-8", "replace").splitlines() if log.exists() else []
    log.unlink(missing_ok=True)
    return done, calls


def _answer(order: Order) -> Done:
    """Fork, send the signals, wait."""
    with TemporaryFile() as errors:
        start = time.monotonic()
        child = os.fork()
        if not child:
            _become(order, errors)
        # Both do it: nobody knows who is first.
        with suppress(PermissionError):
            os.setpgid(child, child)
        for delay, number in order.signals:
            time.sleep(max(0.0, start + delay - time.monotonic()))
            # Not waited for yet, so that the number is still its own.
            (os.kill if number > 0 else os.killpg)(child, abs(number))
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        seconds = time.monotonic() - start
        errors.seek(0)
        return Done(code, errors.read().decode("utf-8", "replace"), seconds, _left(child))


def _left(group: int) -> bool:
    """Return whether processes stay after the one that has started them; end them."""
    until = time.monotonic() + FOLLOWING
    try:
        while time.monotonic() < until:
            if os.waitpid(-group, os.WNOHANG)[0] == 0:
                time.sleep(0.01)
        os.killpg(group, signal.SIGKILL)
    except ChildProcessError:
        return False
    return True


def _become(order: Order, errors: IO[bytes]) -> NoReturn:
    """Be the command, in a group of processes of its own."""
    code = 70
    try:
        os.setpgid(0, 0)
        os.chdir(order.folder)
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_DFL)
        # Hung commands end by it.
        signal.alarm(PATIENCE)
        null = os.open(os.devnull, os.O_RDWR)
        for target, descriptor in enumerate((null, null, errors.fileno())):
            os.dup2(descriptor, target)
        if order.humble:
            _be_humble()
        os.closerange(3, 64)
        for name, most in order.limits.items():
            resource.setrlimit(getattr(resource, name), (most, most))
        # What goes wrong counts from here.
        os.environ.update(order.env)
        if order.command[0] == "thud":
            os.execv(executable(), order.command)  # noqa: S606 - that is the command
        sys.stdin, sys.stdout, sys.stderr = (
            open(target, mode, closefd=False)  # noqa: SIM115 - descriptors for its life
            for target, mode in ((0, "r"), (1, "w"), (2, "w"))
        )
        sys.argv = order.command
        code = _main()
    except SystemExit as stop:
        code = int(stop.code or 0)
    except BaseException:  # noqa: BLE001 - as an interpreter does
        sys.excepthook(*sys.exc_info())
        code = 1
    finally:
        os._exit(code)


def _main() -> int:
    import thud_driver

    code = thud_driver.main()
    # As an interpreter ends.
    threading._shutdown()  # type: ignore[attr-defined]  # noqa: SLF001
    atexit._run_exitfuncs()  # noqa: SLF001
    sys.stdout.flush()
    return code


def _be_humble() -> None:
    """Give up all rights of root, also for programs that are started."""
    if os.geteuid() != 0:
        return
    system = ctypes.CDLL(None, use_errno=True)
    no_root, securebits, version_3 = 1, 28, 0x20080522
    system.prctl(securebits, no_root, 0, 0, 0)
    head = (ctypes.c_uint32 * 2)(version_3, 0)
    if system.capset(head, (ctypes.c_uint32 * 6)()) != 0:
        raise OSError(ctypes.get_errno(), "capset")


def _log_work() -> None:
    """Make blocks small, wait shortly, freeze the date, write down what is kept."""
    from thud.impact import datasets
    from thud.studies import backends, blocks, samples

    samples._BLOCK_TIME = 0.005  # noqa: SLF001 - several blocks in a short time
    backends.WORKER_TIMEOUT, backends.CHECK_INTERVAL = 4.0, 0.5

    class Frozen(datasets.datetime):  # type: ignore[name-defined, misc]
        @classmethod
        def now(cls, zone: object = None) -> Frozen:
            return cls(2000, 1, 1, tzinfo=zone)

    datasets.datetime = Frozen  # type: ignore[attr-defined]

    def logged(kind: type, name: str) -> None:
        usual = getattr(kind, name)

        def log(self: object, first: object, *rest: object) -> None:
            usual(self, first, *rest)
            if "FAULT_AT" in os.environ:
                return
            done = f"{getattr(self, 'path', '')}:{getattr(first, 'start', first)}\n".encode()
            descriptor = os.open(WORK, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
            os.write(descriptor, done)
            os.close(descriptor)

        setattr(kind, name, log)

    logged(blocks.Blocks, "keep")


def _serve() -> None:
    """Answer commands, a line each, until the end of the input."""
    import tqdm

    import thud

    # Processes whose parent was killed become children of this one, which waits for them.
    ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    tqdm.tqdm.monitor_interval = 0
    _log_work()
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    for module in walk_packages(thud.__path__, "thud."):
        if module.name != "thud.__main__":
            importlib.import_module(module.name)
    for name in FURTHER:
        importlib.import_module(name)
    threads = len(list(Path("/proc/self/task").iterdir()))
    assert threads == 1, f"{threads} threads would be missing in forks"
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for line in sys.stdin:
        answers.write(json.dumps(_answer(Order(*json.loads(line)))) + "\n")
        answers.flush()


if __name__ == "__main__":
    _serve()
