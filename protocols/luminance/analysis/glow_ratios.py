"""Signal of a glow relative to that of a grey card in its place, over all settings of a run.

Exposures of card and glow differ by a million. Shutter times and sensitivities link them, nominal
ones or calibrated ones; where the sensitivity changes, frames at both tell the ratio.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from labrig.calibration import CameraFile, flicker_of, shutter_sigma
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.foundation.region import Region
from labrig.reduce import SeriesFrame, reduce_patches
from labrig.results import Measured, Series

#: Error of the ratio of two sensitivities, not calibrated (1 σ).
ISO_RATIO = 0.02
#: Range of ln t about a change of ISO in which frames tell the ratio.
NEAR_CHANGE = math.log(2.0)


@dataclass(frozen=True, eq=False)
class GlowRatios:
    """Signal of a patch of glow relative to that of the card in its place.

    Attributes
    ----------
    t_s
        Middles of the n exposures in seconds after lamp off.
    ratio, sigma
        Ratio of the glow to the card in the C channels, and σ by noise, shape (n, C).
    flicker
        Relative scatter of a frame's light, which its channels have in common.
    iso
        Sensitivity of every frame, shape (n,).
    dark_sigma
        σ of the dark level, common to frames at one ISO, relative to the card, shape (n, C).
    card_sigma
        Relative σ of the card's signal by noise and flicker.
    shutter_sigma
        Relative σ of the ratio by the shutter times.
    iso_sigma
        Relative σ of the ratio of every frame by its sensitivity's ratio to the card's, shape (n,).
    iso_source
        Origin of these ratios.
    ambient
        Light before the excitation relative to the card's, and its σ.
    card
        Signal of the card in the channels in DN/s.
    channels
        Names of the channels.
    """

    t_s: FloatArray
    ratio: FloatArray
    sigma: FloatArray
    flicker: float
    iso: FloatArray
    dark_sigma: FloatArray
    card_sigma: float
    shutter_sigma: float
    iso_sigma: FloatArray
    iso_source: str
    ambient: Measured
    card: FloatArray
    channels: tuple[str, ...]


def glow_ratios(
    name: str,
    region: Region,
    glow: Sequence[SeriesFrame],
    card: Sequence[SeriesFrame],
    darks: Sequence[SeriesFrame],
    camera: CameraFile | None,
) -> GlowRatios:
    """Reduce the frames of a patch, at every ISO by itself.

    Parameters
    ----------
    name, region
        Name and region of the patch.
    glow, card, darks
        Frames of the glow, of the card under the bare lamp, and dark ones before the excitation.
    camera
        Calibration of the camera; None takes nominal ratios of settings.

    Raises
    ------
    DataError
        All frames of the card, or of the glow, clip.
    """
    lit = reduce_patches(card, {name: region}, darks, camera=camera)[name]
    if not lit.usable.any():
        raise DataError(
            "every photograph of the card clips; lower camera.iso or close the aperture"
        )
    lit = lit.take(np.flatnonzero(lit.usable))
    settings = float(lit.iso[0]), _f_number(lit)
    flicker = flicker_of(camera)
    card_dn = lit.values.mean(axis=0)
    noise = np.sqrt(np.square(lit.sigma / lit.values).mean(axis=0)).min()
    parts = []
    for iso in sorted({frame.iso for frame in glow if frame.iso is not None}):
        at_iso = [frame for frame in glow if frame.iso == iso]
        series = reduce_patches(at_iso, {name: region}, darks, camera=camera)[name]
        rows = np.flatnonzero(series.usable)
        if len(rows):
            parts.append(_at_iso(series.take(rows), card_dn, settings, camera))
    if not parts:
        raise DataError("every photograph of the glow clips; lower camera.iso")
    t_s, ratio, sigma, isos, dark, iso_sigma, shutter = (
        np.concatenate([getattr(part, field) for part in parts])
        for field in ("t_s", "ratio", "sigma", "iso", "dark", "iso_sigma", "shutter")
    )
    order = np.argsort(t_s, kind="stable")
    counts = GlowRatios(
        t_s=t_s[order],
        ratio=ratio[order],
        sigma=sigma[order],
        flicker=flicker,
        iso=isos[order],
        dark_sigma=dark[order],
        card_sigma=math.hypot(float(noise), flicker) / math.sqrt(len(lit.t_s)),
        shutter_sigma=math.hypot(shutter_sigma(camera, lit.exposure_s[0]), float(shutter.min())),
        iso_sigma=iso_sigma[order],
        iso_source="nominal" if camera is None else "the camera's calibration",
        ambient=_ambient(name, region, darks, card_dn, settings, camera),
        card=card_dn,
        channels=lit.channels,
    )
    return _with_measured_isos(counts)


@dataclass(frozen=True, eq=False)
class _AtIso:
    t_s: FloatArray
    ratio: FloatArray
    sigma: FloatArray
    iso: FloatArray
    dark: FloatArray
    iso_sigma: FloatArray
    shutter: FloatArray


def _at_iso(
    series: Series,
    card_dn: FloatArray,
    card_settings: tuple[float, float | None],
    camera: CameraFile | None,
) -> _AtIso:
    """Return the frames at one ISO relative to the card's at its own."""
    iso = float(series.iso[0])
    gain, gain_sigma = _gain((iso, _f_number(series)), card_settings, camera)
    per_card = 1 / (card_dn * gain)
    ratio = series.values * per_card
    n = len(series.t_s)
    return _AtIso(
        t_s=series.t_s + series.exposure_s / 2,
        ratio=ratio,
        sigma=series.sigma * per_card,
        iso=series.iso,
        dark=np.broadcast_to(np.nan_to_num(series.dark_sigma) * per_card, ratio.shape),
        iso_sigma=np.full(n, gain_sigma),
        shutter=np.array([shutter_sigma(camera, at_s) for at_s in series.exposure_s]),
    )


def _f_number(series: Series) -> float | None:
    return None if np.isnan(series.f_number[0]) else float(series.f_number[0])


def _gain(
    settings: tuple[float, float | None],
    card: tuple[float, float | None],
    camera: CameraFile | None,
) -> tuple[float, float]:
    """Return the signal of the same light at some settings over that at the card's, and its σ."""
    if settings == card:
        return 1.0, 0.0
    if camera is None:
        return settings[0] / card[0], ISO_RATIO
    (own, own_sigma), (of_card, card_sigma) = camera.scale(*settings), camera.scale(*card)
    calibrated = own_sigma > 0 or settings[0] == camera.iso
    return own / of_card, math.hypot(own_sigma, card_sigma, 0.0 if calibrated else ISO_RATIO)


def _ambient(
    name: str,
    region: Region,
    darks: Sequence[SeriesFrame],
    card_dn: FloatArray,
    card_settings: tuple[float, float | None],
    camera: CameraFile | None,
) -> Measured:
    """Return the light in the dark frames relative to the card's, by what their channels differ.

    A sensor's dark current is the same in all channels, light is not: this is a lower limit.
    """
    if not darks:
        return Measured(0.0, math.inf)
    iso = max(frame.iso for frame in darks if frame.iso is not None)
    own = [frame for frame in darks if frame.iso == iso]
    longest_s = max(frame.exposure_s for frame in own)
    series = reduce_patches(own, {name: region})[name]
    rows, short = series.exposure_s == longest_s, series.exposure_s < longest_s
    if not short.any() or rows.sum() < 2:
        return Measured(0.0, math.inf)
    levels = series.values * series.exposure_s[:, np.newaxis]
    light = (levels[rows].mean(axis=0) - levels[short].mean(axis=0)) / longest_s
    sigma = levels[rows].std(axis=0, ddof=1) / longest_s / math.sqrt(int(rows.sum()))
    gain, _ = _gain((float(iso), _f_number(series)), card_settings, camera)
    brightest, darkest = int(np.argmax(light)), int(np.argmin(light))
    scale = 1 / (card_dn[brightest] * gain)
    difference = float(light[brightest] - light[darkest]) * scale
    return Measured(difference, float(np.hypot(sigma[brightest], sigma[darkest])) * scale)


def _with_measured_isos(counts: GlowRatios) -> GlowRatios:
    """Return the counts with the ratios of sensitivities by frames at both, where they change.

    About the change the logarithm of the signal is a parabola over ln t, with a step of the ISO.
    """
    isos = list(dict.fromkeys(counts.iso[np.argsort(counts.iso)].tolist()))
    ratio, sigma = counts.ratio.copy(), counts.iso_sigma.copy()
    brightest = int(np.argmax(counts.ratio[0] * counts.card))
    measured = False
    for lower, higher in pairwise(isos):
        later = counts.iso >= higher
        at_change = np.log(counts.t_s[counts.iso == higher].min())
        x = np.log(counts.t_s) - at_change
        near = (np.abs(x) < NEAR_CHANGE) & np.isin(counts.iso, (lower, higher))
        value = ratio[near, brightest]
        if near.sum() < 6 or (value <= 0).any():
            continue
        error = np.hypot(counts.sigma[near, brightest] / value, counts.flicker)
        step = (counts.iso[near] == higher).astype(np.float64)
        powers = np.stack([np.ones_like(value), x[near], x[near] ** 2, step], axis=1)
        prior = max(float(sigma[counts.iso == higher][0]), 1e-9)
        rows = np.vstack([powers / error[:, np.newaxis], [0.0, 0.0, 0.0, 1 / prior]])
        target = np.append(np.log(value) / error, 0.0)
        solution, *_ = np.linalg.lstsq(rows, target, rcond=None)
        step_sigma = math.sqrt(float(np.linalg.inv(rows.T @ rows)[3, 3]))
        ratio[later] /= math.exp(solution[3])
        before = float(sigma[counts.iso == lower][0])
        sigma[later] = math.hypot(before, step_sigma)
        measured = True
    source = f"frames at both where it changes, and {counts.iso_source}"
    scaled = counts.sigma * np.divide(
        ratio, counts.ratio, out=np.ones_like(ratio), where=counts.ratio != 0
    )
    return replace(
        counts,
        ratio=ratio,
        sigma=scaled,
        iso_sigma=sigma,
        iso_source=source if measured else counts.iso_source,
    )
