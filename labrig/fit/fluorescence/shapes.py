"""Shapes of emission spectra among which a fit chooses, by their prior probability."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.optics import Spectrum, edges_from_centres

#: Peaks in nm, full widths at half maximum in nm, and skews of the shapes that are tried.
PEAKS_NM = np.arange(400.0, 721.0, 10.0)
WIDTHS_NM = (22.0, 32.0, 46.0, 65.0, 92.0)
SKEWS = (0.0, 0.2, 0.4)
#: Dyes' widths and skews, log-normal and normal: median and standard deviation.
MEDIAN_WIDTH_NM, LOG_WIDTH_SIGMA = 50.0, 0.45
MEAN_SKEW, SKEW_SIGMA = 0.19, 0.2
#: The side of long wavelengths falls as (1 + TAIL x²)^−TAIL_POWER, x in half widths: at 2 and 3
#: half widths it has 16 and 6 % of the maximum, measured papers and textiles 16 and 3 %, and 516
#: dyes of the index of McNamara and Boswell 20 and 9 % in the median.
TAIL_POWER = 1.5
TAIL = 2 ** (1 / TAIL_POWER) - 1
#: Part of the prior probability that a library of measured emissions has.
LIBRARY_SHARE = 0.5
#: Step in nm on which a shape is averaged in bands.
STEP_NM = 1.0
#: Least part of an emission of a library that must lie in the output bands.
LEAST_INSIDE = 0.5


@dataclass(frozen=True, eq=False)
class EmissionShapes:
    """Emission spectra with unit integral.

    Attributes
    ----------
    names
        Name of each shape.
    peak_nm
        Its maximum in nm, shape (s,).
    value
        Mean in each output band, in 1/nm, shape (s, o).
    log_prior
        Logarithm of its prior probability, shape (s,).
    is_measured
        Whether it is an emission of the library, shape (s,).
    """

    names: tuple[str, ...]
    peak_nm: FloatArray
    value: FloatArray
    log_prior: FloatArray
    is_measured: NDArray[np.bool_]


def emission_shapes(output_nm: FloatArray, library: Sequence[Spectrum] = ()) -> EmissionShapes:
    """Return skewed bells of all peaks, widths and skews, and the emissions of a library.

    A bell is a Gaussian below its maximum and has a longer tail above it; the half widths on both
    sides have the ratio exp(2 · skew).

    Parameters
    ----------
    output_nm
        Middles of the output bands in nm, shape (o,).
    library
        Measured emissions on any scale. Half of the prior probability is theirs.

    Raises
    ------
    UsageError
        An emission of the library is not positive, or most of it lies outside of the bands.
    """
    edges = edges_from_centres(output_nm)
    grid_nm = np.arange(edges[0], edges[-1] + STEP_NM, STEP_NM)
    names, peaks, values, weights = [], [], [], []
    for peak in PEAKS_NM.tolist():
        if not edges[0] < peak < edges[-1]:
            continue
        for width in WIDTHS_NM:
            for skew in SKEWS:
                half = width / 2 * np.exp(np.where(grid_nm < peak, -skew, skew))
                away = (grid_nm - peak) / half
                tail = (1 + TAIL * away**2) ** -TAIL_POWER
                bell = Spectrum("", grid_nm, np.where(away < 0, 0.5 ** (away**2), tail))
                names.append(f"{peak:g} nm, width {width:g} nm, skew {skew:g}")
                peaks.append(peak)
                values.append(bell.in_bands(edges))
                weights.append(
                    -((np.log(width / MEDIAN_WIDTH_NM) / LOG_WIDTH_SIGMA) ** 2) / 2
                    - ((skew - MEAN_SKEW) / SKEW_SIGMA) ** 2 / 2
                )
    probability = np.exp(weights)
    probability *= (1 - LIBRARY_SHARE if library else 1.0) / probability.sum()
    for emission in library:
        banded = emission.in_bands(edges)
        inside = float(banded @ np.diff(edges))
        whole = float(np.trapezoid(emission.value, emission.wavelength_nm))
        if not (whole > 0 and inside >= LEAST_INSIDE * whole):
            raise UsageError(
                f"emission '{emission.name}': expected positive light, most of it from "
                f"{edges[0]:g} to {edges[-1]:g} nm, got {max(inside, 0.0):.3g} of {whole:.3g} "
                "there; leave it out"
            )
        names.append(emission.name)
        peaks.append(float(output_nm[np.argmax(banded)]))
        values.append(np.maximum(banded, 0.0))
    probability = np.append(
        probability, np.full(len(library), LIBRARY_SHARE / max(len(library), 1))
    )
    table = np.array(values)
    return EmissionShapes(
        tuple(names),
        np.array(peaks),
        table / (table @ np.diff(edges))[:, np.newaxis],
        np.log(probability),
        np.arange(len(names)) >= len(names) - len(library),
    )
