"""Irradiance on the sample, of the lamp and through the LVF or of lights, from frames of a card."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from labrig.analyse.exciting_lights import ExcitingLight, exciting_lights
from labrig.analyse.inputs import AnalysisContext
from labrig.analyse.strip import StripFrames
from labrig.bench_optics import camera_curves, card_reflectance, lamp_spectrum
from labrig.calibration import CAMERA_KIND, LVF_KIND, CardLight, IrradianceFile
from labrig.fit.spectrum import CurveError, camera_modes
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError, UsageError
from labrig.foundation.result_warning import Disturbance, ResultWarning, Undetermined
from labrig.optics import (
    CameraResponse,
    Lvf,
    Spectrum,
    Strip,
    Transmittance,
    band_integrals,
    quadrature,
)
from labrig.protocols.irradiance.protocol import CardFrames, Irradiance
from labrig.protocols.irradiance.result import CardRatio, IrradianceResult, StripScale
from labrig.protocols.steps.exciting_lights import ExcitingLights, light_unit
from labrig.reduce import FLICKER, region_values, sensor_layout, slice_values
from labrig.results import SliceValues

#: Relative change of the lamp between rounds that causes a warning.
DRIFT = 0.03
#: Standard deviation of ln transmittance along a strip from a parabola,
UNEVEN = 0.04
#: and its correlation length in nm.
UNEVEN_OVER_NM = 60.0
#: Prior σ of the parabola: bend and slope from the middle to the ends, height.
PARABOLA = (0.2, 0.3, 10.0)
#: Relative scatter of every position beyond its σ: strips are not smooth.
ROUGH = 0.02
#: Least factor, for its logarithm.
LEAST = 1e-6
#: Error of a camera's curves for a light alone, which has no neighbours as the places of a strip
#: have: published curves of one camera differ by 2 to 6 % of their peak (rms), 9 % of themselves.
ALONE = CurveError(relative=0.09, added=0.015)
#: Largest width in nm of the cells in which the spectra of lights are kept.
CELL_NM = 2.5
#: Relative σ of a light from which a warning is given.
HARDLY_KNOWN = 0.1
#: Relative σ of a lux meter's reading, with its mismatch to the eye.
LUX_SIGMA = 0.05
#: Step of derivatives by a band's parameters, in their σ.
_STEP = 0.5


def analyse(context: AnalysisContext) -> IrradianceResult:
    """Measure the irradiance in bands, by the lamp itself and behind every place of the filter.

    Raises
    ------
    UsageError
        No calibrated LVF is known, or curves are missing in the rig file.
    DataError
        Frames are missing or damaged, or some position was not lit.
    """
    if context.protocol.select is not None:
        return _of_lights(context, context.protocol.select)
    calibrated = context.inputs[LVF_KIND]
    if calibrated is None or calibrated.on_sample is None:
        raise UsageError(
            f"{context.run.folder}: no LVF is known that lies on the sample; run lvf_calibration, "
            "and name its run in the rig file (optics: {lvf: …}) or to labrig process --optics"
        )
    frames, lamp, strip = StripFrames(context), lamp_spectrum(context.rig), calibrated.on_sample
    values = _card_values(context, frames, strip)
    ratio = _card_ratio(context, values)
    position = np.array(strip.positions(*frames.size))
    lvf = calibrated.lvf.at(np.clip(position, calibrated.position[0], calibrated.position[-1]))
    camera = camera_curves(context.rig, context.overrides.camera, calibrated)
    scale = strip_scale(ratio, lvf, lamp, card_reflectance(context.rig), camera)
    return IrradianceResult(
        calibration=_file(context, strip, lvf, lamp, ratio, scale).model_copy(
            update={"card": _card_light(frames, values)}
        ),
        centre_nm=lvf.bands.centre_nm,
        card_ratio=ratio,
        scale=scale,
        warnings=tuple(_warnings(ratio)),
    )


def _of_lights(context: AnalysisContext, select: ExcitingLights) -> IrradianceResult:
    """Measure the irradiance in bands, by the lamp itself and by every selected light.

    Raises
    ------
    UsageError
        Curves are missing in the rig file, or nothing is known of a light.
    DataError
        Frames are missing or damaged, or some light was not seen.
    """
    frames, lamp = StripFrames(context), lamp_spectrum(context.rig)
    lit = [*frames.of(CardFrames.DIRECT), *frames.of(CardFrames.THROUGH)]
    regions = {"card": context.protocol.sites}
    values = region_values(lit, regions, frames.dark, context.inputs[CAMERA_KIND])
    names = select.names()
    ratio = mean_ratio(
        [
            (values[f"direct-{number}"], _stacked([values[unit] for unit in units]))
            for number in range(1, context.protocol.rounds + 1)
            if {f"direct-{number}", *(units := [light_unit(name, number) for name in names])}
            <= set(values)
        ]
    )
    lights = exciting_lights(context, select, lamp)
    camera = camera_curves(context.rig, context.overrides.camera, context.inputs[LVF_KIND])
    scale = light_scale(ratio, lights, names, lamp, card_reflectance(context.rig), camera)
    calibration = _file_of_lights(context, names, lights, lamp, ratio, scale)
    return IrradianceResult(
        calibration=calibration.model_copy(update={"card": _card_light(frames, values)}),
        centre_nm=np.array(calibration.centre_nm),
        card_ratio=ratio,
        scale=scale,
        warnings=(*_warnings(ratio), *_hardly_known(names, scale)),
    )


def _hardly_known(names: Sequence[str], scale: StripScale) -> Iterator[ResultWarning]:
    """Yield a warning if the camera alone determines some lights badly."""
    unknown = [
        f"{name} to {100 * sigma:.0f} %"
        for name, sigma in zip(names, scale.relative_sigma, strict=True)
        if sigma > HARDLY_KNOWN
    ]
    if unknown:
        yield Undetermined(
            "irradiance-uncertain",
            "the camera's curves determine the irradiance of some lights badly ({lights}), and so "
            "the excitation rates of their bands: let a spectrometer read the card, too "
            "('spectrometer' under 'devices'), or measure the camera's curves (camera_curves)",
            lights=tuple(unknown),
        )


def _stacked(values: Sequence[SliceValues]) -> SliceValues:
    """Return the values of one region in several scenes as those of as many regions."""
    return SliceValues(
        np.concatenate([one.value for one in values]), np.concatenate([one.sigma for one in values])
    )


def _file_of_lights(
    context: AnalysisContext,
    names: tuple[str, ...],
    lights: Sequence[ExcitingLight],
    lamp: Spectrum,
    card: CardRatio,
    scale: StripScale,
) -> IrradianceFile:
    edges, cells_nm = np.array(context.protocol.bands_nm), _cells_nm(context.protocol.bands_nm)
    direct = band_integrals(lamp.wavelength_nm, lamp.value, edges)
    norm = context.protocol.vector_length / float(np.linalg.norm(direct))
    factor = scale.value[:, np.newaxis] * norm
    through, moved, through_cells = (
        factor
        * np.array(
            [
                band_integrals(one.spectrum.wavelength_nm + shift * one.wavelength_sigma_nm,
                               one.spectrum.value, limits_nm)
                for one in lights
            ]
        )
        for shift, limits_nm in ((0, edges), (1, edges), (0, cells_nm))
    )  # fmt: skip
    sigma = np.hypot(through * scale.relative_sigma[:, np.newaxis], moved - through)
    ratio = norm * direct.sum() / through.sum(axis=1)
    centre_nm, width_nm = np.array([_moments(one.spectrum, edges) for one in lights]).T
    return IrradianceFile(
        lamp=lamp.name,
        bands_nm=context.protocol.bands_nm,
        vector_length=context.protocol.vector_length,
        direct=tuple((norm * direct).tolist()),
        direct_sigma=tuple(_direct_sigma(lamp, edges, norm).tolist()),
        lights=names,
        centre_nm=tuple(centre_nm.tolist()),
        width_nm=tuple(width_nm.tolist()),
        through=tuple(tuple(row) for row in through.tolist()),
        through_sigma=tuple(tuple(row) for row in sigma.tolist()),
        wavelength_sigma_nm=tuple(one.wavelength_sigma_nm for one in lights),
        cells_nm=tuple(cells_nm.tolist()),
        direct_cells=tuple(
            (norm * band_integrals(lamp.wavelength_nm, lamp.value, cells_nm)).tolist()
        ),
        through_cells=tuple(tuple(row) for row in through_cells.tolist()),
        scale_sigma=card.common_sigma,
        ratio=tuple(ratio.tolist()),
        ratio_sigma=tuple((ratio * np.hypot(scale.relative_sigma, card.common_sigma)).tolist()),
        illuminance_lux=context.protocol.illuminance_lux,
        illuminance_lux_sigma=_lux_sigma(context.protocol),
        source=f"grey card by itself and by selected lights in {card.rounds} rounds, with labrig",
        run=context.run.name,
    )


def _cells_nm(bands_nm: Sequence[float]) -> FloatArray:
    """Return the edges of cells of at most `CELL_NM` into which every band is divided evenly."""
    cells = [
        np.linspace(low, high, math.ceil((high - low) / CELL_NM), endpoint=False)
        for low, high in pairwise(bands_nm)
    ]
    return np.append(np.concatenate(cells), bands_nm[-1])


def _moments(light: Spectrum, edges_nm: FloatArray) -> tuple[float, float]:
    """Return mean and standard deviation in nm of the wavelengths of a light within the bands."""
    grid_nm = np.arange(edges_nm[0], edges_nm[-1] + 0.5)
    weight = light.at(grid_nm)
    mean = float(np.average(grid_nm, weights=weight))
    return mean, float(np.sqrt(np.average((grid_nm - mean) ** 2, weights=weight)))


def _card_values(
    context: AnalysisContext, frames: StripFrames, strip: Strip
) -> Mapping[str, SliceValues]:
    """Return the light of the card along the strip's place, scene by scene."""
    lit = [*frames.of(CardFrames.DIRECT), *frames.of(CardFrames.THROUGH)]
    return slice_values(lit, strip, frames.dark, context.inputs[CAMERA_KIND])


def _card_light(frames: StripFrames, values: Mapping[str, SliceValues]) -> CardLight | None:
    """Return the mean light of the card under the lamp itself; None where it clips."""
    direct = [one for unit, one in values.items() if unit.startswith("direct-")]
    value = np.mean([one.value.mean(axis=0) for one in direct], axis=0)
    first = frames.of(CardFrames.DIRECT)[0]
    if not np.isfinite(value).all() or first.iso is None:
        return None
    noise = np.mean([np.hypot.reduce(one.sigma, axis=0) for one in direct], axis=0)
    sigma = np.hypot(noise / len(direct[0].value), FLICKER * value) / np.sqrt(len(direct))
    return CardLight(
        iso=first.iso,
        f_number=first.f_number,
        channels=sensor_layout(frames.dark[0]).channels,
        dn_per_s=tuple(value.tolist()),
        sigma_dn_per_s=tuple(sigma.tolist()),
    )


def _card_ratio(context: AnalysisContext, values: Mapping[str, SliceValues]) -> CardRatio:
    return mean_ratio(
        [
            (values[f"direct-{number}"], values[f"through-{number}"])
            for number in range(1, context.protocol.rounds + 1)
            if f"direct-{number}" in values and f"through-{number}" in values
        ]
    )


def mean_ratio(pairs: Sequence[tuple[SliceValues, SliceValues]]) -> CardRatio:
    """Average the ratios of the rounds.

    Parameters
    ----------
    pairs
        Slice values of each round, of the card by itself and through the LVF.
    """
    ratios = np.stack([through.value / direct.value for direct, through in pairs])
    relative = [
        np.hypot(through.sigma / direct.value, ratio * direct.sigma / direct.value)
        for (direct, through), ratio in zip(pairs, ratios, strict=True)
    ]
    weight = 1 / np.stack(relative) ** 2
    total = weight.sum(axis=0)
    mean = (weight * ratios).sum(axis=0) / total
    is_clear = mean > 30 / np.sqrt(total)
    round_ratios = [float(np.median((ratio / mean)[is_clear])) for ratio in ratios]
    drift = float(np.std(round_ratios, ddof=1)) if len(round_ratios) > 1 else 0.0
    common = float(np.hypot(FLICKER * np.sqrt(2), drift) / np.sqrt(len(pairs)))
    return CardRatio(mean, 1 / np.sqrt(total), common, drift, len(pairs))


def _file(
    context: AnalysisContext,
    strip: Strip,
    lvf: Lvf,
    lamp: Spectrum,
    card: CardRatio,
    scale: StripScale,
) -> IrradianceFile:
    edges = np.array(context.protocol.bands_nm)
    direct = band_integrals(lamp.wavelength_nm, lamp.value, edges)
    norm = context.protocol.vector_length / float(np.linalg.norm(direct))
    shape, shape_sigma = in_bands(lvf, lamp, edges)
    factor = scale.value[:, np.newaxis] * norm
    relative = scale.relative_sigma
    through = shape * factor
    sigma = np.hypot(through * relative[:, np.newaxis], shape_sigma * factor)
    ratio = norm * direct.sum() / through.sum(axis=1)
    return IrradianceFile(
        lamp=lamp.name,
        bands_nm=context.protocol.bands_nm,
        vector_length=context.protocol.vector_length,
        direct=tuple((norm * direct).tolist()),
        direct_sigma=tuple(_direct_sigma(lamp, edges, norm).tolist()),
        position=tuple(lvf.position.tolist()),
        through=tuple(tuple(row) for row in through.tolist()),
        through_sigma=tuple(tuple(row) for row in sigma.tolist()),
        scale_sigma=card.common_sigma,
        ratio=tuple(ratio.tolist()),
        ratio_sigma=tuple((ratio * np.hypot(relative, card.common_sigma)).tolist()),
        strip=strip,
        illuminance_lux=context.protocol.illuminance_lux,
        illuminance_lux_sigma=_lux_sigma(context.protocol),
        source=f"grey card by itself and through the LVF in {card.rounds} rounds, with labrig",
        run=context.run.name,
    )


def _lux_sigma(protocol: Irradiance) -> float | None:
    """Return σ of the lux meter's reading; None without one."""
    if protocol.illuminance_lux is None or protocol.illuminance_lux_sigma is not None:
        return protocol.illuminance_lux_sigma
    return LUX_SIGMA * protocol.illuminance_lux


def _direct_sigma(lamp: Spectrum, edges: FloatArray, norm: float) -> FloatArray:
    """Return σ of the direct irradiance by the lamp's file.

    Errors of neighbouring wavelengths count as fully correlated.
    """
    if lamp.sigma is None:
        return np.zeros(len(edges) - 1)
    return norm * band_integrals(lamp.wavelength_nm, lamp.sigma, edges)


def _warnings(card: CardRatio) -> Iterator[ResultWarning]:
    if card.drift > DRIFT:
        yield Disturbance(
            "lamp-drifts",
            "the lamp changed by {drift:.1%} from round to round; let it warm up for longer, or "
            "look for something that was moved",
            drift=card.drift,
        )


def strip_scale(
    ratio: CardRatio,
    lvf: Lvf,
    lamp: Spectrum,
    card: Transmittance,
    camera: CameraResponse,
    curve_error: CurveError = CurveError(),  # noqa: B008 (frozen)
) -> StripScale:
    """Fit one factor for each position, such that lamp × LVF × factor explains the card's ratios.

    The camera's curves determine how bright a narrow band appears relative to the whole lamp, with
    errors of some per cent, more in the violet. The transmittance of a strip varies smoothly along
    it. Both are weighted by their covariances.

    Parameters
    ----------
    ratio
        Ratios of the card at p positions; only their independent uncertainty is used.
    lvf
        The filter at these positions.
    lamp, card
        Spectrum of the lamp and reflectance of the card.
    camera, curve_error
        Curves of the camera and their error model.

    Raises
    ------
    DataError
        No colour was measured at some position.
    """
    low, high = float(camera.wavelength_nm[0]), float(camera.wavelength_nm[-1])
    nodes, weights = quadrature(
        low, high, camera.wavelength_nm, lamp.wavelength_nm, card.wavelength_nm
    )
    light = weights * lamp.at(nodes) * card.at(nodes)
    transmitted = lvf.transmission(nodes) * light
    changes = _parameter_changes(lvf, nodes, light)
    value, noise, curves = _factors(ratio, nodes, light, transmitted, changes, camera, curve_error)
    covariance = np.diag(noise**2 + ROUGH**2) + curves @ curves.T
    return _smooth(value, covariance, lvf)


def light_scale(
    ratio: CardRatio,
    lights: Sequence[ExcitingLight],
    names: Sequence[str],
    lamp: Spectrum,
    card: Transmittance,
    camera: CameraResponse,
) -> StripScale:
    """Fit one factor for each selected light, such that light × factor explains the card's ratios.

    What is known of a light beforehand, as of a filter by its transmittance, is weighted with it.

    Parameters
    ----------
    ratio
        Ratios of the card's light under every light to that under the lamp itself.
    lights, names
        What is known of the lights, and their names.
    lamp, card
        Spectrum of the lamp and reflectance of the card.
    camera
        Curves of the camera.

    Raises
    ------
    DataError
        Some light was not seen.
    """
    low, high = float(camera.wavelength_nm[0]), float(camera.wavelength_nm[-1])
    knots = [one.spectrum.wavelength_nm for one in lights]
    nodes, weights = quadrature(
        low, high, camera.wavelength_nm, lamp.wavelength_nm, card.wavelength_nm, *knots
    )
    reflected = weights * card.at(nodes)
    spectra = np.array([reflected * one.spectrum.at(nodes) for one in lights])
    moved = np.array([reflected * one.shifted(nodes) for one in lights])
    for name, measured in zip(names, ratio.value, strict=True):
        if not np.isfinite(measured).any():
            raise DataError(f"light '{name}': nothing was measured of it; expose longer")
    value, noise, curves = _factors(
        ratio, nodes, reflected * lamp.at(nodes), spectra, (moved - spectra)[np.newaxis], camera,
        ALONE,
    )  # fmt: skip
    covariance = np.diag(noise**2) + curves @ curves.T
    # Of the logarithm: an unknown level weighs nothing.
    weight = np.diag([1 / one.level_sigma**2 for one in lights])
    information = np.linalg.inv(covariance)
    posterior = np.linalg.inv(information + weight)
    return StripScale(
        np.exp(posterior @ information @ np.log(value)),
        posterior,
        value,
        np.sqrt(np.diag(covariance)),
    )


def _factors(
    ratio: CardRatio,
    nodes: FloatArray,
    light: FloatArray,
    transmitted: FloatArray,
    changes: FloatArray,
    camera: CameraResponse,
    curve_error: CurveError,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return factors (p,), their relative σ by noise and figures, errors by the curves (p, modes).

    Parameters
    ----------
    ratio
        Ratios of the card at p places or under p lights.
    nodes, light
        Wavelengths in nm and the card's light under the lamp itself, shape (q,).
    transmitted, changes
        The card's light at every place (p, q), and its change by one σ of each figure (f, p, q).
    camera, curve_error
        Curves of the camera and their error model.
    """
    sensitivity = camera.at(nodes)
    total = light @ sensitivity
    expected = transmitted @ sensitivity / total
    modes = camera_modes(camera, nodes, curve_error)
    # (modes, p, channels) of the expected ratio.
    curve_errors = np.stack(
        [transmitted @ mode / total - expected * (light @ mode / total) for mode in modes]
    )
    figure_changes = changes @ sensitivity / total
    value, noise, curve_factors = np.empty(len(expected)), np.empty(len(expected)), []
    for k in range(len(expected)):
        used = np.isfinite(ratio.value[k]) & (expected[k] > 0)
        if not used.any():
            raise DataError(f"position p{k:02d}: no light was measured; expose longer")
        measured, measured_sigma, position_errors = (
            ratio.value[k, used],
            ratio.sigma[k, used],
            curve_errors[:, k, used],
        )
        weight = _weights(measured, expected[k, used], measured_sigma, position_errors)
        value[k] = max(float(weight @ measured), LEAST)
        noise_variance = (weight**2) @ measured_sigma**2 / value[k] ** 2
        figure_variance = ((figure_changes[:, k, used] @ weight) ** 2).sum()
        noise[k] = float(np.sqrt(noise_variance + figure_variance))
        curve_factors.append(position_errors @ weight)
    return value, noise, np.array(curve_factors)


def _weights(
    measured: FloatArray, expected: FloatArray, sigma: FloatArray, curve_errors: FloatArray
) -> FloatArray:
    """Return the generalised-least-squares weights of a position's ratios, shape (channels,).

    The weighted sum of the ratios is the position's factor. The covariance is that of noise
    `sigma` (channels,) and of the curves' modes (modes, channels).
    """
    start = max(float(measured @ expected / (expected @ expected)), LEAST)
    covariance = np.diag(sigma**2) + start**2 * curve_errors.T @ curve_errors
    weight = np.linalg.solve(covariance, expected)
    weights: FloatArray = weight / (weight @ expected)
    return weights


def _parameter_changes(lvf: Lvf, nodes: FloatArray, light: FloatArray) -> FloatArray:
    """Return the change of the transmitted light by one σ of each band parameter, (figures, p, q).

    Centre, width and shape of a band change at its area: the total transmittance is measured here,
    its distribution is that of the calibration.
    """
    if lvf.sigma is None:
        return np.zeros((1, len(lvf.position), len(nodes)))
    changes = []
    for name in ("centre_nm", "fwhm_nm", "skew", "leakage"):
        change = lvf.changed_bands(name, _STEP).transmission(nodes) - lvf.bands.transmission(nodes)
        changes.append(change * light / _STEP)
    return np.array(changes)


def _smooth(value: FloatArray, covariance: FloatArray, lvf: Lvf) -> StripScale:
    """Combine the logarithms of the factors with a smooth prior along the strip."""
    centre = lvf.bands.centre_nm
    area = np.log(lvf.bands.peak * lvf.bands.fwhm_nm)
    distance = (centre[:, np.newaxis] - centre) / UNEVEN_OVER_NM
    powers = np.vander((centre - centre.mean()) / np.ptp(centre) * 2, 3)
    parabola = (powers * np.square(PARABOLA)) @ powers.T
    prior = UNEVEN**2 * np.exp(-(distance**2) / 2) + parabola
    gain = np.linalg.solve(prior + covariance, prior).T
    course = gain @ (np.log(value) + area)
    posterior = prior - gain @ prior
    return StripScale(
        np.exp(course - area),
        (posterior + posterior.T) / 2,
        value,
        np.sqrt(np.diag(covariance)),
    )


def in_bands(lvf: Lvf, lamp: Spectrum, edges_nm: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return ∫ L T_p dλ over bands and its σ by the parameters of the filter, (p, bands) each.

    The area of a band is left out: `strip_scale` measures it.
    """
    value = _in_bands(lvf, lamp, edges_nm)
    if lvf.sigma is None:
        return value, np.zeros_like(value)
    variance = np.zeros_like(value)
    for name in ("centre_nm", "fwhm_nm", "skew", "leakage"):
        changed_lvf = replace(lvf, bands=lvf.changed_bands(name, _STEP))
        variance += ((_in_bands(changed_lvf, lamp, edges_nm) - value) / _STEP) ** 2
    return value, np.sqrt(variance)


def _in_bands(lvf: Lvf, lamp: Spectrum, edges_nm: FloatArray) -> FloatArray:
    rows = []
    for low, high in pairwise(edges_nm):
        nodes, weights = quadrature(low, high, lamp.wavelength_nm, lvf.remainder_nm)
        rows.append(lvf.transmission(nodes) @ (weights * lamp.at(nodes)))
    return np.stack(rows, axis=1)
