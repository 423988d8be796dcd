"""The library that lets a call of the system go wrong; see `inject.c`."""

from __future__ import annotations

import os
import shutil
import subprocess
from functools import cache
from pathlib import Path
from tempfile import mkdtemp


@cache
def library() -> str:
    """Return the path of the compiled library of faults."""
    target = Path(mkdtemp(prefix="thud_faults_")) / "inject.so"
    source = Path(__file__).with_name("inject.c")
    command = [os.environ.get("CC", "cc"), "-shared", "-fPIC", "-O1", "-o", target, source, "-ldl"]
    subprocess.run(command, check=True)
    return str(target)


def injecting(**faults: object) -> dict[str, str]:
    """Return the environment of a process whose calls go wrong; the words are of `inject.c`."""
    named = {f"FAULT_{name.upper()}": str(value) for name, value in faults.items()}
    return {**os.environ, "LD_PRELOAD": library(), **named}


def can_inject() -> bool:
    """Return whether a compiler is here."""
    return shutil.which(os.environ.get("CC", "cc")) is not None
