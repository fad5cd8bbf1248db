"""Re-radiation as a mixture of two-dimensional normal densities over input and output.

Hua et al., *A compact representation for fluorescent spectral data* (EGSR 2021),
equations 1 to 3: Φ(λ_i, λ_o) = S p(λ_i, λ_o), here on the Stokes side λ_o > λ_i only.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from labrig.foundation.arrays import FloatArray
from labrig.material.reradiation.conditional import ConditionalDensity
from labrig.material.reradiation.margin import Margin
from labrig.material.reradiation.matrix import SAME_NM, ReradiationMatrix

#: Tolerance of the sum of the weights.
WEIGHTS_SUM_SLACK = 1e-9


@dataclass(frozen=True, eq=False)
class ReradiationMixture:
    """Re-radiation per nm of output: `scale` times a mixture of normal densities.

    The density p(λ_i, λ_o) is normalised over the whole plane; on and beyond the diagonal
    λ_o = λ_i no light is re-radiated.

    Parameters
    ----------
    scale
        Integral of the re-radiation over input and output in nm, if no component reached beyond the
        Stokes side; at least 0.
    weights
        Weights of the components, at least 0, that sum to 1, shape (K,).
    mean_nm
        Means [input, output] in nm, medians of skewed components, shape (K, 2).
    covariance_nm2
        Positive definite covariances of [input, output] in nm², shape (K, 2, 2); of skewed
        components those of the normal density that is like them at their medians.
    skew
        Skew of each component in [input, output], shape (K, 2): half the logarithm of the ratio of
        its widths far above and far below the median. Not given: 0, normal densities.

    Raises
    ------
    ValueError
        Shapes disagree, weights do not sum to 1, or a covariance is not positive definite.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.material import ReradiationMixture
    >>> dye = ReradiationMixture(
    ...     20.0, np.ones(1), np.array([[460.0, 520.0]]), np.array([[[900.0, 100], [100, 400]]])
    ... )
    >>> dye.reradiation([460.0, 530.0], 520.0).round(6).tolist()
    [0.00538, 0.0]
    >>> dye.reradiated_fraction([400.0, 460.0]).round(4).tolist()
    [0.036, 0.2656]
    """

    scale: float
    weights: FloatArray
    mean_nm: FloatArray
    covariance_nm2: FloatArray
    skew: FloatArray | None = None

    def __post_init__(self) -> None:
        count = len(self.weights) if self.weights.ndim == 1 else 0
        shapes = (self.weights.shape, self.mean_nm.shape, self.covariance_nm2.shape)
        if count < 1 or shapes != ((count,), (count, 2), (count, 2, 2)):
            raise ValueError(
                "expected weights, means and covariances of shapes (K,), (K, 2) and (K, 2, 2), "
                f"got {shapes[0]}, {shapes[1]} and {shapes[2]}"
            )
        if self.skew is not None and self.skew.shape != (count, 2):
            raise ValueError(f"expected skews of shape ({count}, 2), got {self.skew.shape}")
        numbers_of = (self.scale, self.weights, self.mean_nm, self.covariance_nm2, self.skews)
        for numbers in numbers_of:
            if not np.isfinite(numbers).all():
                raise ValueError("expected finite numbers in the mixture")
        if self.scale < 0 or (self.weights < 0).any():
            raise ValueError("expected a scale and weights of at least 0")
        if abs(self.weights.sum() - 1) > WEIGHTS_SUM_SLACK:
            raise ValueError(f"expected weights that sum to 1, got {self.weights.sum():.9g}")
        (aa, ab), (ba, bb) = np.moveaxis(self.covariance_nm2, 0, -1)
        if not (np.allclose(ab, ba) and (aa > 0).all() and (aa * bb > ab * ba).all()):
            raise ValueError("expected symmetric, positive definite covariances")

    def density(self, input_nm: ArrayLike, output_nm: ArrayLike) -> FloatArray:
        """Return p(λ_i, λ_o) in 1/nm² of wavelengths that broadcast against each other."""
        inputs, outputs = (np.asarray(nm, dtype=np.float64) for nm in (input_nm, output_nm))
        u, v = inputs[..., np.newaxis], outputs[..., np.newaxis]
        by_input, by_output = self._margin(0), self._margin(1)
        log_rates = by_input.log_rate(u) + by_output.log_rate(v)
        u, v = by_input.variate(u), by_output.variate(v)
        unexplained = (1 - self.correlation) * (1 + self.correlation)
        distance2 = u * u + (v - self.correlation * u) ** 2 / unexplained
        peak = self.weights / (2 * np.pi * np.sqrt(unexplained))
        return np.asarray((peak * np.exp(log_rates - 0.5 * distance2)).sum(axis=-1))

    def reradiation(self, input_nm: ArrayLike, output_nm: ArrayLike) -> FloatArray:
        """Return Φ in 1/nm of output of wavelengths that broadcast against each other."""
        inputs, outputs = (np.asarray(nm, dtype=np.float64) for nm in (input_nm, output_nm))
        is_stokes = outputs > inputs + SAME_NM
        return np.where(is_stokes, self.scale * self.density(inputs, outputs), 0.0)

    def to_matrix(
        self,
        input_nm: ArrayLike,
        output_nm: ArrayLike,
        *,
        reflectance: FloatArray | None = None,
        name: str = "",
    ) -> ReradiationMatrix:
        """Return the mixture on bands: each has the re-radiation at its centres, as in the paper.

        Mixtures are fitted at centres, too, so that a measured matrix is compared with this one.
        Sums over bands are those of the density while a standard deviation is not much less than
        a band; for wider bands take narrow ones here, and `ReradiationMatrix.rebinned`.

        Parameters
        ----------
        input_nm, output_nm
            Rising centres of the bands in nm, shapes (m,) and (n,).
        reflectance
            Radiance factor without re-radiation, shape (n,); unknown (NaN) without it.
        name
            Name of the material.

        Returns
        -------
        ReradiationMatrix
            Re-radiation in bands whose centres are on the Stokes side, 0 elsewhere.
        """
        inputs, outputs = (np.asarray(nm, dtype=np.float64) for nm in (input_nm, output_nm))
        unknown = np.full(len(outputs), np.nan)
        return ReradiationMatrix(
            name,
            inputs,
            outputs,
            unknown if reflectance is None else reflectance,
            self.reradiation(inputs, outputs[:, np.newaxis]),
        )

    def reradiated_fraction(self, input_nm: ArrayLike) -> FloatArray:
        """Return the fraction of the light of each wavelength that comes back at longer ones."""
        return self.scale * self.output_given_input.integral(input_nm)

    @cached_property
    def output_given_input(self) -> ConditionalDensity:
        """Density of the output, given the input: p(λ_o | λ_i)."""
        return self._conditional(given=0)

    @cached_property
    def input_given_output(self) -> ConditionalDensity:
        """Density of the input, given the output: p(λ_i | λ_o)."""
        return self._conditional(given=1)

    @property
    def skews(self) -> FloatArray:
        """Skew of each component in [input, output], 0 of normal densities, shape (K, 2)."""
        return np.zeros_like(self.mean_nm) if self.skew is None else self.skew

    @property
    def correlation(self) -> FloatArray:
        """Correlation of input and output of each component, shape (K,)."""
        variances = np.diagonal(self.covariance_nm2, axis1=1, axis2=2)
        return np.asarray(self.covariance_nm2[:, 0, 1] / np.sqrt(variances.prod(axis=1)))

    def _margin(self, axis: int) -> Margin:
        sd_nm = np.sqrt(self.covariance_nm2[:, axis, axis])
        return Margin(self.mean_nm[:, axis], sd_nm, self.skews[:, axis])

    def _conditional(self, given: int) -> ConditionalDensity:
        return ConditionalDensity(
            self.weights,
            self._margin(given),
            self._margin(1 - given),
            self.correlation,
            is_output=given == 0,
        )
