# The extension that f2py makes from src/python/door.f90.
from typing import Any

thud_door: Any
