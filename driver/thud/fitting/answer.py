"""The answer of a fit with its figures and files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

from thud.case import write_case
from thud.checks import replace_file
from thud.fitting.result import Estimates

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping

    from matplotlib.figure import Figure


class Fit(Estimates):
    """What a fit came to; it draws itself and writes its files.

    Attributes, intervals and tables are those of `thud.fitting.result.Estimates`.
    """

    def figures(self, units: Mapping[str, tuple[str, float]] | None = None) -> dict[str, Figure]:
        """Return the figures by name; `units` as in `table`."""
        from thud.plot.fit import draw_fit  # noqa: PLC0415 - matplotlib takes its time

        return draw_fit(self, self.shown_units(units))

    def save(
        self,
        directory: str | os.PathLike[str],
        units: Mapping[str, tuple[str, float]] | None = None,
        *,
        figures: bool = True,
        **extra: object,
    ) -> list[Path]:
        """Write ``fit.json``, ``fit.csv``, ``fitted.nml`` and figures as PNG and SVG.

        Older files of these names are replaced.

        Parameters
        ----------
        directory
            Where they are written.
        units
            Other units of the figures by parameter, as in `table`; files have SI units.
        figures
            Draw the figures too.
        **extra
            What ``fit.json`` is to hold besides.

        Returns
        -------
        list of Path
            What was written.

        Raises
        ------
        OSError
            Where a file cannot be written.
        """
        folder = Path(directory)
        folder.mkdir(parents=True, exist_ok=True)
        paths = [folder / "fit.json", folder / "fit.csv", folder / "fitted.nml"]
        content = json.dumps({**self.summary(), **extra}, indent=2, allow_nan=False, default=str)
        replace_file(paths[0], f"{content}\n".encode())
        columns = self.misfit.columns(self.impact, self.time_shift)
        rows = [columns, *zip(*columns.values(), strict=True)]
        replace_file(paths[1], "".join(f"{','.join(map(str, row))}\n" for row in rows).encode())
        write_case(self.case, paths[2])
        if figures:
            from thud.plot.look import save_all  # noqa: PLC0415 - matplotlib takes its time

            paths += save_all(self.figures(units), folder)
        return paths
