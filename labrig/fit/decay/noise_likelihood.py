"""How well residuals agree with a noise that only they tell.

The flicker ρ, or without σ the scale of the noise, is taken from the scatter about the best
monotone curve. Some dozens of frames tell it to 10 or 20 %, and so a χ² that is larger by ten may
mean no more than that ρ came out small. Models are therefore compared by their likelihood with the
noise that suits each of them best. No model can hide a misfit in it: the scatter about the curve
is in the residuals of all models, and what one adds to it counts the more, the smaller it is.
"""

from dataclasses import dataclass

import numpy as np

from labrig.fit.decay.envelope import MAX_FLICKER, Envelope
from labrig.fit.decay.joint import JointFit
from labrig.fit.decay.whitening import WhitenedSeries
from labrig.foundation.arrays import FloatArray

#: Values of ρ that are tried, dense near zero, where a small one already tells.
FLICKERS = MAX_FLICKER * np.linspace(0, 1, 100) ** 2
#: Variance over that assumed where the flicker assumed is all of it and less is tried: rounding
#: may else make it negative.
LEAST_FACTOR = 1e-12
#: Relative error of values and models by rounding: smaller residuals say nothing of a model.
ROUNDING = 1e-13


@dataclass(frozen=True)
class NoiseLikelihood:
    """Likelihood of whitened residuals.

    Attributes
    ----------
    data
        The series in units of the noise assumed.
    along
        Direction of the signal in each frame, of length 1, shape (n, C).
    factors
        Variance along the signal with each noise that is possible, over that assumed, shape (m, n).
    """

    data: WhitenedSeries
    along: FloatArray
    factors: FloatArray

    @classmethod
    def of(cls, data: WhitenedSeries, noise: Envelope) -> "NoiseLikelihood":
        """Return the likelihood of residuals in units of a noise."""
        signal = np.einsum("fcd,fd->fc", data.matrices, noise.signal)
        brightness2 = np.einsum("fc,fc->f", signal, signal)
        length = np.sqrt(np.where(brightness2 > 0, brightness2, 1.0))
        flickers = noise.likely_flickers if noise.is_given else FLICKERS
        added = flickers**2 - noise.typical_flicker**2
        return cls(
            data,
            signal / length[:, None],
            np.maximum(1 + np.multiply.outer(added, brightness2), LEAST_FACTOR),
        )

    def deviance(self, residuals: FloatArray) -> float:
        """Return −2 log of the largest likelihood of whitened residuals (n C + p,), but a constant.

        It is their χ² if the noise is known.
        """
        chi2 = float(residuals @ residuals)
        if not self.data.series.sigma_given:
            n_values = self.data.series.n_values
            of_rounding = ROUNDING**2 * float(self.data.target @ self.data.target)
            return n_values * (1 + float(np.log(max(chi2, of_rounding) / n_values)))
        return chi2 + float(self._changes(residuals).min())

    def likeliest_factors(self, residuals: FloatArray) -> FloatArray:
        """Return the likeliest variance along the signal, over that assumed, shape (n,)."""
        if not self.data.series.sigma_given:
            return np.ones_like(self.factors[0])
        return np.asarray(self.factors[np.argmin(self._changes(residuals))])

    def _changes(self, residuals: FloatArray) -> FloatArray:
        """Return the change of the deviance by each of the possible noises, shape (m,)."""
        frames = residuals[: self.along.size].reshape(self.along.shape)
        along2 = np.einsum("fc,fc->f", self.along, frames) ** 2
        return np.asarray(np.log(self.factors).sum(axis=1) + (1 / self.factors - 1) @ along2)

    def bic(self, joint: JointFit) -> float:
        """Return the Bayesian information criterion, without the constant of the common noise."""
        independent = self.data.independent_data(joint.weights)
        deviance = self.deviance(joint.least_squares.residuals)
        return deviance + joint.n_parameters * float(np.log(independent))

    @property
    def is_known(self) -> bool:
        """Whether the noise was given."""
        return self.data.series.sigma_given and len(self.factors) == 1
