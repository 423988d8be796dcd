"""Calls that need more memory than there is raise an error; the interpreter survives."""

from __future__ import annotations

import pytest
from conftest import python

# Each call gets a long array or asks for one.
CALLS = {
    "levels": "thud.force_exposure_levels(x, 44100.0)",
    "levels by FFT": "thud.force_exposure_levels(x, 44100.0, method='fft')",
    "low-pass": "levels.low_pass(x, 44100.0)",
    "peaks": "levels.peak_count(x, 44100.0)",
    "mobility": "thud.mobility(thud.Oscillator(), np.abs(x) + 1.0).values",
    "long drop": "thud.solve(duration=1.0, sample_rate=4e6)",
}
CODE = """
import resource
import numpy as np
import thud
from thud.level import levels
thud.solve()
x = np.zeros(20_000_000)
x[1000:2000] = 1.0
used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + {spare}, used + {spare}))
try:
    {call}
except (thud.NumericalError, MemoryError) as error:
    print(type(error).__name__)
else:
    print("done")
"""


@pytest.mark.parametrize("spare", [2**27, 2**29, 2**31])
@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
def test_a_call_without_enough_memory_is_an_error(call: str, spare: int) -> None:
    done = python("-c", CODE.format(call=call, spare=spare))
    assert done.returncode == 0, done.stderr[-500:]
    assert done.stdout.strip() in ({"NumericalError", "MemoryError"} if spare < 2**30 else
                                   {"NumericalError", "MemoryError", "done"})  # fmt: skip
