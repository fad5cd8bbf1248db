"""Analysis of a reflectance run, from its frames to the albedo of each patch."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from labrig.analyse.inputs import AnalysisContext
from labrig.analyse.strip import StripFrames, StripPatch, for_each_patch
from labrig.bench_optics import card_reflectance, lamp_spectrum
from labrig.calibration import LVF_KIND, ReflectanceFile
from labrig.fit.reflectance import AlbedoFit, Luminescence, fit_albedo, unresolved
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError, FitError, UsageError
from labrig.foundation.number_format import plus_minus as plus_minus
from labrig.foundation.result_warning import Contradiction, Disturbance, ResultWarning
from labrig.optics import Transmittance, band_means, edges_from_centres
from labrig.protocols.reflectance.analysis.lit_strips import Arranged, PatchStrip, both_arranged
from labrig.protocols.reflectance.result import MeasuredReflectance, ReflectanceResult
from labrig.reduce import FLICKER
from labrig.results import Measured

#: Wavelengths of the results in nm: where filter, lamp and camera leave enough light.
WAVELENGTH_NM: FloatArray = np.arange(400.0, 701.0, 10.0)
#: Relative σ of a card whose curve has none.
CARD_SIGMA = 0.01
#: Relative change of the card's light between its two scenes that causes a warning.
DRIFT = 0.03
#: Significance in σ, and size, from which luminescence and light thrown back are reported.
SIGMAS, SEEN = 3.0, 0.01
#: Largest albedo of a diffuse surface.
BRIGHTEST = 1.0
#: Misfit from which the channels contradict one another.
CONTRADICTION = 1.5


@dataclass(frozen=True, eq=False)
class _Bench:
    """Values that all patches share: arrangements, luminescence, the card's curve, its σ."""

    white: Arranged
    narrow: Arranged
    excited: Mapping[StripPatch, Luminescence | None]
    card: Transmittance
    card_sigma: FloatArray


def analyse(context: AnalysisContext) -> ReflectanceResult:
    """Measure albedo and total radiance factor of every patch.

    Raises
    ------
    UsageError
        No LVF is known that was calibrated before the camera and on the sample, or curves are
        missing in the rig file.
    DataError
        Frames are missing or damaged, no patch lies below the filter, or there is no light.
    """
    calibrated = context.inputs[LVF_KIND]
    if calibrated is None or calibrated.on_sample is None or calibrated.before_camera is None:
        raise UsageError(
            f"{context.run.folder}: no LVF is known before the camera and on the sample; run "
            "lvf_calibration, and name its run in the rig file (optics: {lvf: …}) or to labrig "
            "process --optics"
        )
    frames, lamp, card = (
        StripFrames(context),
        lamp_spectrum(context.rig),
        card_reflectance(context.rig),
    )
    white, narrow, excited = both_arranged(
        context, frames, calibrated, calibrated.before_camera, calibrated.on_sample
    )
    bench = _Bench(white, narrow, excited, card, _card_sigma(card))
    both = [patch for patch in white.patches if patch in narrow.patches]
    if not both:
        raise DataError("; ".join(map(str, (*white.refused, *narrow.refused))))
    patches, warnings = for_each_patch(both, lambda patch: _patch(patch, bench))
    run = context.run.name
    return ReflectanceResult(
        lamp=lamp.name,
        patches=patches,
        drift=(white.drift, narrow.drift),
        calibration=ReflectanceFile(
            lamp=lamp.name,
            patches={name: patch.for_file() for name, patch in patches.items()},
            source="sample beside a grey card through and below the LVF, with labrig",
            run=run,
        ),
        warnings=(
            *_drift_warnings(white, narrow),
            *dict.fromkeys((*white.refused, *narrow.refused)),
            *warnings,
        ),
    )


def _patch(patch: StripPatch, bench: _Bench) -> tuple[MeasuredReflectance, list[ResultWarning]]:
    """Return the patch's reflectance, and warnings."""
    white, narrow = bench.white.patches[patch], bench.narrow.patches[patch]
    try:
        fit = fit_albedo(white.strip, narrow.strip, bench.card, bench.excited[patch])
    except FitError as error:
        raise DataError(str(error)) from None
    common = float(np.hypot(white.strip.scale_sigma, np.median(bench.card_sigma)))
    of_all = np.hypot(white.strip.scale_sigma, bench.card_sigma)
    edges = edges_from_centres(WAVELENGTH_NM)

    def columns(value: FloatArray, draws: FloatArray, nm: FloatArray) -> tuple[FloatArray, ...]:
        mean = band_means(nm, value, edges)
        spread = band_means(nm, draws.T, edges).std(axis=1, ddof=1)
        missed = unresolved(WAVELENGTH_NM, mean)
        return mean, np.sqrt(spread**2 + (of_all * mean) ** 2 + missed**2)

    total, one = fit.radiance_factor, fit.albedo
    glow, at_off = white.glow_at(WAVELENGTH_NM, bench.card)
    luminescence = Measured(float("nan"), float("nan"))
    if np.isfinite(fit.amount):
        sigma = np.hypot(fit.amount_sigma, fit.amount * at_off.sigma / at_off.value)
        luminescence = Measured(fit.amount / at_off.value, float(sigma / at_off.value))
    albedo, albedo_sigma = columns(one.value, one.samples, one.knots_nm)
    factor, factor_sigma = columns(total.value, total.samples, total.knots_nm)
    measured = MeasuredReflectance(
        wavelength_nm=WAVELENGTH_NM,
        albedo=albedo,
        albedo_sigma=albedo_sigma,
        radiance_factor=factor,
        radiance_factor_sigma=factor_sigma,
        glow=glow * at_off.value,
        luminescence=luminescence,
        thrown_back=Measured(fit.thrown_back, fit.thrown_back_sigma),
        misfit=one.misfit,
        common_sigma=common,
    )
    return measured, [*_warnings(measured, fit, bench.card, narrow)]


def _card_sigma(card: Transmittance) -> FloatArray:
    """Return the relative σ of the card's reflectance at the results' wavelengths."""
    if card.sigma is None:
        return np.full_like(WAVELENGTH_NM, CARD_SIGMA)
    sigma = np.interp(WAVELENGTH_NM, card.wavelength_nm, card.sigma)
    return np.asarray(sigma / card.at(WAVELENGTH_NM))


def _drift_warnings(*arrangements: Arranged) -> Iterator[ResultWarning]:
    for one in arrangements:
        if abs(one.drift) > DRIFT + SIGMAS * FLICKER:
            yield Disturbance(
                "lamp-drifts",
                "the card's light changed by {drift:+.1%} from before the sample to after it "
                "({light} light); let the lamp warm up for longer, or look for something that was "
                "moved",
                drift=one.drift,
                light=one.name,
            )


def _warnings(
    patch: MeasuredReflectance, fit: AlbedoFit, card: Transmittance, narrow: PatchStrip
) -> Iterator[ResultWarning]:
    if patch.misfit > CONTRADICTION:
        colour = (
            "it fluoresces in another colour than it glows in"
            if narrow.strip.luminescence.any()
            else "it fluoresces, and no glow shows in which colour"
        )
        yield Contradiction(
            "channels-contradict",
            "the channels contradict one another (misfit {misfit:.1f}): {cause}, or sample and "
            "card did not lie alike, so that the albedo may be wrong by more than its σ; measure "
            "with a cut-on filter before the lamp",
            misfit=patch.misfit,
            cause=colour,
        )
    brightest = int(np.argmax(patch.albedo - SIGMAS * patch.albedo_sigma))
    if patch.albedo[brightest] - SIGMAS * patch.albedo_sigma[brightest] > BRIGHTEST:
        yield Contradiction(
            "more-than-white",
            "an albedo of {albedo:.2f} at {wavelength_nm:.0f} nm is more than a white sends back: "
            "gloss reaches the camera, or the card's curve is not that of this card; light the "
            "sample from the side",
            albedo=patch.albedo[brightest],
            wavelength_nm=patch.wavelength_nm[brightest],
        )
    prompt = patch.excess - patch.glow
    if fit.is_prompt and prompt.max() > SEEN:
        most = int(np.argmax(prompt))
        yield Disturbance(
            "prompt-fluorescence",
            "prompt fluorescence: under the lamp up to {fraction:.3f} of the light at "
            "{wavelength_nm:.0f} nm is neither reflection nor glow, so that its total radiance "
            "factor holds for this lamp only; the albedo is without it",
            fraction=prompt[most],
            wavelength_nm=patch.wavelength_nm[most],
        )
    thrown = patch.thrown_back
    excess = float(np.abs(patch.albedo - card.at(patch.wavelength_nm)).max())
    if abs(thrown.value) > SIGMAS * thrown.sigma and abs(thrown.value) * excess > SEEN:
        yield Disturbance(
            "filter-reflects",
            "the filter on the sample throws {fraction.plus_minus} of its light back onto it, "
            "which a card of another brightness does not show; raise the filter, or take a card "
            "about as bright as the sample",
            fraction=thrown,
        )
