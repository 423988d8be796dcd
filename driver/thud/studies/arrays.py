"""Types of arrays of numbers."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
# Samples by parameter, key or result, shape (n_sample, ...).
Columns: TypeAlias = dict[str, NDArray[Any]]
