"""The fit of one series: common to a run's processing and `labrig fit decay`."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from labrig.errors import FitError, UsageError
from labrig.fit import DecayFit, fit_decay
from labrig.quantity import FRACTION, parse
from labrig.results import Series, join_series, read_series

#: Least counts in a Poisson weight, since fewer would weigh a point too much.
MIN_COUNTS = 5.0
#: Fewest frames that determine their flicker; shutters and apertures scatter by 0.5-1 %.
FRAMES_FOR_FLICKER = 6
TYPICAL_FLICKER = 0.007
#: Significance in σ of some amplitude from which a decay is detected.
SEEN_SIGMA = 3.0


def fit_series(
    series: Series,
    states: int | None = None,
    offset_sigma: ArrayLike | None = None,
    flicker: float | None = None,
    fixed_rates_per_s: Sequence[float] = (),
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
        Relative scatter common to the channels of a frame; None measures it.
    fixed_rates_per_s
        Rates in 1/s that take part and are held; they count as states.

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
    if flicker is None and len(usable.t_s) < FRAMES_FOR_FLICKER:
        flicker = TYPICAL_FLICKER
    fit = fit_decay(
        usable.t_s,
        usable.values,
        None if np.isnan(usable.sigma).all() else usable.sigma,
        exposure_s=usable.exposure_s,
        channels=usable.channels,
        n_states=states,
        offset_sigma=offset_sigma,
        flicker=flicker,
        fixed_rates=fixed_rates_per_s,
        repeats=usable.unit,
        correlation=usable.correlation,
        offset_correlation=usable.dark_correlation,
    )
    if all(state.amplitude < SEEN_SIGMA * state.amplitude_sigma for state in fit.states):
        raise FitError(
            "expected a decay, got nothing that stands out of the noise by "
            f"{SEEN_SIGMA:g} σ; did the lamp light, is the region on the sample, is the exposure "
            "long enough?"
        )
    return fit


def fit_table(
    path: Path,
    states: int | None,
    offset: str,
    flicker: str,
    weights: str,
    origin_s: float,
    from_s: float | None,
) -> list[tuple[str, DecayFit]]:
    """Fit a sum of exponentials to every region in a table, from the texts of a command line.

    Parameters
    ----------
    path
        Path of the table, as `read_series` reads it.
    states
        Number of states; None chooses it.
    offset
        Constant background: `zero`, `free`, or its prior standard uncertainty in the data's unit.
    flicker
        Relative scatter common to the channels of a frame: `auto`, a percentage, or a fraction.
    weights
        Uncertainties of the values: `given` in the table, or those of `counts` (Poisson).
    origin_s
        Time of lamp off in the table's seconds.
    from_s
        Time in the table's seconds from which points are fitted; None takes all.

    Returns
    -------
    list of (str, DecayFit)
        Name and fit of each region in order of appearance.

    Raises
    ------
    UsageError
        A text is none of those, no point is left, or the table is malformed.
    DataError
        The table has values that are missing or not finite.
    FitError
        The data do not allow a fit.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.analyse import fit_table
    >>> fits = fit_table(
    ...     Path("series.csv"), states=2, offset="zero", flicker="auto", weights="given",
    ...     origin_s=0.0, from_s=None,
    ... )
    >>> for region, fit in fits:
    ...     print(region, [f"{rate.value:.2g} {rate.unit}" for rate in fit.rates])
    sample ['0.2 1/s', '0.01 1/s']
    """
    offset_sigma = {"zero": 0.0, "free": np.inf}.get(offset)
    if offset_sigma is None:
        offset_sigma = _parse_sigma(offset)
    rho = None if flicker == "auto" else _parse_flicker(flicker)
    if weights not in ("given", "counts"):
        raise UsageError(f"--weights: expected 'given' or 'counts', got '{weights}'")
    fits = []
    for series in _join_regions(read_series(path)):
        rows = np.flatnonzero(series.t_s >= (-np.inf if from_s is None else from_s))
        if not len(rows):
            raise UsageError(f"{path}: no point at {from_s:g} s or later; give an earlier --from")
        part = series.take(rows)
        part = replace(part, t_s=part.t_s - origin_s)
        if weights == "counts":
            part = replace(part, sigma=np.sqrt(np.maximum(part.values, MIN_COUNTS)))
        # Without σ nothing tells flicker from other noise: the scatter about the fit is both.
        without_sigma = flicker == "auto" and np.isnan(part.sigma).all()
        fits.append(
            (part.region, fit_series(part, states, offset_sigma, 0.0 if without_sigma else rho))
        )
    return fits


def _join_regions(parts: Sequence[Series]) -> list[Series]:
    """Join the repeats of each region's decay: they share rates and amplitudes."""
    regions: dict[str, list[Series]] = {}
    for part in parts:
        regions.setdefault(part.region, []).append(part)
    return [join_series(same) for same in regions.values()]


def _parse_sigma(text: str) -> float:
    try:
        sigma = float(text)
    except ValueError:
        sigma = -1.0
    if not sigma >= 0:
        raise UsageError(
            f"--offset: expected 'zero', 'free' or the σ of a background in the data's unit, got "
            f"'{text}'"
        )
    return sigma


def _parse_flicker(text: str) -> float:
    try:
        return parse(text, FRACTION) if "%" in text else float(text)
    except ValueError:
        raise UsageError(
            f"--flicker: expected 'auto', a percentage such as '0.7 %' or 0, got '{text}'"
        ) from None
