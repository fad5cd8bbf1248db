"""Expectation of a surface before it is photographed: normal densities and shapes of its curves.

Reflectances are about a half, and smooth. A dye is excited below its emission's peak, by a curve
that is smooth, too, and falls off towards the ultraviolet. Amplitudes are chosen by the data.
The numbers describe measured re-radiation matrices; they are no fit to any one of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import UsageError
from labrig.optics import Spectrum, edges_from_centres

#: Mean reflectance, standard deviation of its level and correlation length of its course in nm.
REFLECTANCE, LEVEL_SIGMA, REFLECTANCE_NM = 0.5, 0.5, 90.0
#: Standard deviations of a reflectance's course that are tried, the usual one first.
REFLECTANCE_SIGMAS = (0.2, 0.1, 0.4)
#: Standard deviations of the excitation, a fraction of the incident light, that are tried.
EXCITATION_SIGMAS = (0.03, 0.1, 0.3, 0.7)
#: The excitation ends this far below the emission's peak, within a few times a width, in nm: of
#: dyes that emit in the blue farther than of others, and with a spread. Of the 47 dyes of the index
#: of McNamara and Boswell with peaks from 380 nm to 460 nm it falls to one half about 40 nm below
#: the peak, of the 459 from 490 nm on at 5 nm to 11 nm.
STOKES_NM, STOKES_WIDTH_NM = 15.0, 8.0
BLUE_STOKES_NM, BLUE_SPREAD_NM = 40.0, 13.0
#: Peaks in nm below which a dye emits in the blue, and above which it does not.
BLUE_NM = (455.0, 500.0)
#: Points of the spread of a normal density and their weights, by Gauss and Hermite.
SPREAD, SPREAD_WEIGHT = np.polynomial.hermite_e.hermegauss(5)
#: How far below the peak it begins to fall, and over which distance by e, in nm.
PLATEAU_NM, DECAY_NM = 60.0, 90.0
#: Where most materials begin to absorb ultraviolet themselves, over which width, and what is left,
#: in nm and as a fraction.
ULTRAVIOLET_NM, ULTRAVIOLET_WIDTH_NM, ULTRAVIOLET_LEFT = 342.0, 14.0, 0.15
#: How far below the peak deviations from the usual course end, in nm.
BEYOND_NM = -5.0
#: Part of the excitation's variance that is its usual course, and correlation length of the rest.
USUAL_PART, EXCITATION_NM = 0.5, 35.0
#: Standard deviations that are tried of light of all wavelengths that no dye explains (stray light,
#: a pedestal of the lights' spectra), as re-radiation in 1/nm, independent for each light.
BACKGROUND_SIGMAS = (5e-6, 5e-5)
#: Error of an emission's peak in nm and of the logarithm of its width by the steps of the shapes.
SHIFT_NM, LOG_WIDTH = 4.0, 0.1
#: Deviation of an emission from its shape, over the geometric mean of the emission and its maximum;
#: what is added to the emission for that, over its maximum; and correlation length in equivalent
#: widths. Of measured dyes it is 4 to 9 % of the maximum from half a width below to two above.
EMISSION_SIGMA, EMISSION_FLOOR, EMISSION_WIDTHS = 0.15, 1e-3, 0.5
#: Distance in nm above the exciting wavelength over which an emission sets in, in the median, and σ
#: of its logarithm.
EDGE_NM, LOG_EDGE_SIGMA = 8.0, 0.7
#: Part of the deviation's variance that is the same whatever light excites (Kasha's rule).
SAME_EMISSION = 0.9


def reflectance_covariance(output_nm: FloatArray, sigma: float) -> FloatArray:
    """Return the covariance of the reflectance between wavelengths, shape (o, o)."""
    return LEVEL_SIGMA**2 + sigma**2 * _smooth(output_nm, REFLECTANCE_NM)


def excitation_covariance(input_nm: FloatArray, peak_nm: float) -> FloatArray:
    """Return the second moment of the excitation of a dye, for an amplitude of 1, shape (i, i).

    It is that of u(λ) z + v(λ) g(λ), with u the usual course, z and g normal, and v the envelope
    of deviations.
    """
    below_nm = peak_nm - input_nm
    fall = np.exp(-np.maximum(below_nm - PLATEAU_NM, 0.0) / DECAY_NM)
    passed = _step((input_nm - ULTRAVIOLET_NM) / ULTRAVIOLET_WIDTH_NM)
    fall_usual = fall * (ULTRAVIOLET_LEFT + (1 - ULTRAVIOLET_LEFT) * passed)
    blue = float(np.interp(peak_nm, BLUE_NM, (1.0, 0.0)))
    away_nm = BLUE_STOKES_NM - STOKES_NM + BLUE_SPREAD_NM * SPREAD[:, np.newaxis]
    end_nm = STOKES_NM + blue * away_nm
    usual = fall_usual * _step((below_nm - end_nm) / STOKES_WIDTH_NM)
    weight = SPREAD_WEIGHT / SPREAD_WEIGHT.sum()
    envelope = np.sqrt(fall * _step((below_nm - BEYOND_NM) / STOKES_WIDTH_NM))
    deviation = np.outer(envelope, envelope) * _smooth(input_nm, EXCITATION_NM)
    return np.asarray(USUAL_PART * (usual.T * weight) @ usual + (1 - USUAL_PART) * deviation)


def stokes_edge(
    input_nm: FloatArray, output_nm: FloatArray, edge_nm: float = EDGE_NM
) -> FloatArray:
    """Return the part of an emission that light of each wavelength excites, shape (o, i).

    There is none at shorter wavelengths than that light's, and little just above it.
    """
    shift_nm = np.maximum(output_nm[:, np.newaxis] - input_nm, 0.0)
    return np.asarray(1 - np.exp(-shift_nm / edge_nm))


def emission_modes(output_nm: FloatArray, emission: FloatArray, count: int) -> FloatArray:
    """Return independent deviations of an emission (o,), one σ of each, shape (count, o).

    They are the strongest ones of smooth errors in proportion to the root of the emission, of a
    shift, and of a change of width.
    """
    largest = float(emission.max())
    envelope = EMISSION_SIGMA * np.sqrt(largest * (emission + EMISSION_FLOOR * largest))
    distance_nm = EMISSION_WIDTHS / largest
    covariance = np.outer(envelope, envelope) * _smooth(output_nm, distance_nm)
    slope = np.gradient(emission, output_nm)
    peak_nm = output_nm[np.argmax(emission)]
    moved, wider = SHIFT_NM * slope, LOG_WIDTH * (output_nm - peak_nm) * slope
    covariance += np.outer(moved, moved) + np.outer(wider, wider)
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray((vectors[:, -count:] * np.sqrt(np.maximum(values[-count:], 0.0))).T)


def deviation_correlation(input_nm: FloatArray) -> FloatArray:
    """Return the correlation (i, i) of an emission's deviations between exciting wavelengths."""
    return SAME_EMISSION + (1 - SAME_EMISSION) * _smooth(input_nm, EXCITATION_NM)


def _smooth(nm: FloatArray, distance_nm: float) -> FloatArray:
    """Return the Matérn correlation of order 3/2 between wavelengths."""
    distance = np.sqrt(3) * np.abs(nm[:, np.newaxis] - nm) / distance_nm
    return np.asarray((1 + distance) * np.exp(-distance))


def _step(x: FloatArray) -> FloatArray:
    return np.asarray(1 / (1 + np.exp(-x)))


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
MIN_INSIDE = 0.5


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
        if not (whole > 0 and inside >= MIN_INSIDE * whole):
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


#: Variance of the excitation, relative to its largest, below which it is 0.
MIN_VARIANCE = 1e-3
#: Added to prior covariances, relative to their largest variance.
JITTER = 1e-6
#: The same of a covariance of 0.
TINY = 1e-20


@dataclass(frozen=True, eq=False)
class Unknowns:
    """Design (n, p), mean (p,) and root of the precision (p, p) of unknowns, and their place.

    Attributes
    ----------
    design
        Values by the unknowns, shape (n, p).
    mean, precision_root
        Mean (p,), and W with W Wᵀ the inverse of the covariance (p, p).
    used
        Places of the unknowns among all wavelengths, shape (p,).
    """

    design: FloatArray
    mean: FloatArray
    precision_root: FloatArray
    used: NDArray[np.intp]

    @classmethod
    def normal(cls, design: FloatArray, mean: float, covariance: FloatArray) -> Self:
        """Return the unknowns of a design (n, q) that vary enough, of covariance (q, q)."""
        variance = np.diag(covariance)
        used = np.flatnonzero(variance > MIN_VARIANCE * variance.max())
        root = covariance_root(covariance[np.ix_(used, used)])
        inverse = np.asarray(np.linalg.inv(root).T)
        return cls(design[:, used], np.full(len(used), mean), inverse, used)

    def of_amplitude(self, amplitude: float) -> Self:
        """Return the unknowns with a standard deviation so many times as large."""
        return replace(self, precision_root=self.precision_root / amplitude)


def covariance_root(covariance: FloatArray) -> FloatArray:
    """Return a lower triangle L with L Lᵀ a covariance and a hint of independent variance."""
    jitter = (JITTER * float(np.diag(covariance).max()) + TINY) * np.eye(len(covariance))
    return np.asarray(np.linalg.cholesky(covariance + jitter))
