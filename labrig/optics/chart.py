"""Reflectances of the patches of a colour chart."""

from labrig.foundation import resources
from labrig.foundation.errors import UsageError
from labrig.optics.curve_file import read_curve_file, read_transmittance
from labrig.optics.spectrum import Transmittance

#: Names of the patches of a ColorChecker, row by row; there are six in a row.
CHART_PATCHES = (
    "dark skin", "light skin", "blue sky", "foliage", "blue flower", "bluish green",
    "orange", "purplish blue", "moderate red", "purple", "yellow green", "orange yellow",
    "blue", "green", "red", "yellow", "magenta", "cyan",
    "white", "neutral 8", "neutral 6.5", "neutral 5", "neutral 3.5", "black",
)  # fmt: skip


def read_colour_chart(named: str) -> tuple[Transmittance, ...]:
    """Read the reflectances of the 24 patches of a ColorChecker.

    Parameters
    ----------
    named
        Name of the shipped table, `colorchecker`, or path of a file with a column for each patch.

    Returns
    -------
    tuple of Transmittance
        Reflectance of each patch, row by row from the brown one.

    Raises
    ------
    UsageError
        The file is malformed, has another number of curves, or its values are no fractions.

    Examples
    --------
    >>> from labrig.optics import read_colour_chart
    >>> patches = read_colour_chart("colorchecker")
    >>> len(patches), patches[18].at([450, 550, 650]).round(2).tolist()
    (24, [0.88, 0.91, 0.92])
    """
    file = read_curve_file(resources.curve_path(named))
    if len(file.curves) != len(CHART_PATCHES):
        raise UsageError(
            f"{file.path}: expected the {len(CHART_PATCHES)} patches of a ColorChecker, a column "
            f"for each, row by row from the brown one, got {len(file.curves)}"
        )
    return tuple(read_transmittance(file.path, name) for name in file.curves)
