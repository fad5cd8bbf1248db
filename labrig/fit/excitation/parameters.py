"""What an excitation fit looks for, and where each of it stands in θ."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from labrig.errors import FitError
from labrig.results import ChargingSeries, FloatArray


class Rates(NamedTuple):
    """The parameters, apart.

    Attributes
    ----------
    k_r_per_s, amplitude, k_e_per_s
        (N,), (N,) and (N, B).
    weights
        (C,) of the channels; that of the one held is 1.
    log_scale
        (S,) ln of each series' irradiance over what was stated; 0 for the first, which defines E.
    log_brightness
        (K,) ln of the lamp's brightness at every charge of every series over what was stated.
    lacking
        (1,) what the cold lamp lacks, or (0,) if it is not fitted.
    off
        (M,) z of `ChargingSeries.site_modes`, series by series.
    offset
        (C,) level in the dark that was not subtracted, or (0,) if it is not fitted.
    """

    k_r_per_s: FloatArray
    amplitude: FloatArray
    k_e_per_s: FloatArray
    weights: FloatArray
    log_scale: FloatArray
    log_brightness: FloatArray
    lacking: FloatArray
    off: FloatArray
    offset: FloatArray


@dataclass(frozen=True)
class RelativeSigmas:
    """What else scatters, relative standard uncertainties.

    Attributes
    ----------
    flicker
        ρ common to all values of a photograph.
    lamp
        Of its brightness from charge to charge.
    cold
        What a lamp lacks that was just switched on; 0 is expected.
    scale
        Of the irradiance of every series but the first over that of the first.
    offset
        (C,) of the dark level that was subtracted, in the values' unit; the same in all of them.
    common_mode
        (C,) by which the dark level scatters from photograph to photograph, in the values' unit:
        a sensor that exposes warms.
    irradiance
        Of E in every band, one number or (B,), in all series alike: nothing measured here tells.
    """

    flicker: float = 0.0
    lamp: float = 0.0
    cold: float = 0.0
    scale: float = 0.0
    offset: tuple[float, ...] = ()
    common_mode: tuple[float, ...] = ()
    irradiance: float | tuple[float, ...] = 0.0


class ParameterLayout(NamedTuple):
    """Where in θ = [ln k_r, A, k_e, weights, and what is half known] each stands.

    What is not fitted has no place: its slice is empty.
    """

    k_r: slice
    amplitude: slice
    k_e: slice
    weights: slice
    scale: slice
    brightness: slice
    lacking: slice
    off: slice
    offset: slice


def is_fitted(place: slice) -> bool:
    """Whether θ has it."""
    return bool(place.start < place.stop)


class Parameters:
    """Between `Rates` and θ.

    Parameters
    ----------
    series
        The first one defines E.
    states
        N.
    reference
        Channel whose weight is 1.
    uncertain
        What else scatters.

    Attributes
    ----------
    states, bands
        N and B.
    others
        Channels whose weights are fitted.
    columns
        Of θ.
    prior_sigma
        (h,) of what is half known, the last h of θ, all of it 0 as stated.
    """

    def __init__(
        self,
        series: Sequence[ChargingSeries],
        states: int,
        reference: int,
        uncertain: RelativeSigmas,
    ) -> None:
        self.states, self.bands, self._series = states, bands_of(series), len(series)
        channels = series[0].values.shape[2]
        self.others = [channel for channel in range(channels) if channel != reference]
        self._first_charge = _begins([len(one.charges) for one in series])
        self._first_mode = _begins(
            [0 if one.site_modes is None else len(one.site_modes) for one in series]
        )
        counts = [
            len(series) - 1 if uncertain.scale > 0 else 0,
            self._first_charge[-1] if uncertain.lamp > 0 else 0,
            1 if uncertain.cold > 0 else 0,
            self._first_mode[-1],
        ]
        each = [uncertain.scale, uncertain.lamp, uncertain.cold, 1.0]
        self.prior_sigma: FloatArray = np.concatenate([np.repeat(each, counts), uncertain.offset])
        known = [states, states, states * self.bands, len(self.others)]
        ends = _begins([*known, *counts, len(uncertain.offset)])
        self.columns = ParameterLayout(*(slice(*both) for both in pairwise(ends)))
        self.count = ends[-1]

    def charges(self, number: int) -> slice:
        """Those of a series among all."""
        return slice(*self._first_charge[number : number + 2])

    def modes(self, number: int) -> slice:
        """Ways in which the light on a series' sites may be off, among all."""
        return slice(*self._first_mode[number : number + 2])

    def lower(self) -> FloatArray:
        """Bounds of θ: amplitudes, excitation rates and weights are not negative."""
        bounds = np.full(self.count, -np.inf)
        bounds[self.columns.amplitude.start : self.columns.weights.stop] = 0.0
        return bounds

    def as_stated(
        self,
        k_r_per_s: FloatArray,
        amplitude: FloatArray,
        k_e_per_s: FloatArray,
        weights: FloatArray,
    ) -> FloatArray:
        """θ of some rates, with all that is half known at 0."""
        theta = np.zeros(self.count)
        columns = self.columns
        theta[columns.k_r] = np.log(k_r_per_s)
        theta[columns.amplitude] = amplitude
        theta[columns.k_e] = k_e_per_s.ravel()
        theta[columns.weights] = weights[self.others]
        return theta

    def unpack(self, theta: FloatArray) -> Rates:
        """θ, part by part."""
        columns = self.columns
        weights = np.ones(len(self.others) + 1)
        weights[self.others] = theta[columns.weights]
        log_scale, log_brightness = np.zeros(self._series), np.zeros(self._first_charge[-1])
        if is_fitted(columns.scale):
            log_scale[1:] = theta[columns.scale]
        if is_fitted(columns.brightness):
            log_brightness[:] = theta[columns.brightness]
        return Rates(
            np.exp(theta[columns.k_r]),
            theta[columns.amplitude],
            theta[columns.k_e].reshape(self.states, self.bands),
            weights,
            log_scale,
            log_brightness,
            theta[columns.lacking],
            theta[columns.off],
            theta[columns.offset],
        )


def bands_of(series: Sequence[ChargingSeries]) -> int:
    """Number of bands, the same in all.

    Raises
    ------
    FitError
        There is no series, or they differ in bands or channels.
    """
    shapes = {(one.irradiance.shape[1], one.values.shape[2]) for one in series}
    if len(shapes) != 1:
        raise FitError(
            f"expected series with the same bands and channels, got {sorted(shapes) or 'none'}"
        )
    bands, _ = shapes.pop()
    return int(bands)


def _begins(counts: Sequence[int]) -> list[int]:
    """Where each of several lots begins, and where the last one ends."""
    ends: list[int] = np.cumsum([0, *counts]).tolist()
    return ends
