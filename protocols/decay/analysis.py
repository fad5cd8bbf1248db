"""Analysis of a decay, from its frames to a fit of every patch."""

import math
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from importlib.metadata import version

import numpy as np

from labrig.analyse.frame_times import timing_warnings
from labrig.analyse.frames import (
    glare_warning,
    intact_frames,
    require_calibrated_camera,
    without_stray_light,
)
from labrig.analyse.inputs import AnalysisContext
from labrig.analyse.series_fit import fit_series
from labrig.analyse.surface import with_layer, with_reflectance
from labrig.analyse.temperature import drift_an_hour, drift_warnings
from labrig.calibration import BLANK_KIND, CAMERA_KIND, REFLECTANCE_KIND
from labrig.fit import DecayFit
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import FitError
from labrig.foundation.region import Region
from labrig.foundation.result_warning import Disturbance, ResultWarning, Undetermined
from labrig.material import Material, Provenance, State
from labrig.protocols.decay.options import DecayOptions
from labrig.protocols.decay.result import DecayResult
from labrig.record import FrameRole, charge_durations_s, glow_temperature_c
from labrig.reduce import (
    WHOLE_FRAME,
    WHOLE_FRAME_NAME,
    NoiseModel,
    reduce_patches,
    sensor_layout,
    variance_terms,
)
from labrig.results import EXPONENTIALS, DecayPatch, FittedDecay, Measured, NoiseBudget, Series

#: Terms of the photon-transfer line: constant, ∝ light, ∝ light².
_TERMS = 3
#: Least signal of a frame in σ for relative uncertainties.
MIN_SIGNAL = 1e-3


def noise_budget(series: Series, fit: FittedDecay) -> NoiseBudget | None:
    """Return the noise budget of the first decay's fitted frames.

    It is None if the frames are too few, or σ is unknown.
    """
    brightest = fit.brightest
    signal, _ = fit.signal(series.t_s, series.exposure_s)
    # Comparisons with an unknown σ are false.
    rows = np.flatnonzero(series.usable & (signal > MIN_SIGNAL * series.sigma[:, brightest]))
    if len(rows) <= _TERMS:
        return None
    fitted, signal = series.take(rows), signal[rows]
    parts = np.sqrt(noise_parts(fitted, brightest, signal)) / signal[:, np.newaxis]
    first = np.flatnonzero(np.array(fitted.unit) == fitted.unit[0])
    first = first[np.argsort(fitted.t_s[first], kind="stable")]
    dark_sigma = np.nan_to_num(fitted.dark_sigma[brightest])
    return NoiseBudget(
        t_s=(fitted.t_s + fitted.exposure_s / 2)[first],
        photon=parts[first, 1],
        read=parts[first, 0],
        uneven=parts[first, 2],
        flicker=np.full(len(first), fit.flicker),
        dark_level=dark_sigma / signal[first],
    )


def noise_parts(series: Series, channel: int, signal: FloatArray) -> FloatArray:
    """Divide the variances of one channel's values into those of reading, photons and uneven light.

    The photon-transfer model fitted to all frames gives the proportions of the three parts in each
    frame's σ², at its `signal`, shape (n,).

    Returns
    -------
    ndarray
        Variances in the values' unit², shape (n, 3).
    """
    exposure_s = np.where(series.exposure_s > 0, series.exposure_s, 1.0)
    variance = np.square(series.sigma[:, channel] * exposure_s)
    terms = variance_terms(series.values[:, channel] * exposure_s)
    line = NoiseModel.fit(terms, variance, sigma_dn2=variance)
    fractions = line.parts_dn2(signal * exposure_s)
    fractions /= fractions.sum(axis=1, keepdims=True)
    return np.asarray(fractions * np.square(series.sigma[:, channel, np.newaxis]))


def analyse(context: AnalysisContext) -> DecayResult:
    """Reduce and fit every patch; a patch that cannot be fitted has the reason instead.

    Raises
    ------
    DataError
        No decay is complete, a frame is missing or was changed after the run, or the camera file is
        of another camera, lens or aperture.
    """
    run, protocol, overrides = context.run, context.protocol, context.overrides
    regions = overrides.patches(protocol)
    background = protocol.background if protocol.dark == "background" else None
    frames, stray = without_stray_light(intact_frames(run, overrides), context.inputs[BLANK_KIND])
    require_calibrated_camera(context.inputs[CAMERA_KIND], run, run.frames(FrameRole.DECAY))
    camera = context.inputs[CAMERA_KIND]
    # A calibrated glare is subtracted, and a background has the same as the patches.
    unknown_glare = background is None and (camera is None or camera.glare is None)
    series = reduce_patches(
        frames.decay,
        {**regions, WHOLE_FRAME_NAME: WHOLE_FRAME} if unknown_glare else regions,
        frames.dark,
        background,
        camera,
    )
    whole_frame = series.pop(WHOLE_FRAME_NAME, None)
    veiled = (
        ()
        if whole_frame is None
        else glare_warning(series, regions, whole_frame, sensor_layout(frames.decay[0]))
    )
    options = context.options(DecayOptions)
    states = options.states or (None if protocol.states == "auto" else protocol.states)
    fit = partial(
        fit_series,
        states=states,
        fixed_rates_per_s=options.rate,
        law=options.law,
        intervals=options.intervals,
    )
    fits = fit_patches(series, fit)
    temperature_c = glow_temperature_c(run, context.protocol.rate_frames)
    only = protocol.sample.name if len(fits) == 1 else None
    return DecayResult(
        patches={
            name: _decay_patch(
                regions[name],
                series[name],
                fit,
                only or name,
                context,
                temperature_c,
                "" if only else name,
            )
            for name, fit in fits.items()
        },
        background=background,
        states_requested=states,
        charge_durations_s=charge_durations_s(run),
        temperature_c=temperature_c,
        warnings=(
            *timing_warnings(run),
            *frames.warnings,
            *stray,
            *_clipping_warnings(series),
            *veiled,
            *_fit_warnings(fits),
            *drift_warnings(run, context.protocol.rate_frames, _rates(fits)),
        ),
    )


def fit_patches(
    series: Mapping[str, Series], fit: Callable[..., DecayFit]
) -> dict[str, DecayFit | str]:
    """Fit the decays of patches that were photographed together.

    Shutter and aperture flicker alike for all patches of a frame. The flicker is taken from the
    patch that determines it best, for those that are dim or fade within a few frames.

    Parameters
    ----------
    series
        Series of each patch, by its name.
    fit
        Fits one series; its keyword `flicker` takes a relative flicker that is known.

    Returns
    -------
    dict
        Fit of each patch, or the reason why there is none, by the patch's name.
    """
    fits = {name: _fitted(partial(fit, patch_series)) for name, patch_series in series.items()}
    measured = [fit for fit in fits.values() if isinstance(fit, DecayFit) and fit.flicker > 0]
    if len(fits) == 1 or not measured:
        return fits
    best = min(measured, key=lambda fit: fit.flicker_sigma / fit.flicker)
    return {
        name: (
            fitted if fitted is best else _fitted(partial(fit, series[name], flicker=best.flicker))
        )
        for name, fitted in fits.items()
    }


def _fitted(fit: Callable[[], DecayFit]) -> DecayFit | str:
    """Return the fit, or the reason why there is none."""
    try:
        return fit()
    except FitError as error:
        return str(error)


def _decay_patch(
    region: Region,
    series: Series,
    fit: DecayFit | str,
    name: str,
    context: AnalysisContext,
    temperature_c: float | None,
    patch: str,
) -> DecayPatch:
    if isinstance(fit, str):
        return DecayPatch(region=region, series=series, failure=fit)
    return DecayPatch(
        region=region,
        series=series,
        fit=fit,
        normalised_residuals=fit.normalised_residuals,
        noise=noise_budget(series, fit),
        material=with_reflectance(
            with_layer(
                _material(series, fit, name, context.run.name, temperature_c),
                context.protocol.sample,
            ),
            patch,
            context.inputs[REFLECTANCE_KIND],
        ),
        drift_effect=(
            drift_an_hour(context.run, fit.drift_effect_s) if fit.law == EXPONENTIALS else None
        ),
    )


def _material(
    series: Series, fit: DecayFit, name: str, run: str, temperature_c: float | None
) -> Material:
    """Return the material by this decay alone: rates and amplitudes, without r0, k_e and Λ."""
    return Material(
        name=name,
        kind="phosphor",
        states=tuple(
            State(
                k_r_per_s=state.k_r_per_s,
                k_r_per_s_sigma=_finite(state.k_r_per_s_sigma),
                amplitude=_finite(state.amplitude),
                amplitude_sigma=_finite(state.amplitude_sigma),
                amplitude_unit=fit.value_unit or None,
            )
            for state in fit.states_at_lamp_off
        ),
        provenance=Provenance(
            source="decay measured with labrig; amplitudes in DN/s of the brightest channel",
            run=run,
            frames=series.frame,
            version=version("labrig"),
            temperature_c=temperature_c,
        ),
    )


def _finite(number: float) -> float | None:
    """Return a number; None where the data leave it open, which the file cannot say by infinity."""
    return number if math.isfinite(number) else None


def _clipping_warnings(series: Mapping[str, Series]) -> Iterator[ResultWarning]:
    for name, patch_series in series.items():
        clipped = sum("clipped" in flag for flag in patch_series.flag)
        if clipped:
            yield Disturbance(
                "frames-clipped",
                "{clipped} of {frames} frames are clipped and left out; expose for less or lower "
                "the ISO",
                subject=_subject(name, series),
                clipped=clipped,
                frames=len(patch_series.flag),
            )


def _fit_warnings(fits: Mapping[str, DecayFit | str]) -> Iterator[ResultWarning]:
    """Iterate over the warnings of fits, with the names of patches where there are several."""
    for name, fit in fits.items():
        subject = _subject(name, fits)
        if isinstance(fit, str):
            yield Undetermined(
                "patch-unfitted", "not fitted: {reason}", subject=subject, reason=fit
            )
        else:
            yield from (warning.about(subject) for warning in fit.warnings)


def _rates(fits: Mapping[str, DecayFit | str]) -> list[Measured]:
    """Return the rates of all patches that were fitted."""
    return [rate for fit in fits.values() if not isinstance(fit, str) for rate in fit.rates]


def _subject(name: str, patches: Mapping[str, object]) -> str:
    """Return a patch's name, empty for the only patch."""
    return name if len(patches) > 1 else ""
