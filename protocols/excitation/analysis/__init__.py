"""Analysis of an excitation run, from its frames to rates and a material of every patch.

A decay of a dozen photographs tells the flicker to a quarter of itself; the photographs after all
charges are ten times as many.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from labrig.analyse.frames import require_intact
from labrig.analyse.inputs import AnalysisContext
from labrig.analyse.series_fit import fit_series
from labrig.analyse.strip import StripPatch, for_each_patch
from labrig.analyse.surface import patch_reflectance, with_layer, with_reflectance
from labrig.analyse.temperature import at_temperature
from labrig.calibration import (
    BLANK_KIND,
    CAMERA_KIND,
    FADE_KIND,
    IRRADIANCE_KIND,
    REFLECTANCE_KIND,
    TYPICAL_FLICKER,
    IrradianceFile,
    Warming,
)
from labrig.fit.excitation import RelativeSigmas
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError
from labrig.foundation.result_warning import (
    Contradiction,
    Misfit,
    ResultWarning,
    Unmeasured,
)
from labrig.protocols.excitation.analysis.charge_intervals import GLOWING
from labrig.protocols.excitation.analysis.charging_series import evened, patch_chargings
from labrig.protocols.excitation.analysis.closure import predicted_charging
from labrig.protocols.excitation.analysis.lamp_light import (
    LAMP_SIGMA,
    MAX_FACTOR,
    band_sigma,
    light_scatter,
    remembered_warmth,
    scale_sigma,
    scatter_by_warmth,
)
from labrig.protocols.excitation.analysis.material import excited_material, largest_density
from labrig.protocols.excitation.analysis.orders import ChosenOrders, OrderFits
from labrig.protocols.excitation.analysis.radiometric_scale import (
    RadiometricScale,
    radiometric_scale,
)
from labrig.protocols.excitation.analysis.selected_light import (
    course_warnings,
    with_doubt,
    within_bands,
)
from labrig.protocols.excitation.options import ExcitationOptions
from labrig.protocols.excitation.result import ExcitationResult, PatchCharging, PatchExcitation
from labrig.record import FrameRole
from labrig.results import ChargingSeries, Closure, EmissionSpectrum, FittedDecay, FittedExcitation


def common_flicker(
    fit: FittedExcitation, series: Sequence[ChargingSeries], dark_sigma: Sequence[float]
) -> float:
    """Return the relative flicker of all photographs by the method of moments.

    A photograph is f times as bright as the fit says: f² has the mean of the squared flicker and of
    the variance that noise and dark level give it. Every charge's lamp and the rates follow some of
    the flicker, which so many photographs fewer tell.

    Parameters
    ----------
    fit, series
        A fit, and its series.
    dark_sigma
        Scatter of the dark level in the values' unit, shape (C,).
    """
    parts = [
        _deviations(charging, residuals, np.array(dark_sigma))
        for charging, residuals in zip(series, fit.residuals, strict=True)
    ]
    deviation, variance = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    weight = 1 / (TYPICAL_FLICKER**2 + variance) ** 2
    lamp = sum(sum(len(charge.start_s) > 0 for charge in charging.charges) for charging in series)
    # As many photographs as there are weights of the largest size.
    effective = weight.sum() ** 2 / np.square(weight).sum()
    free = effective - lamp - 3 * len(fit.states)
    if free < 1:
        return TYPICAL_FLICKER
    mean_square = weight @ (deviation**2 * effective / free - variance) / weight.sum()
    return float(np.sqrt(max(mean_square, 0.0)))


def _deviations(
    charging: ChargingSeries, residuals: FloatArray, dark_sigma: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the relative deviation of every measured photograph, and its variance by noise."""
    signal = charging.values - residuals * charging.sigma
    is_measured = np.isfinite(residuals)
    scaled = np.where(is_measured, signal / charging.sigma, 0.0)
    power = np.square(scaled).sum(axis=(1, 2))
    along_dark = np.where(is_measured, scaled / charging.sigma, 0.0).sum(axis=1)
    glows = power > 0
    power, along_dark = power[glows], along_dark[glows]
    deviation = (scaled * np.nan_to_num(residuals)).sum(axis=(1, 2))[glows] / power
    variance = 1 / power + np.square(along_dark * dark_sigma).sum(axis=1) / power**2
    return deviation, variance


#: Typical warm-up of a lamp where it was not measured.
USUAL = Warming(deficit=0.02, deficit_sigma=0.02, time_constant_s=150.0)
#: Numbers of the series, in the order of `_series`. The norm of k_e is the irradiance by the lamp
#: itself, so that its charges, which the ratio to the light behind the filter does not enter,
#: measure the level of all k_e.
THROUGH, DIRECT = range(2)
#: Fits after which the course of excitation within bands stays the same.
COURSES = 2
#: Fraction of the largest size of the light's errors from which a warning is given.
AT_END = 0.9
#: Deviation of the closure in σ that causes a warning.
CLOSURE_SIGMAS = 3.0
#: σ of the fraction of the frame's light that lies over every site: glare of a photographic lens is
#: 0.3 to 3 %, and surfaces light one another.
VEIL_SIGMA = 0.02
#: Relative σ of the evenness that the direct charges alone tell: what charges through the filter
#: have left lies over them, up to the glow itself.
EVENNESS_SIGMA = 0.3
#: σ of the concentration that earlier charges, of a decay or of daylight, have left in the sample.
START_SIGMA = 0.1
#: Least standard uncertainty of a dark level in DN/s.
MIN_DARK = 1e-3


def analyse(context: AnalysisContext) -> ExcitationResult:
    """Reduce all charges, and fit those of every patch together.

    Raises
    ------
    DataError
        The light on the sample is unknown, or charges are missing.
    FitError
        Nothing glows, or the glow cannot be fitted.
    """
    irradiance, fade, blank = (
        context.inputs[IRRADIANCE_KIND],
        context.inputs[FADE_KIND],
        context.inputs[BLANK_KIND],
    )
    if irradiance is None:
        raise DataError(
            "expected the light on every place of the sample, got none; run irradiance and name "
            "its run in the rig file ('optics: {irradiance: …}') or to labrig process --optics"
        )
    require_intact(context.run, (*GLOWING, FrameRole.DARK), context.overrides)
    warming = USUAL if fade is None or fade.warming is None else fade.warming
    chargings, left_out = patch_chargings(context, irradiance, warming)
    patches, warnings = for_each_patch(
        list(chargings),
        lambda patch: _patch_excitation(context, patch, chargings[patch], irradiance, warming),
    )
    usual = Unmeasured("fade-unmeasured", "the lamp's fade was not measured: a usual one was taken")
    unmeasured = () if fade else (usual,)
    leaks = blank.leaks() if blank else ()
    return ExcitationResult(
        irradiance=irradiance,
        patches=patches,
        warnings=(*unmeasured, *leaks, *left_out, *warnings),
    )


def _patch_excitation(
    context: AnalysisContext,
    patch: StripPatch,
    charging: PatchCharging,
    irradiance: IrradianceFile,
    warming: Warming,
) -> tuple[PatchExcitation, Sequence[ResultWarning]]:
    """Return the patch's excitation, and warnings."""
    decay = fit_series(charging.whole, _states(context, patch))
    charging = remembered_warmth(charging, decay, warming.deficit, warming.time_constant_s)
    dark = tuple(np.maximum(np.nan_to_num(charging.whole.dark_sigma), MIN_DARK).tolist())
    relative_sigmas = RelativeSigmas(
        flicker=_flicker(context, decay),
        lamp=LAMP_SIGMA,
        least_lamp=scatter_by_warmth(charging, warming.deficit_sigma),
        cold_deficit=warming.deficit_sigma,
        offset=dark,
        # The sensor warms and cools over hours of long exposures, more than dark frames show.
        common_mode=dark,
        veil=VEIL_SIGMA,
        evenness=EVENNESS_SIGMA,
        start=START_SIGMA,
        scale=scale_sigma(irradiance),
        defining=DIRECT,
        irradiance=band_sigma(irradiance),
        largest_factor=MAX_FACTOR,
    )
    fits = OrderFits(_series(charging), decay, relative_sigmas, _asked_states(context) is not None)
    choice = fits.chosen(context.options(ExcitationOptions).order)
    if context.inputs[CAMERA_KIND] is None:
        flicker = common_flicker(choice.best, _series(charging), dark)
        relative_sigmas = replace(relative_sigmas, flicker=flicker)
        choice = replace(choice, relative_sigmas=relative_sigmas)
    charging = evened(charging, choice.best)
    even: FittedExcitation | None = None
    if irradiance.lights:
        by_leds = bool(context.protocol.select.leds)
        charging, even = _within_bands(charging, irradiance, choice, by_leds=by_leds)
    fit = choice.fitted(
        _series(charging), "all" if context.options(ExcitationOptions).intervals else "auto"
    )
    fit = fit if even is None else with_doubt(fit, even)
    density, basis = largest_density(
        irradiance.bands_nm,
        context.protocol.sample.max_optical_density,
        patch_reflectance(patch.folder, context.inputs[REFLECTANCE_KIND]),
    )
    fit = choice.in_a_layer(_series(charging), fit, density, basis)
    closure = predicted_charging(charging, relative_sigmas, _fitting_by_places(choice, even))
    run, spectra = context.run, context.inputs.spectra
    spectrum = patch.own(spectra)
    frames = tuple(frame.path.name for role in GLOWING for frame in run.frames(role))
    material = excited_material(fit, irradiance, spectrum, patch.material, run.name, frames)
    no_spectrum = (
        (
            Unmeasured(
                "no-emission-spectrum",
                "no emission spectrum of this patch was measured, so that its material has no Λ",
            ),
        )
        if spectra and spectrum is None
        else ()
    )
    if spectrum is not None and (scale := _scale(context, charging, fit, irradiance, spectrum)):
        material = scale.of(material)
    material = with_reflectance(material, patch.folder, context.inputs[REFLECTANCE_KIND])
    material = with_layer(material, context.protocol.sample)
    material = at_temperature(material, run, context.protocol.rate_frames)
    return (
        PatchExcitation(charging, decay, fit, light_scatter(fit), material, closure),
        (
            # Exponentials are a start only where another law was chosen for all charges.
            *(decay.warnings if fit.is_first_order else ()),
            *fit.warnings,
            *_layer_warnings(fit),
            *_light_warnings(fit),
            *(course_warnings(fit, irradiance) if irradiance.lights else ()),
            *_closure_warnings(closure),
            *no_spectrum,
        ),
    )


def _within_bands(
    charging: PatchCharging, irradiance: IrradianceFile, choice: ChosenOrders, *, by_leds: bool
) -> tuple[PatchCharging, FittedExcitation]:
    """Return the charging with its light as excitation sees it, and a fit by even excitation.

    Each fit knows more of the course of excitation.
    """
    even = fit = choice.fitted(_series(charging))
    for _ in range(COURSES):
        charging = within_bands(charging, irradiance, fit, by_leds=by_leds)
        fit = choice.fitted(_series(charging))
    return within_bands(charging, irradiance, fit, by_leds=by_leds), even


def _fitting_by_places(
    choice: ChosenOrders, even: FittedExcitation | None
) -> Callable[[PatchCharging], FittedExcitation]:
    """Return the function by whose k_e charging by the lamp itself is predicted.

    Its level is that of the light on the places: charges by the lamp itself are what is tested.
    """
    by_places = replace(choice, relative_sigmas=replace(choice.relative_sigmas, defining=THROUGH))

    def fitted(charging: PatchCharging) -> FittedExcitation:
        fit = by_places.fitted(_series(charging))
        return fit if even is None else with_doubt(fit, even)

    return fitted


def _scale(
    context: AnalysisContext,
    charging: PatchCharging,
    fit: FittedExcitation,
    irradiance: IrradianceFile,
    spectrum: EmissionSpectrum,
) -> RadiometricScale | None:
    """Return the radiometric scale of the patch's amplitudes, where the bench tells it."""
    whole = charging.whole
    channel = whole.channels[int(np.argmax(fit.channel_weights))]
    iso, f_number = float(whole.iso[0]), float(whole.f_number[0])
    aperture = None if np.isnan(f_number) else f_number
    return radiometric_scale(context, irradiance, spectrum, channel, iso, aperture)


def _light_warnings(fit: FittedExcitation) -> Iterator[ResultWarning]:
    if max((fit.lamp_sigma / LAMP_SIGMA, *fit.site_sizes)) > AT_END * MAX_FACTOR:
        light = light_scatter(fit)
        places = (
            ""
            if light.sites is None or light.wavelength_nm is None
            else f", {100 * light.sites:.1f} % from place to place and {light.wavelength_nm:.1f} "
            "nm in wavelength"
        )
        yield Misfit(
            "light-scatters",
            "the light seems to be off by {lamp_percent:.1f} % from charge to charge{places}, "
            "which is about the most that is tried, so that σ may be too small: the irradiance is "
            "of another bench or filter, excitation changes much within a band (give narrower "
            "bands to irradiance), or the rate equation does not hold",
            lamp_percent=100 * light.lamp,
            places=places,
        )


def _layer_warnings(fit: FittedExcitation) -> Iterator[ResultWarning]:
    if fit.layer is not None and fit.layer.is_shown:
        yield Misfit(
            "layer-thick",
            "the charges are those of a layer, not a surface: {effect}; measure a thinner one",
            effect=str(fit.layer),
        )


def _closure_warnings(closure: Closure | None) -> Iterator[ResultWarning]:
    if closure is not None and closure.rms_sigma > CLOSURE_SIGMAS:
        yield Contradiction(
            "closure-failed",
            "charging by the lamp itself is predicted from the bands only within "
            "{rms_percent:.1f} % ({rms_sigmas:.1f} σ): the lamp has light outside of the bands, "
            "the ratio of irradiances is wrong, or the rate equation does not hold",
            rms_percent=closure.rms_percent,
            rms_sigmas=closure.rms_sigma,
        )


def _asked_states(context: AnalysisContext) -> int | None:
    """Return the number of states that is asked for; None if the data choose it."""
    protocol_states = context.protocol.states
    return context.options(ExcitationOptions).states or (
        None if protocol_states == "auto" else protocol_states
    )


def _states(context: AnalysisContext, patch: StripPatch) -> int | None:
    """Return the number of states of an earlier decay of this patch, if none is asked for."""
    states = _asked_states(context)
    if states is None and (decay := patch.own(context.inputs.decays)) is not None:
        return decay.n_states
    return states


def _series(charging: PatchCharging) -> list[ChargingSeries]:
    return [charging.through, charging.direct]


def _flicker(context: AnalysisContext, decay: FittedDecay) -> float:
    if (camera := context.inputs[CAMERA_KIND]) is not None:
        return camera.flicker
    return decay.flicker if decay.flicker > 0 else TYPICAL_FLICKER
