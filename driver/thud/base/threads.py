"""Matrix products by one thread."""

from __future__ import annotations

from contextlib import contextmanager
from threading import Lock
from typing import TYPE_CHECKING

from threadpoolctl import OpenBLASController, threadpool_limits

if TYPE_CHECKING:
    from collections.abc import Iterator

_LOCK = Lock()
# The limit that is in force, once for each that needs it.
_LIMITS: list[threadpool_limits] = []


def limit_threads() -> threadpool_limits:
    """Limit matrix products of this process to one thread: of all libraries that are loaded."""
    limit = threadpool_limits(1, "blas")
    # Else no other thread may restore what was before.
    OpenBLASController.clear_controlling_thread()
    return limit


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit matrix products to one thread until the last that needs it has ended.

    The limit is that of the process: restored by each, it would be what another one had set.
    """
    with _LOCK:
        _LIMITS.append(_LIMITS[0] if _LIMITS else limit_threads())
    try:
        yield
    finally:
        with _LOCK:
            limit = _LIMITS.pop()
            if not _LIMITS:
                limit.restore_original_limits()
                OpenBLASController.clear_controlling_thread()
