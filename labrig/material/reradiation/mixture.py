"""Re-radiation as a mixture of two-dimensional normal densities over input and output.

Hua et al., *A compact representation for fluorescent spectral data* (EGSR 2021),
equations 1 to 3: Φ(λ_i, λ_o) = S p(λ_i, λ_o), here on the Stokes side λ_o > λ_i only.

Emission and excitation are steep on one side and have a tail on the other. The sinh-arcsinh
transformation of Jones and Pewsey (*Sinh-arcsinh distributions*, Biometrika 96, 2009), with tails
as light as normal ones, makes a normal density so, and keeps conditionals, distribution functions
and samples in closed form. Here it is shifted and scaled so that the median stays where it is, and
the density near it as wide as it was.

Given λ_i a component of a mixture is normal in λ_o, with the mean of a regression line (Hua et al.,
*A compact representation for fluorescent spectral data*, EGSR 2021, equations 6 to 11). Theirs is
cut off at λ_o = λ_i by rejection, which leaves the density and the choice of the component without
the factor that the cut takes from each; here both are those of the truncated density, so that the
expectation of a sample's weight is the integral.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import erfcx, log_ndtr, log_softmax, ndtri_exp, softmax

from labrig.foundation.arrays import FloatArray
from labrig.material.reradiation.matrix import SAME_NM, ReradiationMatrix


@dataclass(frozen=True, eq=False)
class Margin:
    """A standard normal variate u of a wavelength, for each of K components.

    Attributes
    ----------
    median_nm
        Wavelength at which u is 0, shape (K,).
    sd_nm
        Standard deviation in nm without skew; with it 1 / (du/dλ) at the median, shape (K,).
    skew
        Half the logarithm of the far widths' ratio, long over short wavelengths: above 0 the tail
        is at long wavelengths, 0 is a normal density, shape (K,).
    """

    median_nm: FloatArray
    sd_nm: FloatArray
    skew: FloatArray

    def variate(self, wavelength_nm: FloatArray) -> FloatArray:
        """Return u of wavelengths (…, 1) or (…, K), shape (…, K)."""
        y = self._stretched(wavelength_nm)
        return np.asarray(y * self._cosh - np.sqrt(1 + y * y) * self._sinh)

    def log_rate(self, wavelength_nm: FloatArray) -> FloatArray:
        """Return log of du/dλ in 1/nm, shape (…, K)."""
        y = self._stretched(wavelength_nm)
        slope = self._cosh * (self._cosh - self._sinh * y / np.sqrt(1 + y * y))
        return np.asarray(np.log(slope / self.sd_nm))

    def variate_rise(self, start_nm: FloatArray, rise_nm: FloatArray) -> FloatArray:
        """Return u(start + rise) − u(start), exact however small the rise."""
        first, step = self._stretched(start_nm), rise_nm / self.sd_nm * self._cosh
        return np.asarray(step * (self._cosh - self._sinh * _mean_slope(first, first + step)))

    def wavelength_rise(self, start_nm: FloatArray, rise: FloatArray) -> FloatArray:
        """Return how far above `start_nm` the variate is higher by `rise`, in nm."""
        first = self.variate(start_nm)
        step = rise * (self._cosh + self._sinh * _mean_slope(first, first + rise))
        return np.asarray(step / self._cosh * self.sd_nm)

    def chosen(self, component: NDArray[np.intp]) -> "Margin":
        """Return the margins of some components, in the shape of their indices."""
        return Margin(self.median_nm[component], self.sd_nm[component], self.skew[component])

    @property
    def _cosh(self) -> FloatArray:
        return np.asarray(np.cosh(self.skew))

    @property
    def _sinh(self) -> FloatArray:
        return np.asarray(np.sinh(self.skew))

    def _stretched(self, wavelength_nm: FloatArray) -> FloatArray:
        return (wavelength_nm - self.median_nm) / self.sd_nm * self._cosh + self._sinh


def _mean_slope(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the mean slope of √(1 + y²) between two places."""
    both = np.sqrt(1 + first * first) + np.sqrt(1 + second * second)
    return np.asarray((first + second) / both)


LOG_SQRT_2PI = 0.5 * np.log(2 * np.pi)
#: Truncation, in standard deviations above the mean, from which the tail is taken as exponential
#: in z²: its relative error there is 1e-8, and the logarithm of the whole tail loses as much.
FAR_TAIL = 1e4


@dataclass(frozen=True, eq=False)
class ConditionalDensity:
    """Density of one wavelength of re-radiation, given the other, on the Stokes side.

    Functions of wavelengths are vectorised: arguments broadcast against each other.

    Parameters
    ----------
    weights
        Weights of the components of the joint density, shape (K,).
    given, other
        The components in the given and in the other wavelength, K each.
    correlation
        Correlation of their normal variates, shape (K,).
    is_output
        Whether the density is that of the output given the input, above it, or that of the input
        given the output, below it.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.material import ReradiationMixture
    >>> dye = ReradiationMixture(
    ...     20.0, np.ones(1), np.array([[460.0, 520.0]]), np.array([[[900.0, 100], [100, 400]]])
    ... )
    >>> round(float(dye.output_given_input.pdf(525.0, given_nm=460.0)), 4)
    0.0196
    >>> dye.output_given_input.sample([460.0, 530.0], np.random.default_rng(1)).round(1).tolist()
    [491.2, 584.2]
    """

    weights: FloatArray
    given: Margin
    other: Margin
    correlation: FloatArray
    is_output: bool

    def pdf(self, wavelength_nm: ArrayLike, given_nm: ArrayLike) -> FloatArray:
        """Return the density in 1/nm, which is 0 beyond the Stokes side and integrates to 1."""
        shift_nm, given = self._stokes_shift(wavelength_nm, given_nm)
        log_mass, cut = self._components(given)
        place = given + self._side * shift_nm
        log_density = _log_density(cut, self._excess(given, shift_nm))
        log_rate = self.other.log_rate(place[..., np.newaxis]) - np.log(self._sd)
        density = np.exp(log_softmax(log_mass, axis=-1) + log_density + log_rate).sum(axis=-1)
        return np.asarray(np.where(shift_nm > 0, density, 0.0))

    def cdf(self, wavelength_nm: ArrayLike, given_nm: ArrayLike) -> FloatArray:
        """Return the probability of a wavelength of at most `wavelength_nm`."""
        shift_nm, given = self._stokes_shift(wavelength_nm, given_nm)
        log_mass, cut = self._components(given)
        log_tail = _log_tail(cut, self._excess(given, shift_nm))
        farther = np.minimum(np.exp(log_softmax(log_mass, axis=-1) + log_tail).sum(axis=-1), 1.0)
        beyond = np.where(shift_nm > 0, farther, 1.0)
        return np.asarray(1 - beyond if self.is_output else beyond)

    def sample(self, given_nm: ArrayLike, rng: np.random.Generator) -> FloatArray:
        """Draw one wavelength for each given one.

        A component is selected by its part of the truncated density, then its truncated normal is
        drawn by inversion. The draw's probability density is `pdf`.

        Parameters
        ----------
        given_nm
            Given wavelengths in nm, of any shape.
        rng
            Source of random numbers; two are drawn for each wavelength.

        Returns
        -------
        ndarray
            Wavelengths in nm on the Stokes side, of the shape of `given_nm`.
        """
        given = np.asarray(given_nm, dtype=np.float64)
        log_mass, cut = self._components(given)
        below = np.cumsum(softmax(log_mass, axis=-1), axis=-1)[..., :-1]
        chosen = (rng.random(given.shape)[..., np.newaxis] >= below).sum(axis=-1)
        cut_of_chosen = np.take_along_axis(cut, chosen[..., np.newaxis], axis=-1)[..., 0]
        # An exponential variate is −log of a uniform one, and exact in the far tail.
        excess = _excess(cut_of_chosen, -rng.standard_exponential(given.shape))
        rise = self._side * self._sd[chosen] * excess
        drawn = given + self.other.chosen(chosen).wavelength_rise(given, rise)
        beyond = np.nextafter(given, self._side * np.inf)
        return np.asarray((np.maximum if self.is_output else np.minimum)(drawn, beyond))

    def integral(self, given_nm: ArrayLike) -> FloatArray:
        """Return the integral in 1/nm of the joint density over the Stokes side, given one."""
        log_mass, _ = self._components(np.asarray(given_nm, dtype=np.float64))
        return np.asarray(np.exp(log_mass).sum(axis=-1))

    @property
    def _side(self) -> int:
        """Sign of the other wavelength less the given one on the Stokes side."""
        return 1 if self.is_output else -1

    @property
    def _sd(self) -> FloatArray:
        """Standard deviation of the other variate, given one, shape (K,)."""
        return np.sqrt((1 - self.correlation) * (1 + self.correlation))

    def _stokes_shift(
        self, wavelength_nm: ArrayLike, given_nm: ArrayLike
    ) -> tuple[FloatArray, FloatArray]:
        wavelength, given = np.broadcast_arrays(
            np.asarray(wavelength_nm, dtype=np.float64), np.asarray(given_nm, dtype=np.float64)
        )
        return self._side * (wavelength - given), given

    def _excess(self, given_nm: FloatArray, shift_nm: FloatArray) -> FloatArray:
        """Return how far beyond its cut each component's variate is, in its σ, shape (…, K)."""
        rise_nm = self._side * np.maximum(shift_nm, 0.0)
        rise = self.other.variate_rise(given_nm[..., np.newaxis], rise_nm[..., np.newaxis])
        return np.asarray(self._side * rise / self._sd)

    def _components(self, given_nm: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the log of each component's integral, and where in its σ it is cut off, (…, K)."""
        at = given_nm[..., np.newaxis]
        u = self.given.variate(at)
        cut = self._side * (self.other.variate(at) - self.correlation * u) / self._sd
        with np.errstate(divide="ignore"):
            log_weights = np.log(self.weights)
        log_mass = log_weights - 0.5 * u * u - LOG_SQRT_2PI + self.given.log_rate(at)
        return log_mass + log_ndtr(-cut), cut


def _log_density(cut: FloatArray, excess: FloatArray) -> FloatArray:
    """Return log of φ(cut + excess) / Q(cut), Q the upper tail of the standard normal."""
    above, below = np.maximum(cut, 0.0), np.minimum(cut, 0.0)
    far = -excess * (2 * above + excess) / 2 + 0.5 * np.log(2 / np.pi) - _log_erfcx(above)
    near = -0.5 * (below + excess) ** 2 - LOG_SQRT_2PI - log_ndtr(-below)
    return np.asarray(np.where(cut > 0, far, near))


def _log_tail(cut: FloatArray, excess: FloatArray) -> FloatArray:
    """Return log of Q(cut + excess) / Q(cut); above the mean no two large numbers cancel."""
    above, below = np.maximum(cut, 0.0), np.minimum(cut, 0.0)
    far = -excess * (2 * above + excess) / 2 + _log_erfcx(above + excess) - _log_erfcx(above)
    near = log_ndtr(-(below + excess)) - log_ndtr(-below)
    return np.asarray(np.where(cut > 0, far, near))


def _log_erfcx(z: FloatArray) -> FloatArray:
    return np.asarray(np.log(erfcx(z / np.sqrt(2))))


def _excess(cut: FloatArray, log_tail: FloatArray) -> FloatArray:
    """Return how far above `cut` the upper tail is exp(`log_tail`) of that at `cut`, in σ."""
    near = np.minimum(cut, FAR_TAIL)
    z = -ndtri_exp(np.minimum(log_tail + log_ndtr(-near), 0.0))
    far = np.maximum(cut, FAR_TAIL)
    exponential = -2 * log_tail / (far + np.sqrt(far * far - 2 * log_tail))
    return np.asarray(np.where(cut > FAR_TAIL, exponential, np.maximum(z - near, 0.0)))


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
