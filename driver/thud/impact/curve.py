"""Results with many rows, such as histories and spectra."""

from __future__ import annotations

import numpy as np

from thud.base.display import Tabulated, column_rows

# Approximate number of rows of the text.
_N_ROW = 10


class Curve(Tabulated):
    """Base of tables whose text has about ten of their rows."""

    def rows(self) -> list[tuple[str, ...]]:
        """Return the header and about ten rows of text, from the first on at equal distances."""
        columns = {
            title: (np.asarray(values), form) for title, (values, form) in self.columns().items()
        }
        step = max(1, max(len(values) for values, _ in columns.values()) // _N_ROW)
        return column_rows({t: (values[::step], form) for t, (values, form) in columns.items()})
