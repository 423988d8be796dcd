"""The statistical level below floors against modal rooms under modal plates of random sizes.

    python tests/bench/modal_room_study.py [number of floors]

prints, for rooms of dwellings and for halls, and for positions that keep a distance from borders
or none, the energy mean of the modal levels less the statistical ones with its standard error, and
the spread of single positions beside the expected one.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "validation"))
from modal_rooms import DWELLINGS, HALLS, draw_differences, energy_mean


def main() -> None:
    """Print the study."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 60
    print(f"{'border; one-third octaves, Hz':37}", *(f"{f:6}" for f in (50, 63, 80, 100, 125, 160)))
    studies = {
        "dwellings, 0.5 m": (DWELLINGS, count, (3, 6), 0.5),
        "dwellings, 0 m": (DWELLINGS, count, (3, 6), 0.0),
        "halls, 0 m": (HALLS, count // 2, (2, 4), 0.0),
    }
    for name, study in studies.items():
        found, expected = draw_differences(*study)
        mean, error = energy_mean(found)
        rows = {
            "mean, dB": mean, "its error, dB": error,
            "spread, dB": found.std(axis=(0, 1)), "expected spread, dB": expected,
        }  # fmt: skip
        for title, values in rows.items():
            print(f"{name:17} {title:19}", *(f"{v:6.2f}" for v in values))


if __name__ == "__main__":
    main()
