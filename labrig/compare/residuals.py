"""Residuals of decay fits with two and three states over one state (Nalbach et al., sec. 4.4)."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from labrig.compare.nalbach2017 import LAST_RESIDUALS, RESIDUALS
from labrig.fit import DecayFit, fit_decay
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.report import Table
from labrig.results import Series

#: Fit of a series with a number of states and a relative flicker.
Refit = Callable[[Series, int, float], DecayFit]
STATES = (1, 2, 3)


@dataclass(frozen=True)
class Residuals:
    """Residuals of fits with n states over those with one state, by n.

    Attributes
    ----------
    patch
        Name of the patch.
    weighted
        Weighting of the values in the fit, `noise` or `equal`.
    rms
        Ratio of the root mean squares over all frames and channels.
    last
        Ratio of the root mean squares of the last frame.
    supported
        Number of states that could be fitted where n were requested.
    """

    patch: str
    weighted: str
    rms: Mapping[int, float]
    last: Mapping[int, float]
    supported: Mapping[int, int]


def residuals(series: Series, fits: Mapping[int, DecayFit], weighted: str) -> Residuals:
    """Return the residuals of fits to a series.

    Parameters
    ----------
    series
        Series that was fitted.
    fits
        Fits by the number of states requested, from `fits_by_states`.
    weighted
        Weighting of the values in the fits, `noise` or `equal`.
    """
    errors = {number: series.values - predicted(series, fit) for number, fit in fits.items()}
    last = int(np.argmax(series.t_s))
    return Residuals(
        patch=series.region,
        weighted=weighted,
        rms=_over_one_state(errors),
        last=_over_one_state({number: error[last] for number, error in errors.items()}),
        supported={number: fit.n_states for number, fit in fits.items()},
    )


def predicted(series: Series, fit: DecayFit) -> FloatArray:
    """Return the prediction of a fit for every row of its series, with repeat levels, (n, C)."""
    levels = dict(zip(fit.repeats, fit.levels, strict=True))
    level = np.array([levels.get(unit, 1.0) for unit in series.unit])
    signal = np.multiply.outer(fit.signal(series.t_s, series.exposure_s)[0], fit.channel_weights)
    return np.asarray(level[:, np.newaxis] * signal + fit.offsets)


def fits_by_states(series: Series, flicker: float, refit: Refit) -> dict[int, DecayFit]:
    """Fit one, two and three states; where one more is not supported, the fit of one less is taken.

    Raises
    ------
    FitError
        If not even one state can be fitted.
    """
    fits = {1: refit(series, 1, flicker)}
    for number in STATES[1:]:
        try:
            fits[number] = refit(series, number, flicker)
        except FitError:
            fits[number] = fits[number - 1]
    return fits


def equally_weighted(series: Series, n_states: int, flicker: float = 0.0) -> DecayFit:
    """Fit the linear values by plain least squares, as Nalbach et al. do."""
    sigmas = series.sigma[np.isfinite(series.sigma)]
    sigma = float(np.median(sigmas)) if sigmas.size else 1e-3 * float(np.abs(series.values).max())
    return fit_decay(
        series.t_s,
        series.values,
        sigma,
        exposure_s=series.exposure_s,
        channels=series.channels,
        n_states=n_states,
        flicker=flicker,
        repeats=series.unit,
    )


def residuals_table(entries: Sequence[Residuals]) -> Table:
    """Return a table with a row for each patch and weighting, their medians, and the paper's."""
    weightings = list(dict.fromkeys(entry.weighted for entry in entries))
    rows = [
        (
            entry.patch,
            entry.weighted,
            *_percents(entry.rms),
            *_percents(entry.last),
            _more_states(entry),
        )
        for entry in entries
    ]
    for weighting in weightings:
        group = [entry for entry in entries if entry.weighted == weighting]
        if len(group) > 1:
            rms, last = (
                {n: float(np.median([getattr(entry, key)[n] for entry in group])) for n in STATES}
                for key in ("rms", "last")
            )
            rows.append(("median", weighting, *_percents(rms), *_percents(last), ""))
    rows.append(
        ("paper, median of 11", "equal", *_percents(RESIDUALS), *_percents(LAST_RESIDUALS), "")
    )
    return Table(
        head=(
            "patch",
            "weights",
            "2 / %",
            "3 / %",
            "last, 2 / %",
            "last, 3 / %",
            "found",
        ),
        rows=tuple(rows),
        caption="RMS error with 2 and with 3 states over that with 1, in linear camera values: "
        "over all frames and channels, and of the last frame alone. Weights: by the noise of each "
        "value, as everywhere in labrig, or equal, as in the paper. Noise that no state can "
        "describe is in all of them, so the ratios stay above 0; where the data support no further "
        "state (found: how many came out of 1, 2 and 3) they stay at those of fewer.",
    )


def _over_one_state(errors: Mapping[int, FloatArray]) -> dict[int, float]:
    """Return the RMS by the number of states over that of one state; 1 if that is 0 already."""
    rms = {number: float(np.sqrt(np.mean(value**2))) for number, value in errors.items()}
    return {number: value / rms[1] if rms[1] > 0 else 1.0 for number, value in rms.items()}


def _percents(ratios: Mapping[int, float]) -> tuple[str, ...]:
    return tuple(f"{100 * ratios[number]:.3g}" for number in STATES[1:])


def _more_states(entry: Residuals) -> str:
    return ", ".join(str(number) for number in entry.supported.values())
