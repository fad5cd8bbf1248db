"""Mixtures of all texels of a fluorescent texture, fitted together.

Hua et al. 2021, section 7.5. Each texel has few components and is seen from afar, so that weighted
expectation maximisation from one start, and the scale that keeps the light, are all of the fit.
"""

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from labrig.fit.mixture.candidate import MIN_SD_BANDS
from labrig.fit.mixture.gaussians import (
    AnyFloatArray,
    Gaussians,
    maximise_likelihood,
    monomials_of,
    product,
)
from labrig.foundation.arrays import Float32Array, FloatArray
from labrig.foundation.errors import UsageError
from labrig.material import ReradiationMatrix, ReradiationMixture

#: Texels that are fitted at once: their densities stay in the cache of a core.
CHUNK = 256
MAX_ITERATIONS, TOLERANCE = 25, 1e-4
#: Unit of wavelengths in nm, in which single precision resolves all moments.
UNIT_NM = 50.0
#: Part of a texel's variance that each of several components starts with.
START_VARIANCE = 0.4


@dataclass(frozen=True, eq=False)
class MixtureTexture:
    """A mixture for each of B texels, in single precision.

    Index it for the mixture of one texel.

    Attributes
    ----------
    scale
        As of `ReradiationMixture`, 0 for texels without re-radiation, shape (B,).
    weights
        Weights of the components, shape (B, K).
    mean_nm
        Means [input, output] in nm, shape (B, K, 2).
    covariance_nm2
        Variance of the input, covariance, variance of the output in nm², shape (B, K, 3).
    masked_mse
        Mean squared error per band of each texel as of `MixtureFit`, shape (B,).
    """

    scale: Float32Array
    weights: Float32Array
    mean_nm: Float32Array
    covariance_nm2: Float32Array
    masked_mse: Float32Array

    def __len__(self) -> int:
        """Return the number of texels."""
        return len(self.scale)

    def __getitem__(self, texel: int) -> ReradiationMixture:
        """Return the mixture of one texel."""
        weights = self.weights[texel].astype(np.float64)
        covariance = self.covariance_nm2[texel].astype(np.float64)
        return ReradiationMixture(
            float(self.scale[texel]),
            weights / weights.sum(),
            self.mean_nm[texel].astype(np.float64),
            covariance[:, [[0, 1], [1, 2]]],
        )

    @property
    def stored_bytes(self) -> int:
        """Bytes of the parameters: scale, and weight, mean and covariance of each component."""
        arrays = (self.scale, self.weights, self.mean_nm, self.covariance_nm2)
        return sum(array.nbytes for array in arrays)


def fit_mixture_texture(
    reradiation: AnyFloatArray,
    input_nm: FloatArray,
    output_nm: FloatArray,
    components: int = 2,
    threshold: float = 0.0,
) -> MixtureTexture:
    """Fit a mixture to every texel of a texture by weighted expectation maximisation.

    Parameters
    ----------
    reradiation
        Re-radiation of each texel in 1/nm of output, shape (B, n, m).
    input_nm, output_nm
        Rising centres of the bands in nm, shapes (m,) and (n,).
    components
        Number K of components of each texel.
    threshold
        Least value per band that is kept; values that are not above 0 never are.

    Returns
    -------
    MixtureTexture
        The mixtures; each re-radiates as much as its texel's entries above the threshold.

    Raises
    ------
    UsageError
        The shapes disagree, there is no texel, or the number of components is below 1.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit import fit_mixture_texture
    >>> from labrig.material import ReradiationMixture
    >>> dye = ReradiationMixture(
    ...     20.0, np.ones(1), np.array([[400.0, 540.0]]), np.array([[[400.0, 100], [100, 400]]])
    ... )
    >>> input_nm, output_nm = np.arange(300.0, 781, 10), np.arange(380.0, 781, 10)
    >>> matrix = dye.to_matrix(input_nm, output_nm)
    >>> texels = np.array([0.5, 1.0])[:, np.newaxis, np.newaxis] * matrix.reradiation
    >>> texture = fit_mixture_texture(texels, input_nm, output_nm, components=1)
    >>> [round(texel.scale, 2) for texel in texture], texture[1].mean_nm.round(1).tolist()
    ([10.0, 20.0], [[400.0, 540.0]])
    """
    expected = (len(output_nm), len(input_nm))
    if reradiation.ndim != 3 or reradiation.shape[1:] != expected:
        raise UsageError(
            f"expected re-radiation of shape (texels, {expected[0]}, {expected[1]}) on these "
            f"bands, got {reradiation.shape}"
        )
    if not len(reradiation):
        raise UsageError("expected at least one texel, got none")
    if components < 1:
        raise UsageError(f"expected at least 1 component for each texel, got {components}")
    grid = _Grid.of(input_nm, output_nm)
    chunks = [reradiation[first : first + CHUNK] for first in range(0, len(reradiation), CHUNK)]
    # Array operations let go of the interpreter, so that threads use all cores.
    with ThreadPoolExecutor(os.cpu_count()) as threads:
        parts = list(
            threads.map(lambda chunk: _fit_chunk(grid, chunk, components, threshold), chunks)
        )
    return MixtureTexture(
        *(
            np.concatenate([getattr(part, field.name) for part in parts])
            for field in fields(MixtureTexture)
        )
    )


@dataclass(frozen=True, eq=False)
class _Grid:
    """Entries on the Stokes side that all texels have in common."""

    is_stokes: NDArray[np.bool_]
    input_width_nm: Float32Array
    output_width_nm: Float32Array
    monomials: Float32Array
    origin_nm: FloatArray
    least_variance: float

    @classmethod
    def of(cls, input_nm: FloatArray, output_nm: FloatArray) -> "_Grid":
        dark = np.zeros((len(output_nm), len(input_nm)))
        matrix = ReradiationMatrix("", input_nm, output_nm, np.zeros(len(output_nm)), dark)
        row, column = np.nonzero(matrix.is_stokes)
        origin_nm = np.array([input_nm.mean(), output_nm.mean()])
        x, y = ((input_nm - origin_nm[0]) / UNIT_NM, (output_nm - origin_nm[1]) / UNIT_NM)
        band_nm = (matrix.input_width_nm.mean() + matrix.output_width_nm.mean()) / 2
        return cls(
            matrix.is_stokes,
            matrix.input_width_nm[column].astype(np.float32),
            matrix.output_width_nm[row].astype(np.float32),
            monomials_of(x[column], y[row]).astype(np.float32),
            origin_nm,
            float(MIN_SD_BANDS * band_nm / UNIT_NM) ** 2,
        )


def _fit_chunk(
    grid: _Grid, reradiation: AnyFloatArray, components: int, threshold: float
) -> MixtureTexture:
    value = reradiation[:, grid.is_stokes].astype(np.float32) * grid.output_width_nm
    # A number that was not measured is not above the threshold either.
    value = np.where((value >= threshold) & (value > 0), value, np.float32(0))
    light = value @ grid.input_width_nm
    used = np.flatnonzero(value.any(axis=0))
    if not len(used):
        used = np.arange(value.shape[1])
    mass = value[:, used] * grid.input_width_nm[used]
    # A dark texel gets any mixture, and no scale.
    mass[light == 0] = 1
    monomials = np.ascontiguousarray(grid.monomials[:, used])
    start = _along_longest_axis(mass, monomials, components, grid.least_variance)
    gaussians = maximise_likelihood(
        monomials, mass, start, grid.least_variance, MAX_ITERATIONS, TOLERANCE
    ).gaussians
    density = gaussians.density(grid.monomials) / UNIT_NM**2 * grid.output_width_nm
    scale = (light / (density @ grid.input_width_nm)).astype(np.float32)
    return MixtureTexture(
        scale,
        gaussians.weights,
        (gaussians.mean * UNIT_NM + grid.origin_nm).astype(np.float32),
        gaussians.covariance * np.float32(UNIT_NM**2),
        np.square(scale[:, np.newaxis] * density - value).mean(axis=-1),
    )


def _along_longest_axis(
    mass: Float32Array, monomials: Float32Array, components: int, least_variance: float
) -> Gaussians:
    """Return mixtures whose means divide each texel's light along its longest axis."""
    moments = product(mass, monomials.T) / mass.sum(axis=-1, keepdims=True)
    whole = Gaussians.from_moments(moments[:, np.newaxis], least_variance)
    aa, ab, bb = np.moveaxis(whole.covariance, -1, 0)
    angle = 0.5 * np.arctan2(2 * ab, aa - bb)
    longest = (aa + bb) / 2 + np.hypot((aa - bb) / 2, ab)
    axis = np.sqrt(longest)[..., np.newaxis] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    quantiles = ndtri((np.arange(components) + 0.5) / components).astype(np.float32)
    shape = (len(mass), components)
    return Gaussians(
        np.full(shape, 1 / components, dtype=np.float32),
        whole.mean + quantiles[:, np.newaxis] * axis,
        np.broadcast_to(START_VARIANCE * whole.covariance, (*shape, 3))
        if components > 1
        else whole.covariance,
    )
