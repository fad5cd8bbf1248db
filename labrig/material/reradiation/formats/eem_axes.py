"""Which axis of an excitation-emission matrix is which, by names or by Stokes' law.

Light is re-emitted at longer wavelengths (G. G. Stokes, 1852), so the signal is where the emission
is the longer of the two. Light that is merely scattered is left out: at the same wavelength, and in
higher orders of the grating at twice the wavelength.
"""

import numpy as np

from labrig.foundation.arrays import FloatArray
from labrig.material.reradiation.formats.eem_grid import Axis, Grid

#: Distance from a line of scattered light in nm from which light is fluorescence.
_BESIDE_NM = 15.0
#: Ratio of mean signals on both sides that tells one side from noise and stray light.
_CLEAR = 3.0
_OPTION = "say --rows emission or --rows excitation"


def emission_in_rows(grid: Grid, rows: Axis | None) -> tuple[bool, str]:
    """Return whether the rows of a grid are emission wavelengths, and by what, in words.

    Parameters
    ----------
    grid
        Intensities over two axes.
    rows
        What the rows are, as somebody says; None leaves it to the names and the signal.

    Raises
    ------
    ValueError
        Neither names nor signal tell it, or they contradict each other.
    """
    if rows is not None:
        return rows == "emission", ""
    told = _by_signal(grid)
    if grid.rows is not None:
        if told is not None and told != grid.rows:
            raise ValueError(
                f"expected light at longer wavelengths than those that excite it, got the rows "
                f"named {grid.rows} and the signal on the other side; {_OPTION}"
            )
        return grid.rows == "emission", ""
    if told is None:
        raise ValueError(
            "expected names of the axes or light on one side of the diagonal, which tells them, "
            f"got neither; {_OPTION}"
        )
    return told == "emission", f"rows are {told}: their side of the diagonal has the light"


def _by_signal(grid: Grid) -> Axis | None:
    """Return what the rows are by the side of the diagonal that has the light."""
    rows, columns = grid.row_nm[:, np.newaxis], grid.column_nm
    is_clear = np.isfinite(grid.intensity)
    for order in (1, 2, 3):
        is_clear &= np.abs(rows - order * columns) > _BESIDE_NM
        is_clear &= np.abs(columns - order * rows) > _BESIDE_NM
    in_rows = _mean(grid.intensity[is_clear & (rows > columns)])
    in_columns = _mean(grid.intensity[is_clear & (rows < columns)])
    if in_rows > _CLEAR * abs(in_columns):
        return "emission"
    if in_columns > _CLEAR * abs(in_rows):
        return "excitation"
    return None


def _mean(values: FloatArray) -> float:
    return float(values.mean()) if len(values) else 0.0
