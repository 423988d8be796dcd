"""Matrix products in one thread."""

from __future__ import annotations

from contextlib import contextmanager
from threading import Lock
from typing import TYPE_CHECKING

from threadpoolctl import OpenBLASController, threadpool_limits

if TYPE_CHECKING:
    from collections.abc import Iterator

_LOCK = Lock()
# The active limit, once for each caller.
_LIMITS: list[threadpool_limits] = []


def limit_threads() -> threadpool_limits:
    """Limit matrix products of this process, by all loaded libraries, to one thread."""
    limit = threadpool_limits(1, "blas")
    # Otherwise no other thread may restore the previous limit.
    OpenBLASController.clear_controlling_thread()
    return limit


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit matrix products to one thread until the last caller has ended.

    The limit applies to the process, so that only the last caller may restore it.
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
