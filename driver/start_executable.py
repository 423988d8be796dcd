#!python
"""The script `thud` of a wheel: it becomes the executable, which stands in the package."""

import importlib.util
import os
import sys

(package,) = importlib.util.find_spec("thud").submodule_search_locations
os.execv(f"{package}/lib/thud", sys.argv)  # noqa: S606
