# The extension that f2py makes from the doors in src/python.
from typing import Any

thud_door: Any
thud_level_door: Any
thud_ensemble_door: Any
