# The extension that f2py makes from the procedures in src/api.
from typing import Any

thud_api: Any
thud_level_api: Any
thud_ensemble_api: Any
thud_mobility_api: Any
thud_floor_api: Any
