"""The fit of one series: common to a run's processing and `labrig fit decay`."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from labrig.calibration import TYPICAL_FLICKER
from labrig.fit import DecayFit, fit_decay
from labrig.foundation.arrays import FloatArray
from labrig.foundation.detection import DECAY_DETECTION_SIGMA
from labrig.foundation.errors import FitError, FlickerUnknownError
from labrig.results import AUTO, DecayReference, Series, TableClock

#: Fewest frames that determine their flicker.
FRAMES_FOR_FLICKER = 6


def fit_series(
    series: Series,
    states: int | None = None,
    offset_sigma: ArrayLike | None = None,
    flicker: float | None = None,
    fixed_rates_per_s: Sequence[float] = (),
    law: str = AUTO,
    *,
    equal_weights: bool = False,
    intervals: bool = False,
) -> DecayFit:
    """Fit a sum of exponentials to the usable rows of a series.

    Parameters
    ----------
    series
        Time series of a patch.
    states
        Number of states; None chooses it.
    offset_sigma
        Prior standard uncertainty of a constant background in the unit of the values, one for all
        channels or one each: 0 fixes it at zero, infinity leaves it free. None takes what the dark
        subtraction left uncertain in each channel.
    flicker
        Relative scatter common to the channels of a frame; None measures it, or takes a
        typical value where too few frames are bright to determine it.
    fixed_rates_per_s
        Rates in 1/s that take part and are held; they count as states.
    law
        Law that describes the decay, as in `fit_decay`.
    equal_weights
        Whether all values have one σ, that of the residuals: unweighted least squares, whatever σ
        the series has.
    intervals
        Whether every rate, and every parameter of the law, has an interval by profile likelihood,
        as in `fit_decay`.

    Returns
    -------
    DecayFit
        Rates in 1/s and amplitudes in the unit of the values, with standard uncertainties,
        covariance and residuals.

    Raises
    ------
    FitError
        The data do not allow a fit, or no decay stands out of the noise.

    Examples
    --------
    >>> import labrig
    >>> series = labrig.read_series("series.csv")[0]
    >>> fit = labrig.fit_series(series)
    >>> for state in fit.states:
    ...     print(f"k_r = {state.k_r_per_s:.2g} 1/s, amplitude {state.amplitude:.2g} DN/s")
    k_r = 0.2 1/s, amplitude 8e+03 DN/s
    k_r = 0.01 1/s, amplitude 2.8e+03 DN/s
    """
    if not series.usable.any():
        raise FitError(
            "expected usable frames, got none: all are clipped or excluded; expose for less"
        )
    usable = series.take(np.flatnonzero(series.usable))
    if offset_sigma is None:
        offset_sigma = np.where(np.isnan(series.dark_sigma), 0.0, series.dark_sigma)
    sigma: FloatArray | Literal["equal"] | None = usable.sigma
    if equal_weights:
        sigma, flicker = "equal", 0.0
    elif np.isnan(usable.sigma).all():
        sigma = None
    if flicker is None and len(usable.t_s) < FRAMES_FOR_FLICKER:
        flicker = TYPICAL_FLICKER
    fitted = partial(
        fit_decay,
        usable.t_s,
        usable.values,
        sigma,
        exposure_s=usable.exposure_s,
        channels=usable.channels,
        n_states=states,
        offset_sigma=offset_sigma,
        fixed_rates=fixed_rates_per_s,
        repeats=usable.unit,
        correlation=usable.correlation,
        offset_correlation=usable.dark_correlation,
        law=law,
        intervals=intervals,
    )
    try:
        fit = fitted(flicker=flicker)
    except FlickerUnknownError:
        # A fast decay in a frame or two leaves no residuals from which flicker could be estimated.
        fit = fitted(flicker=TYPICAL_FLICKER)
    if not _is_seen(fit, float(usable.t_s.min())):
        raise FitError(
            "expected a decay, got nothing that stands out of the noise by "
            f"{DECAY_DETECTION_SIGMA:g} σ; was the sample charged, is it its light that was "
            "measured, and for long enough?"
        )
    return replace(
        fit,
        reference=by_clock(fit.reference, series.clock),
        value_unit=series.value_unit,
        warnings=(*series.warnings, *fit.warnings),
    )


def by_clock(reference: DecayReference, clock: TableClock) -> DecayReference:
    """Return the reference of a fit to a series with the time by its table's clock."""
    return DecayReference(
        is_lamp_off=reference.is_lamp_off and clock.is_lamp_off,
        t_s=reference.t_s,
        clock_s=float(clock.zero_s) + reference.t_s,
    )


def _is_seen(fit: DecayFit, first_s: float) -> bool:
    """Return whether an amplitude is significant, or the signal of some law at the first frame.

    Nearly equal rates share their amplitudes, more states than the data hold leave nothing of them
    determined, and exponentials that only describe another law have no determined amplitudes.
    """
    first = np.array([first_s]), np.zeros(1)
    signals = [fit.signal(*first), *(law.signal(*first) for law in fit.laws)]
    return any(
        value[0] >= DECAY_DETECTION_SIGMA * np.sqrt(variance[0]) for value, variance in signals
    ) or any(
        state.amplitude >= DECAY_DETECTION_SIGMA * state.amplitude_sigma for state in fit.states
    )
