"""Colours of patches and of a ColorChecker under a lamp, and how far they are from predictions."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from labrig.analyse.inputs import AnalysisContext
from labrig.analyse.lit_patches import lit_patches
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.optics import (
    CIE_1931,
    Spectrum,
    delta_e,
    lab,
    observer,
    read_colour_chart,
    white_xyz,
)
from labrig.protocols.validate_illuminants.protocol import CHART, IlluminantFrames
from labrig.reduce import find_colour_chart
from labrig.results import Measured

#: Number of draws of errors.
DRAWS = 400


def chart_matrix(values: FloatArray, light: Spectrum) -> tuple[FloatArray, tuple[float, float]]:
    """Return the matrix (3, k) from values to X, Y, Z by a ColorChecker, and ΔE2000 of its patches.

    Parameters
    ----------
    values
        Values of the 24 patches, shape (24, k).
    light
        Spectrum of the lamp.

    Returns
    -------
    matrix, (mean, largest)
        The matrix, and how well it turns the patches' values into their colours.
    """
    target, white = _chart_xyz(light)
    weight = 1 / target[:, 1:2]
    matrix = np.linalg.lstsq(weight * values, weight * target, rcond=None)[0].T
    off = delta_e(lab(values @ matrix.T, white), lab(target, white))
    return np.asarray(matrix), (float(off.mean()), float(off.max()))


def _chart_xyz(light: Spectrum) -> tuple[FloatArray, FloatArray]:
    """Return X, Y, Z of the chart's patches, and of a perfect white, whose Y is 1."""
    reflectances = read_colour_chart("colorchecker")
    eye = observer(CIE_1931)
    nm = eye.wavelength_nm
    seen = light.at(nm)[:, np.newaxis] * eye.functions
    white = seen.sum(axis=0)
    target = np.array([patch.at(nm) @ seen for patch in reflectances])
    return target / white[1], white / white[1]


@dataclass(frozen=True, eq=False)
class ColourScale:
    """A matrix from values to colours, and the white of the lamp.

    Attributes
    ----------
    matrix
        From values to X, Y, Z where the white has Y = 1, shape (3, k).
    white
        X, Y, Z of the white, shape (3,).
    to_picture
        From X, Y, Z to those of a picture, diagonal, shape (3,).
    """

    matrix: FloatArray
    white: FloatArray
    to_picture: FloatArray

    @classmethod
    def under(cls, matrix: FloatArray, white: FloatArray, balance: FloatArray) -> Self:
        """Return the scale under a lamp in whose light a white has these values (k,).

        Parameters
        ----------
        matrix
            Matrix of the camera, on any scale.
        white
            Values of a perfect white.
        balance
            X, Y, Z, on any scale, of the white that is white in pictures.
        """
        xyz = matrix @ white
        return cls(matrix / xyz[1], xyz / xyz[1], _adapted(balance))

    @classmethod
    def exposed(cls, matrix: FloatArray, predicted: FloatArray, balance: FloatArray) -> Self:
        """Return the scale of a photograph in which the brightest of some samples all but clips.

        Parameters
        ----------
        matrix
            Matrix of the camera, on any scale.
        predicted
            Values of the samples, shape (n, k).
        balance
            X, Y, Z, on any scale, of the white that is white in pictures.
        """
        white = white_xyz("D65", observer(CIE_1931))
        adapted = _adapted(balance)[:, np.newaxis] * matrix
        brightest = float((predicted @ adapted.T / white).max())
        return cls(adapted / brightest if brightest > 0 else adapted, white, np.ones(3))

    def lab(self, values: FloatArray) -> FloatArray:
        """Return L*, a*, b* of values (…, k), shape (…, 3)."""
        return lab(np.maximum(values @ self.matrix.T, 0.0), self.white)

    def picture_xyz(self, values: FloatArray) -> FloatArray:
        """Return X, Y, Z for a picture, shape (…, 3)."""
        return np.asarray(np.maximum(values @ self.matrix.T, 0.0) * self.to_picture)


def _adapted(balance: FloatArray) -> FloatArray:
    """Return the factors (3,) that make a white that of a screen."""
    screen = white_xyz("D65", observer(CIE_1931))
    return np.asarray(screen / (balance / balance[1]))


def difference(
    scale: ColourScale,
    measured: FloatArray,
    predicted: FloatArray,
    covariance: FloatArray,
    seed: Sequence[int],
) -> tuple[Measured, float]:
    """Return ΔE2000 of values (k,) and its σ, and its rms if there were only errors.

    Parameters
    ----------
    scale
        How values become colours.
    measured, predicted
        Values.
    covariance
        That of their difference, shape (k, k).
    seed
        Seed of the draws.
    """
    rng = np.random.default_rng(seed)
    errors = rng.multivariate_normal(np.zeros(len(measured)), covariance, DRAWS, method="eigh")
    expected, found = scale.lab(predicted), scale.lab(measured)
    drawn = delta_e(scale.lab(measured + errors), expected)
    by_errors = delta_e(scale.lab(predicted + errors), expected)
    value = Measured(float(delta_e(found, expected)), float(np.std(drawn)))
    return value, float(np.sqrt(np.mean(by_errors**2)))


#: ΔE2000 of a chart's patches, on average, from which it is not what was taken for one.
ODD_CHART = 6.0


def chart_values(context: AnalysisContext, lamp: str) -> FloatArray:
    """Return the values of the chart's 24 patches in DN/s, shape (24, k).

    Raises
    ------
    DataError
        There is no photograph of a chart, none is found in it, or all exposures clip.
    """
    role = IlluminantFrames.CHART
    frames = context.run.frames(role)
    if not frames:
        raise DataError(
            f"{context.run.folder}: there are no complete '{role}' frames; go on with: "
            "labrig resume "
            f"{context.run.folder}"
        )
    # The shortest exposure of a bracket is metered: nothing clips.
    metered = min(frames, key=lambda frame: frame.exposure_s)
    regions = {
        f"{number:02d}": region for number, region in enumerate(find_colour_chart(metered.path))
    }
    patches = lit_patches(context, role, CHART, [lamp], patches=regions)
    return np.array([patch.without_rest().value[0] for _, patch in sorted(patches.items())])
