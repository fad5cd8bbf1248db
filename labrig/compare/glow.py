"""Predicted and photographed glow over time (Nalbach et al., fig. 8)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from labrig.compare.nalbach2017 import DELTA_E, emission
from labrig.compare.viewing import Viewing
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError, UsageError
from labrig.material import (
    DECAY_LAWS,
    SEEN_FACTOR,
    Material,
    ScaleFactor,
    State,
    becquerel_of,
    exponential_means,
)
from labrig.optics import CameraResponse, Spectrum, delta_e, lab
from labrig.report import Table, exposure_middles_s
from labrig.results import Series


def in_colour(values: FloatArray, spectrum: Spectrum, camera: CameraResponse) -> FloatArray:
    """Return values with the colour of a spectrum and their own brightness.

    Parameters
    ----------
    values
        Raw values R, G, B, shape (n, 3).
    spectrum
        Relative spectral power whose colour the values get.
    camera
        Spectral responses of the camera.
    """
    colour = camera.response(spectrum.resampled(camera.wavelength_nm).value)
    brightness = values @ colour / (colour @ colour)
    return np.asarray(np.multiply.outer(brightness, colour))


def glow_of(material: Material, series: Series, camera: CameraResponse | None) -> FloatArray:
    """Return the mean glow of a material over each exposure, on the scale of `series`, (n, 3).

    Rates and relative strengths of the states are the material's: its amplitudes, else
    Λ_i k_r,i r_i(0)ᵇ, with r_i(0) = 1 if it is not known. All states have one colour: that of the
    material's spectrum or, if spectrum or camera are not known, the mean colour of the photographs.
    The scale is one factor, found by least squares.

    Raises
    ------
    UsageError
        If the material's file has neither amplitudes nor Λ.
    """
    signal = state_signals(material, series).sum(axis=1)
    spectrum = emission(material)
    glow = np.multiply.outer(signal, signal @ series.values)
    if spectrum is not None and camera is not None:
        glow = in_colour(glow, spectrum, camera)
    return np.asarray(glow * (np.sum(glow * series.values) / np.sum(glow**2)))


def state_signals(material: Material, series: Series) -> FloatArray:
    """Return the relative mean light of each state over each exposure, shape (n, states).

    Raises
    ------
    UsageError
        The material's file has neither amplitudes nor Λ.
    """
    means = np.column_stack([_means(state, series) for state in material.states])
    return np.asarray(means * _amplitudes(material))


def glow_sigma(material: Material, series: Series, *, is_same_camera: bool) -> FloatArray:
    """Return the relative σ of a material's glow over each exposure, shape (n,).

    The scale is common to all states; amplitude and rate of each state count as independent. Of a
    state of a kinetic order b above 1 it is τ that its decay tells, a (1 + t/τ)^(−b/(b − 1)): its
    rate may be known only together with its level.

    Parameters
    ----------
    material
        The material.
    series
        Photographs, of which only the times matter.
    is_same_camera
        Whether the glow is seen through the curves by which its scale was found: their error then
        is not in what is seen.
    """
    factors = [each for each in material.scale_factors if each.sigma is not None]
    whole = _relative(factors)
    scale = _relative([each for each in factors if each.name != SEEN_FACTOR or not is_same_camera])
    signals = state_signals(material, series)
    share = signals / signals.sum(axis=1, keepdims=True)
    middles_s = series.t_s + series.exposure_s / 2
    variance = np.full(len(middles_s), scale**2)
    for number, state in enumerate(material.states):
        amplitude = (state.amplitude_sigma or 0.0) / (state.amplitude or np.inf)
        of_amplitude = max(amplitude**2 - whole**2, 0.0)
        of_rate = np.square(_slowing(state, middles_s))
        variance = variance + share[:, number] ** 2 * (of_amplitude + of_rate)
    return np.asarray(np.sqrt(variance))


def _slowing(state: State, t_s: FloatArray) -> FloatArray:
    """Return the relative σ of a state's light at times after lamp off by its rate, shape (n,)."""
    time_s, sigma_s = state.decay_time_s, state.decay_time_s_sigma
    order = state.kinetic_order
    if order == 1 or time_s is None or sigma_s is None:
        return np.asarray((state.k_r_per_s_sigma or 0.0) * t_s)
    return np.asarray(order / (order - 1) * t_s / (time_s + t_s) * sigma_s / time_s)


def _relative(factors: Sequence[ScaleFactor]) -> float:
    """Return the relative σ of a product."""
    return float(np.linalg.norm([(each.sigma or 0.0) / each.value for each in factors]))


def _means(state: State, series: Series) -> FloatArray:
    """Return the light of a state over that at lamp off, averaged over each exposure, (n,)."""
    if state.kinetic_order == 1:
        rate = np.array([state.k_r_per_s])
        return exponential_means(rate, series.t_s, series.exposure_s)[:, 0]
    law = becquerel_of(_level_at_off(state), state.k_r_per_s, state.kinetic_order)
    return DECAY_LAWS["becquerel"].means(*law, series.t_s, series.exposure_s)[0]


def _level_at_off(state: State) -> float:
    return 1.0 if state.r0 is None else state.r0


def _amplitudes(material: Material) -> FloatArray:
    """Return the relative amplitudes of the states, shape (m,)."""
    amplitudes = [state.amplitude for state in material.states]
    if all(amplitude is not None for amplitude in amplitudes):
        return np.array(amplitudes, dtype=np.float64)
    if material.bands_nm is None or any(state.reradiation is None for state in material.states):
        raise UsageError(
            f"{material.name}: expected amplitudes or reradiation in every state, got neither; "
            "there is no glow to predict"
        )
    widths = np.diff(material.bands_nm)
    return np.array(
        [
            float(np.array(state.reradiation) @ widths)
            * state.k_r_per_s
            * _level_at_off(state) ** state.kinetic_order
            for state in material.states
        ]
    )


RGB = ("R", "G", "B")
#: Number of random draws of the photographs' noise.
DRAWS = 64
#: Signal-to-noise ratio from which a photograph has a colour.
MIN_FOR_COLOUR = 5.0


@dataclass(frozen=True, eq=False)
class GlowComparison:
    """Comparison of n photographs of a patch with predictions.

    Attributes
    ----------
    patch
        Name of the patch.
    t_s
        Middles of the exposures in seconds after lamp off, shape (n,), ascending.
    first
        Whether a photograph belongs to the first decay, shape (n,).
    seen
        Whether a photograph is bright enough to have a colour, shape (n,).
    photographed
        Normalised X, Y, Z of the photographs, shape (n, 3).
    predicted
        Normalised X, Y, Z of each prediction by name, shape (n, 3).
    delta_e
        CIEDE2000 of each prediction by name, shape (n,); NaN where there is no colour.
    noise
        Expected CIEDE2000 from noise alone if the nearest prediction were true, shape (n,); NaN
        where there is no colour or the noise is not known.
    """

    patch: str
    t_s: FloatArray
    first: NDArray[np.bool_]
    seen: NDArray[np.bool_]
    photographed: FloatArray
    predicted: Mapping[str, FloatArray]
    delta_e: Mapping[str, FloatArray]
    noise: FloatArray

    @property
    def mean_noise(self) -> float:
        """Mean CIEDE2000 over all photographs that noise alone makes; NaN if it is not known."""
        return float(np.mean(self.noise[self.seen]))

    def mean(self, name: str) -> float:
        """Return the mean CIEDE2000 of a prediction over all photographs."""
        return float(np.nanmean(self.delta_e[name]))

    def most(self, name: str) -> float:
        """Return the largest CIEDE2000 of a prediction over all photographs."""
        return float(np.nanmax(self.delta_e[name]))


def predicted_by(n_states: int) -> str:
    """Return the name of the prediction by a fit with `n_states` states."""
    return "1 state" if n_states == 1 else f"{n_states} states"


def compare_glow(
    series: Series, predicted: Mapping[str, FloatArray], viewing: Viewing, flicker: float = 0.0
) -> GlowComparison:
    """Compare photographs with predictions of them.

    Parameters
    ----------
    series
        Signals R, G, B of usable photographs, rows in order of time.
    predicted
        Predictions by name, at least one: means over each exposure in the unit of the series, shape
        (n, 3).
    viewing
        Conversion to CIELAB.
    flicker
        Relative common-mode noise of the channels of a photograph.

    Raises
    ------
    DataError
        If the channels are not R, G, B, or all photographs are dark.
    """
    if series.channels != RGB:
        raise DataError(
            f"{series.region}: expected a camera with R, G, B, got {', '.join(series.channels)}; "
            "there is no colour to compare"
        )
    scale = _scale(series, series.values @ viewing.to_xyz.T, viewing)
    return compare_scaled(series, predicted, viewing, flicker, scale)


def compare_scaled(
    series: Series,
    predicted: Mapping[str, FloatArray],
    viewing: Viewing,
    flicker: float,
    scale: FloatArray,
) -> GlowComparison:
    """Compare photographs with predictions, both multiplied by given factors.

    Parameters
    ----------
    series, predicted, viewing, flicker
        As of `compare_glow`.
    scale
        Factors of X, Y, Z of each photograph and its prediction, shape (n, 1).
    """
    xyz = series.values @ viewing.to_xyz.T
    photographed_lab = lab(scale * xyz, viewing.white)
    normalised = {name: scale * (values @ viewing.to_xyz.T) for name, values in predicted.items()}
    differences = {
        name: delta_e(photographed_lab, lab(values, viewing.white))
        for name, values in normalised.items()
    }
    seen = has_colour(series)
    nearest = min(differences, key=lambda name: float(differences[name][seen].mean()))
    unit = np.array(series.unit)
    return GlowComparison(
        patch=series.region,
        t_s=exposure_middles_s(series),
        first=unit == unit[0],
        seen=seen,
        photographed=scale * xyz,
        predicted=normalised,
        delta_e={name: np.where(seen, values, np.nan) for name, values in differences.items()},
        noise=np.where(seen, _noise(series, predicted[nearest], scale, viewing, flicker), np.nan),
    )


def has_colour(series: Series) -> NDArray[np.bool_]:
    """Return whether each photograph is bright enough for a colour (n,); true without a σ."""
    with np.errstate(invalid="ignore"):
        signal_to_noise = np.linalg.norm(series.values / series.sigma, axis=1)
    return np.asarray(~(signal_to_noise < MIN_FOR_COLOUR))


def _scale(series: Series, xyz: FloatArray, viewing: Viewing) -> FloatArray:
    """Return the factors of X, Y, Z of each photograph, shape (n, 1)."""
    reach = (xyz / viewing.white).max(axis=1)
    brightest = float(reach[has_colour(series)].max(initial=0.0))
    if not brightest > 0:
        raise DataError(f"{series.region}: every photograph is too dim to have a colour")
    reached = np.maximum(reach, np.finfo(float).eps * brightest)
    factor = reached if viewing.normalisation == "each" else np.full_like(reach, brightest)
    return np.asarray(1 / factor[:, np.newaxis])


def _noise(
    series: Series, expected: FloatArray, scale: FloatArray, viewing: Viewing, flicker: float
) -> FloatArray:
    """Return the CIEDE2000 between expected values and photographs of them with noise, (n,)."""
    if not np.isfinite(series.sigma).all():
        return np.full(len(expected), np.nan)
    rng = np.random.default_rng(0)
    shape = (DRAWS, len(expected))
    draws = expected * (1 + flicker * rng.standard_normal((*shape, 1)))
    draws = draws + series.sigma * rng.standard_normal((*shape, 3))
    drawn_lab = lab(scale * (draws @ viewing.to_xyz.T), viewing.white)
    expected_lab = lab(scale * (expected @ viewing.to_xyz.T), viewing.white)
    return np.asarray(delta_e(drawn_lab, expected_lab[np.newaxis]).mean(axis=0))


def glow_table(glows: Sequence[GlowComparison]) -> Table:
    """Return a table of the colour differences of every patch, of all patches and of the paper."""
    names = list(dict.fromkeys(name for glow in glows for name in glow.delta_e))
    rows = [
        (
            glow.patch,
            *(_mean_and_most([glow], name) for name in names),
            "–" if np.isnan(glow.mean_noise) else f"{glow.mean_noise:.2f}",
        )
        for glow in glows
    ]
    if len(glows) > 1:
        rows.append(("all patches", *(_mean_and_most(glows, name) for name in names), ""))
    paper_cells = {predicted_by(n): f"{d.mean:.2f} ({d.most:.2f})" for n, d in DELTA_E.items()}
    rows.append(("paper, 11 materials", *(paper_cells.get(name, "–") for name in names), ""))
    return Table(
        head=("patch", *names, "noise"),
        rows=tuple(rows),
        caption="CIEDE2000 of photographed and predicted glow, mean over all times and, in "
        "brackets, the largest; noise: the mean that the photographs' noise alone makes. "
        f"Photographs that stand out of their noise by less than {MIN_FOR_COLOUR:g} σ are left "
        "out. The paper does not say which white and normalisation its figures belong to.",
    )


def _mean_and_most(glows: Sequence[GlowComparison], name: str) -> str:
    values = [glow.delta_e[name] for glow in glows if name in glow.delta_e]
    if not values:
        return "–"
    all_values = np.concatenate(values)
    return f"{np.nanmean(all_values):.2f} ({np.nanmax(all_values):.2f})"
