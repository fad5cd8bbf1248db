"""Where the uncertainty of a value comes from, over the course of a decay."""

import numpy as np

from labrig.reduce import NoiseModel, variance_terms
from labrig.results import FittedDecay, FloatArray, NoiseBudget, Series

#: Terms of the photon-transfer line: constant, ∝ light, ∝ light².
_TERMS = 3
#: Signal over σ below which a frame has nothing to relate σ to.
LEAST_SIGNAL = 1e-3


def noise_budget(series: Series, fit: FittedDecay) -> NoiseBudget | None:
    """The budget of the first decay's fitted frames; None if they are too few, or σ is unknown."""
    brightest = fit.brightest
    signal = fit.predict(series.t_s, series.exposure_s)[:, brightest] - fit.offset
    # Comparisons with an unknown σ are false.
    rows = np.flatnonzero(series.usable & (signal > LEAST_SIGNAL * series.sigma[:, brightest]))
    if len(rows) <= _TERMS:
        return None
    used, signal = series.take(rows), signal[rows]
    parts = np.sqrt(noise_parts(used, brightest, signal)) / signal[:, np.newaxis]
    first = np.flatnonzero(np.array(used.unit) == used.unit[0])
    first = first[np.argsort(used.t_s[first], kind="stable")]
    dark_sigma = np.nan_to_num(used.dark_sigma[brightest])
    return NoiseBudget(
        t_s=(used.t_s + used.exposure_s / 2)[first],
        photons=parts[first, 1],
        reading=parts[first, 0],
        uneven=parts[first, 2],
        flicker=np.full(len(first), fit.flicker),
        dark_level=dark_sigma / signal[first],
    )


def noise_parts(series: Series, channel: int, signal: FloatArray) -> FloatArray:
    """The variances of one channel's values in three parts, shape (n, 3), in the values' unit².

    The photon-transfer model through all frames says in which proportions each frame's σ² is shared
    out to reading, photons and uneven light, by its `signal`, shape (n,).
    """
    exposure_s = np.where(series.exposure_s > 0, series.exposure_s, 1.0)
    variance = np.square(series.sigma[:, channel] * exposure_s)
    terms = variance_terms(series.values[:, channel] * exposure_s)
    line = NoiseModel.fit(terms, variance, sigma_dn2=variance)
    shares = line.parts_dn2(signal * exposure_s)
    shares /= shares.sum(axis=1, keepdims=True)
    return np.asarray(shares * np.square(series.sigma[:, channel, np.newaxis]))
