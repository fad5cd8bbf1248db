"""The density of one wavelength of re-radiation given the other, truncated to the Stokes side.

Given λ_i a component of a mixture is normal in λ_o, with the mean of a regression line (Hua et al.,
*A compact representation for fluorescent spectral data*, EGSR 2021, equations 6 to 11). Theirs is
cut off at λ_o = λ_i by rejection, which leaves the density and the choice of the component without
the factor that the cut takes from each; here both are those of the truncated density, so that the
expectation of a sample's weight is the integral.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import erfcx, log_ndtr, log_softmax, ndtri_exp, softmax

from labrig.foundation.arrays import FloatArray
from labrig.material.reradiation.margin import Margin

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
