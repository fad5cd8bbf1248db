"""Periodic flicker: its lines in the residuals of a fit, and those that evenly spaced frames hide.

Randomly spaced frames show a flicker of any period as a line in the periodogram of the residuals
(N. R. Lomb, Astrophysics and Space Science 39, 447, 1976; J. D. Scargle, Astrophysical Journal 263,
835, 1982). Evenly spaced ones show only its beat with them, and take a slow beat for a part of the
decay.
"""

from dataclasses import dataclass

import numpy as np
from scipy.signal import lombscargle

from labrig.foundation.arrays import FloatArray
from labrig.results import UnseenFlicker

#: Values below which neither is looked for, and first values that are looked at.
FEWEST_VALUES, MOST_VALUES = 12, 1000
#: Frequencies that are looked at, in values a second of the mean spacing, and periods in the record
#: from which residuals that repeat are no misfit.
HIGHEST, FEWEST_PERIODS = 2.5, 6.0
#: Frequencies that are computed for each that is independent of the others.
OVERSAMPLING = 5
#: Coherence |Σ exp(2πi f t)|/n of the times from which frames are evenly spaced, unless few frames
#: have it by chance.
EVEN = 0.6
#: First values that tell it, and most frequencies.
MOST_TIMES, MOST_FREQUENCIES = 300, 4000
#: Part of a flicker below which it does not matter.
LEAST_SHARE = 0.1


@dataclass(frozen=True, eq=False)
class Periodogram:
    """Lomb–Scargle periodogram of the residuals of a decay.

    Attributes
    ----------
    frequency_hz
        Rising frequencies in 1/s, shape (f,).
    power
        Fraction of the squared residuals that a flicker of that frequency explains, shape (f,).
    independent
        Number of independent frequencies.
    n_values
        Number of residuals.
    spacing_s
        Time between two values in seconds where they are evenly spaced: there a frequency stands
        for all that differ from it by a multiple of 1/spacing. None where they are not.
    """

    frequency_hz: FloatArray
    power: FloatArray
    independent: float
    n_values: int
    spacing_s: float | None

    @property
    def period_s(self) -> float:
        """Period of the highest line in seconds."""
        return 1 / float(self.frequency_hz[np.argmax(self.power)])

    @property
    def p_value(self) -> float:
        """Chance that the highest line of independent normal residuals is as high."""
        alone = (1 - float(self.power.max())) ** ((self.n_values - 2) / 2)
        return float(-np.expm1(self.independent * np.log1p(-min(alone, 1 - 1e-16))))

    def power_at(self, p_value: float) -> float:
        """Return the power that no line of independent normal residuals exceeds but by chance."""
        alone = -np.expm1(np.log1p(-p_value) / self.independent)
        return float(1 - alone ** (2 / (self.n_values - 2)))


def periodogram(
    t_s: FloatArray, residuals: FloatArray, signal_to_noise: FloatArray
) -> Periodogram | None:
    """Return the periodogram of the residuals of one decay.

    Flicker is a fraction of the signal, so that sines are fitted to the signal's relative
    deviations, weighted by their σ.

    Parameters
    ----------
    t_s
        Rising middles of the exposures in seconds, shape (n,).
    residuals
        Residuals over their σ, flicker included, shape (n,).
    signal_to_noise
        Signal over the same σ, shape (n,).

    Returns
    -------
    Periodogram or None
        From periods of a sixth of the record on to that of two evenly spaced values, or to 0.4 of
        the mean spacing of others; None where residuals are too few or vanish.

    Examples
    --------
    >>> import numpy as np
    >>> from labrig.fit import periodogram
    >>> t_s = np.sort(np.random.default_rng(1).uniform(0, 180, 36))
    >>> lines = periodogram(t_s, np.sin(2 * np.pi * t_s / 5.1), np.ones(36))
    >>> print(f"{lines.period_s:.1f} s, p < 1e-9: {lines.p_value < 1e-9}")
    5.1 s, p < 1e-9: True
    """
    rows = np.flatnonzero(signal_to_noise > 0)[:MOST_VALUES]
    t_s, residuals, signal_to_noise = t_s[rows], residuals[rows], signal_to_noise[rows]
    n_values = len(t_s)
    if n_values < FEWEST_VALUES or not residuals.any() or not np.ptp(t_s):
        return None
    span_s = float(np.ptp(t_s))
    spacing_s = span_s / (n_values - 1)
    is_even = _coherence(t_s, np.array([1 / spacing_s]))[0] > _even_from(n_values)
    lowest, highest = FEWEST_PERIODS / span_s, (0.5 if is_even else HIGHEST) / spacing_s
    if highest <= lowest:
        return None
    independent = (highest - lowest) * span_s
    frequency_hz = np.linspace(lowest, highest, int(OVERSAMPLING * independent) + 2)
    power = lombscargle(
        t_s - t_s[0],
        residuals / signal_to_noise,
        2 * np.pi * frequency_hz,
        normalize=True,
        weights=signal_to_noise**2,
    )
    return Periodogram(
        frequency_hz,
        np.clip(power, 0.0, 1.0),
        independent,
        n_values,
        spacing_s if is_even else None,
    )


def unseen_flicker(t_s: FloatArray, exposure_s: FloatArray) -> UnseenFlicker | None:
    """Return the periodic flicker that evenly spaced frames take for a slow change.

    Parameters
    ----------
    t_s
        Rising begins of the exposures of one decay in seconds, shape (n,).
    exposure_s
        Their lengths in seconds, shape (n,).

    Returns
    -------
    UnseenFlicker or None
        None if frames are not evenly spaced, if exposures average the flicker out, or if there are
        too few frames.
    """
    t_s, exposure_s = t_s[:MOST_TIMES], exposure_s[:MOST_TIMES]
    if len(t_s) < FEWEST_VALUES or not np.ptp(t_s):
        return None
    span_s, steps_s = float(np.ptp(t_s)), np.diff(t_s)
    lowest = 0.5 * len(steps_s) / span_s
    step_s = float(np.median(steps_s))
    # Frames that are close together at first and evenly spaced later have a median step of zero.
    highest = 1.25 / step_s if step_s > 0 else np.inf
    highest = min(highest, lowest + MOST_FREQUENCIES / (4 * span_s))
    frequencies = np.append(np.arange(lowest, highest, 1 / (4 * span_s)), 1 / max(step_s, 1e-300))
    middle_s = t_s + exposure_s / 2
    coherent = _coherence(middle_s, frequencies)
    best = int(np.argmax(coherent))
    if coherent[best] < _even_from(len(t_s)):
        return None
    frequency = float(frequencies[best])
    share = float(coherent[best] * np.mean(np.abs(np.sinc(frequency * exposure_s))))
    return UnseenFlicker(1 / frequency, share) if share > LEAST_SHARE else None


def _coherence(t_s: FloatArray, frequency_hz: FloatArray) -> FloatArray:
    """Return |Σ exp(2πi f t)|/n of times (n,) at frequencies (f,): 1 where flicker stands still."""
    phase = np.multiply.outer(frequency_hz, t_s - t_s[0])
    return np.asarray(np.abs(np.exp(2j * np.pi * phase).mean(axis=1)))


def _even_from(n_values: int) -> float:
    """Return the coherence from which n times are evenly spaced: random ones hardly have it."""
    return max(EVEN, float(np.sqrt((np.log(2 * n_values) + 3) / n_values)))
