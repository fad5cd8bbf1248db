"""Published colours of a ColorChecker beside those that a bench measures.

The grey card in the chart's place tells brightness and evenness of the light, and balances the
channels, so that only the course of the curves counts. Their ratios are tested by themselves.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from labrig.analyse.chart_scene import ChartScene, camera_matrix, chart_scene, frames_of
from labrig.analyse.combined_frames import CombinedFrame, combined
from labrig.analyse.forward_model import (
    ForwardModel,
    card_light,
    card_misfit,
    forward_models,
    with_white_reference,
)
from labrig.analyse.frames import steady_frames
from labrig.analyse.inputs import AnalysisContext
from labrig.analyse.place_reduction import reduce_places
from labrig.analyse.strip import StripPatch
from labrig.bench_optics import camera_curves, card_reflectance, lamp_spectrum
from labrig.calibration import CAMERA_KIND, LVF_KIND
from labrig.fit.camera_curves import ADDED, COURSE, COURSE_NM, LEVEL
from labrig.fit.spectrum import CurveError, fit_spectrum, smooth_modes
from labrig.foundation.arrays import FloatArray
from labrig.foundation.result_warning import Contradiction, Disturbance, Misfit, ResultWarning
from labrig.optics import (
    CHART_PATCHES,
    CIE_1931,
    CameraResponse,
    Spectrum,
    Transmittance,
    delta_e,
    lab,
    observer,
    read_colour_chart,
    white_xyz,
)
from labrig.protocols.colour_check.protocol import CheckFrames, patch_unit
from labrig.protocols.colour_check.result import (
    CheckedColour,
    CheckedPatch,
    ColourCheckResult,
    ColourSummary,
)
from labrig.protocols.steps.chart_scenes import THROUGH_UNIT
from labrig.record import FrameRole
from labrig.reduce import SeriesFrame, find_strip_in, hot_pixels_of

#: Wavelengths in nm of sums over spectra.
GRID_NM: FloatArray = np.arange(380.0, 781.0, 5.0)
#: Number of draws of errors, and parts of the draws that are allowed: of one patch, of the mean.
DRAWS, OF_A_PATCH, OF_THE_MEAN = 400, 0.95, 0.995
#: Distance in nm over which estimated curves err together.
CURVES_NM = 40.0


@dataclass(frozen=True, eq=False)
class PublishedChart:
    """Colours of a chart under a lamp.

    Attributes
    ----------
    reflectance
        Reflectances on `GRID_NM`, shape (p, n).
    light
        The lamp on `GRID_NM`, shape (n,).
    seen
        x̄, ȳ, z̄ times the light, on the scale on which a perfect white has Y = 1, shape (n, 3).
    """

    reflectance: FloatArray
    light: FloatArray
    seen: FloatArray

    @classmethod
    def under(cls, patches: Sequence[Transmittance], lamp: Spectrum) -> "PublishedChart":
        """Return the colours of patches under a lamp."""
        eye = observer(CIE_1931)
        functions = np.array([np.interp(GRID_NM, eye.wavelength_nm, f) for f in eye.functions.T]).T
        light = lamp.at(GRID_NM)
        seen = light[:, np.newaxis] * functions
        reflectance = np.array([patch.at(GRID_NM) for patch in patches])
        return cls(reflectance, light, seen / seen[:, 1].sum())

    @property
    def white(self) -> FloatArray:
        """X, Y, Z of a perfect white, shape (3,)."""
        return np.asarray(self.seen.sum(axis=0))

    @property
    def xyz(self) -> FloatArray:
        """X, Y, Z of the patches, shape (p, 3)."""
        return np.asarray(self.reflectance @ self.seen)

    def lab(self, xyz: FloatArray) -> FloatArray:
        """Return L*, a*, b* of X, Y, Z (…, 3)."""
        return lab(np.maximum(xyz, 0.0), self.white)

    def picture(self, xyz: FloatArray) -> FloatArray:
        """Return X, Y, Z (…, 3) on a screen on which the white is the screen's."""
        screen = white_xyz("D65", observer(CIE_1931))
        return np.asarray(np.maximum(xyz, 0.0) / self.white * screen)

    def own_reflectances(
        self, rng: np.random.Generator, draws: int, rows: slice = slice(None)
    ) -> FloatArray:
        """Draw the reflectances of patches of one's own chart, shape (draws, p, n)."""
        known = self.reflectance[rows]
        smooth = smooth_modes(GRID_NM, COURSE_NM)
        courses, added = rng.standard_normal((2, draws, len(known), len(smooth))) @ smooth
        level = rng.standard_normal((draws, len(known), 1))
        relative = 1 + LEVEL * level + COURSE * courses
        return np.asarray(np.maximum(known * relative + ADDED * added, 0.0))


def drawn_curves(camera: CameraResponse, rng: np.random.Generator, draws: int) -> FloatArray:
    """Draw curves of a camera with their errors on `GRID_NM`, shape (draws, n, k).

    Curves without σ err as those of one camera by several laboratories do.
    """
    curves = camera.at(GRID_NM)
    if camera.sigma is None:
        error, peak = CurveError(), curves.max(axis=0)
        smooth = smooth_modes(GRID_NM, error.correlation_nm)
        shape = (2, draws, curves.shape[1], len(smooth))
        relative, added = np.swapaxes(rng.standard_normal(shape) @ smooth, 2, 3)
        changed = curves * (1 + error.relative * relative) + error.added * peak * added
        return np.asarray(np.maximum(changed, 0.0))
    smooth = smooth_modes(GRID_NM, CURVES_NM)
    courses = rng.standard_normal((draws, curves.shape[1], len(smooth))) @ smooth
    sigma = np.array([np.interp(GRID_NM, camera.wavelength_nm, s) for s in camera.sigma.T]).T
    return np.asarray(np.maximum(curves + sigma * np.swapaxes(courses, 1, 2), 0.0))


def checked(
    chart: PublishedChart, rows: Sequence[int], xyz: FloatArray, drawn: FloatArray
) -> tuple[dict[int, CheckedColour], ColourSummary]:
    """Compare measured colours with the published ones.

    Parameters
    ----------
    chart
        The published chart.
    rows
        Patches that were measured.
    xyz
        X, Y, Z of each as measured, shape (r, 3).
    drawn
        X, Y, Z as errors alone would make them, shape (draws, r, 3).
    """
    published = chart.lab(chart.xyz[list(rows)])
    measured = chart.lab(xyz)
    off = delta_e(measured, published)
    by_errors = delta_e(chart.lab(drawn), np.broadcast_to(published, drawn.shape))
    allowed = np.quantile(by_errors, OF_A_PATCH, axis=0)
    mean_allowed = float(np.quantile(by_errors.mean(axis=1), OF_THE_MEAN))
    pictures = chart.picture(xyz)
    colours = {
        row: CheckedColour(measured[n], pictures[n], float(off[n]), float(allowed[n]))
        for n, row in enumerate(rows)
    }
    beyond = tuple(CHART_PATCHES[row] for n, row in enumerate(rows) if off[n] > allowed[n])
    summary = ColourSummary(
        mean=float(off.mean()),
        largest=float(off.max()),
        allowed=mean_allowed,
        worst=CHART_PATCHES[rows[int(off.argmax())]],
        beyond=beyond,
        verdict="agrees" if off.mean() <= mean_allowed else "differs",
    )
    return colours, summary


#: Relative σ of the grey card's reflectance: its level in all channels, and of each.
CARD_LEVEL_SIGMA, CARD_EACH = 0.01, 0.005


@dataclass(frozen=True, eq=False)
class PlainColours:
    """Colours in a plain photograph.

    Attributes
    ----------
    xyz
        X, Y, Z of the patches, shape (p, 3).
    drawn
        X, Y, Z as errors alone would make them, shape (draws, p, 3).
    balance, balance_sigma
        Values of the card over those by curves and lamp, relative to their mean, and σ, shape (k,).
    """

    xyz: FloatArray
    drawn: FloatArray
    balance: FloatArray
    balance_sigma: FloatArray


def plain_colours(
    scene: ChartScene,
    chart: PublishedChart,
    camera: CameraResponse,
    card: Transmittance,
    matrix: FloatArray,
) -> PlainColours:
    """Return the colours in the photograph, and what errors make of the published ones.

    Parameters
    ----------
    scene
        Values of chart and card.
    chart
        Published colours under the lamp.
    camera
        Curves of the camera.
    card
        Reflectance of the grey card.
    matrix
        From the camera's values of the light in `chart` to X, Y, Z, shape (3, k).
    """
    assert scene.card is not None, "a check of colours has a card"
    reflectance = card.at(GRID_NM) * chart.light
    expected = reflectance @ camera.at(GRID_NM)
    balance = scene.card / expected
    xyz = (scene.value / balance) @ matrix.T
    rng = np.random.default_rng(0)
    curves = drawn_curves(camera, rng, DRAWS)
    patches = (chart.own_reflectances(rng, DRAWS) * chart.light) @ curves
    patches *= 1 + scene.sigma / scene.value * rng.standard_normal(patches.shape)
    uneven = scene.unevenness * rng.standard_normal((DRAWS, 2)) @ scene.place.T
    patches *= 1 + uneven[:, :, np.newaxis]
    seen = reflectance @ curves
    seen *= 1 + CARD_LEVEL_SIGMA * rng.standard_normal((DRAWS, 1))
    seen *= 1 + CARD_EACH * rng.standard_normal(seen.shape)
    factors = seen / expected
    balances = factors / factors.mean(axis=1, keepdims=True)
    drawn = (patches / factors[:, np.newaxis, :]) @ matrix.T
    return PlainColours(xyz, drawn, balance / balance.mean(), balances.std(axis=0))


#: The whole strip as the only patch of it.
WHOLE = StripPatch("", "")
#: Relative σ of the grey card's level.
CARD_LEVEL = 0.01


@dataclass(frozen=True, eq=False)
class ThroughColours:
    """Colours of patches through the filter.

    Attributes
    ----------
    rows
        Numbers of the patches from 0.
    xyz
        X, Y, Z of each, shape (r, 3).
    drawn
        X, Y, Z as errors alone would make them, shape (draws, r, 3).
    misfit
        Root of χ² per degree of freedom of the card.
    shift_nm
        Shift of the strip along itself since its calibration.
    """

    rows: tuple[int, ...]
    xyz: FloatArray
    drawn: FloatArray
    misfit: float
    shift_nm: float


def through_colours(context: AnalysisContext, chart: PublishedChart) -> ThroughColours | None:
    """Return the colours of the patches that were seen through the filter; None if none were.

    Raises
    ------
    UsageError
        There is no calibrated LVF.
    DataError
        Frames are missing or damaged.
    """
    numbers = [n for n in context.protocol.numbers if patch_unit(n) in context.run.completed()]
    if not numbers:
        return None
    cards, patches = (
        frames_of(context, CheckFrames.CARD_THROUGH),
        frames_of(context, CheckFrames.PATCH),
    )
    darks = steady_frames(context.run, context.overrides, FrameRole.DARK)
    models, _ = forward_models(context, cards[0], [WHOLE])
    bare = models[WHOLE]
    reduction = reduce_places(
        [*cards, *patches], darks, {WHOLE: bare.slices}, context.inputs[CAMERA_KIND], bare.holder
    )[WHOLE]
    white = reduction.of_unit(THROUGH_UNIT)
    light = card_light(lamp_spectrum(context.rig), card_reflectance(context.rig))
    model, _ = with_white_reference(bare, context, white)
    card_fit = _fitted(model, combined(white), seed=0)
    scale = _luminance(chart, light) / _xyz(chart, card_fit.knots_nm, card_fit.value)[1]
    xyz, drawn = [], []
    rng = np.random.default_rng(1)
    for number in numbers:
        fit = _fitted(model, combined(reduction.of_unit(patch_unit(number))), seed=number)
        value = scale * _xyz(chart, fit.knots_nm, fit.value)
        samples = scale * _xyz(chart, fit.knots_nm, fit.samples)
        xyz.append(value)
        drawn.append(_by_errors(chart, number - 1, samples - value, rng))
    return ThroughColours(
        tuple(number - 1 for number in numbers),
        np.array(xyz),
        np.stack(drawn, axis=1),
        card_misfit(bare, combined(white), light),
        _shift_nm(context, cards, darks),
    )


@dataclass(frozen=True, eq=False)
class _Spectrum:
    """A spectrum on its knots, shape (k,), and draws of it, (s, k), in the unit of the values."""

    knots_nm: FloatArray
    value: FloatArray
    samples: FloatArray


def _fitted(model: ForwardModel, frame: CombinedFrame, seed: int) -> _Spectrum:
    """Return the spectrum that explains a frame, as bright as the frame by the model's own scale.

    The scale of the curves is open, and a smooth spectrum is likelier: a fit by itself would be the
    darker the rougher a spectrum is.
    """
    # A lit surface has no lines under a lamp that has none.
    fit = fit_spectrum(
        frame.value, frame.sigma, model.system, samples=DRAWS, seed=seed, decisive=np.inf
    )
    used = np.isfinite(frame.value) & np.isfinite(frame.sigma)
    value, design = frame.value[used], model.system.design[used]

    def as_bright(spectra: FloatArray) -> FloatArray:
        expected = spectra @ design.T
        factor = (expected @ value) / np.square(expected).sum(axis=-1)
        return np.asarray(factor[..., np.newaxis] * spectra)

    return _Spectrum(fit.knots_nm, as_bright(fit.value), as_bright(fit.samples))


def _xyz(chart: PublishedChart, knots_nm: FloatArray, spectrum: FloatArray) -> FloatArray:
    """Return X, Y, Z of spectra (…, knots), on the scale of the chart's lamp, shape (…, 3)."""
    seen = chart.seen / chart.light[:, np.newaxis]
    on_grid = np.array(
        [
            np.interp(GRID_NM, knots_nm, each, left=0.0, right=0.0)
            for each in spectrum.reshape(-1, len(knots_nm))
        ]
    )
    return np.asarray(on_grid @ seen).reshape(*spectrum.shape[:-1], 3)


def _luminance(chart: PublishedChart, light: Spectrum) -> float:
    seen = chart.seen / chart.light[:, np.newaxis]
    return float(light.at(GRID_NM) @ seen[:, 1])


def _by_errors(
    chart: PublishedChart, row: int, errors: FloatArray, rng: np.random.Generator
) -> FloatArray:
    """Return X, Y, Z of a patch by errors of chart, card and spectrum, shape (draws, 3)."""
    own = chart.own_reflectances(rng, len(errors), slice(row, row + 1))[:, 0]
    level = 1 + CARD_LEVEL * rng.standard_normal((len(errors), 1))
    return np.asarray(level * (own @ chart.seen + errors))


def _shift_nm(
    context: AnalysisContext, cards: Sequence[SeriesFrame], darks: Sequence[SeriesFrame]
) -> float:
    """Return how far the filter's strip has moved along itself since its calibration, in nm."""
    calibrated = context.inputs[LVF_KIND]
    assert calibrated is not None
    assert calibrated.before_camera is not None
    before = calibrated.before_camera
    strip = find_strip_in(cards, hot_pixels_of(darks)).strip(before.rising)
    moved = (strip.left[0] - before.left[0] + strip.right[0] - before.right[0]) / 2
    nm = calibrated.wavelengths.map().wavelength_nm([0.0, 1.0])
    along = moved / (before.right[0] - before.left[0]) * float(nm[1] - nm[0])
    return along if before.rising else -along


#: Pull of the card's balance, misfit of the card through the filter, and shift of its strip in nm,
#: from which something has changed.
ODD_BALANCE, ODD_MISFIT, MOVED_NM = 3.5, 2.5, 2.0


def analyse(context: AnalysisContext) -> ColourCheckResult:
    """Compare a chart's colours, in a plain photograph and through the LVF, with published ones.

    Raises
    ------
    UsageError
        The rig file lacks curves of camera, lamp or grey card, or the filter's calibration.
    DataError
        Frames are missing or damaged, or no chart is to be seen in them.
    """
    rig, protocol = context.rig, context.protocol
    lamp, camera = lamp_spectrum(rig), camera_curves(rig, context.overrides.camera)
    chart = PublishedChart.under(read_colour_chart(protocol.chart), lamp)
    scene = chart_scene(context, CheckFrames.CHART, CheckFrames.CARD)
    matrix = camera_matrix(camera, lamp)
    # On the grid of the sums, and on the scale on which a white has Y = 1.
    values_of_white = chart.light @ camera.at(GRID_NM)
    matrix = matrix * chart.white[1] / (matrix @ values_of_white)[1]
    plain = plain_colours(scene, chart, camera, card_reflectance(rig), matrix)
    through = through_colours(context, chart)
    every = tuple(range(len(CHART_PATCHES)))
    plainly, of_plain = checked(chart, every, plain.xyz, plain.drawn)
    filtered, of_through = (
        ({}, None) if through is None else checked(chart, through.rows, through.xyz, through.drawn)
    )
    published, pictures = chart.lab(chart.xyz), chart.picture(chart.xyz)
    return ColourCheckResult(
        camera=camera.name,
        lamp=lamp.name,
        chart=protocol.chart,
        patches={
            name: CheckedPatch(published[row], pictures[row], plainly[row], filtered.get(row))
            for row, name in enumerate(CHART_PATCHES)
        },
        plain=of_plain,
        through=of_through,
        channels=camera.channels,
        card_balance=plain.balance,
        card_balance_sigma=plain.balance_sigma,
        card_misfit=None if through is None else through.misfit,
        filter_shift_nm=None if through is None else through.shift_nm,
        warnings=(
            *_plain_warnings(of_plain, plain, camera.channels),
            *_through_warnings(of_through, through),
        ),
    )


def _plain_warnings(
    summary: ColourSummary, plain: PlainColours, channels: tuple[str, ...]
) -> Iterator[ResultWarning]:
    if summary.verdict == "differs":
        yield Contradiction(
            "colours-differ",
            "ΔE2000 is {mean:.1f} on average, errors allow {allowed:.1f} (most {worst}, "
            "{largest:.1f}); the camera's curves are those of another camera, or the chart is "
            "another one, faded or in glare",
            subject="plainly",
            mean=summary.mean,
            allowed=summary.allowed,
            worst=summary.worst,
            largest=summary.largest,
        )
    pulls = (plain.balance - 1) / plain.balance_sigma
    worst = int(np.abs(pulls).argmax())
    if abs(pulls[worst]) > ODD_BALANCE:
        yield Contradiction(
            "card-colour-differs",
            "the grey card is {deviation:+.0%} off in {channel}, {sigmas:.1f} σ; the lamp's "
            "spectrum or the camera's curves are not those of the rig file",
            deviation=plain.balance[worst] - 1,
            channel=channels[worst],
            sigmas=abs(pulls[worst]),
        )


def _through_warnings(
    summary: ColourSummary | None, through: ThroughColours | None
) -> Iterator[ResultWarning]:
    if summary is None or through is None:
        return
    if summary.verdict == "differs":
        yield Contradiction(
            "colours-differ",
            "ΔE2000 is {mean:.1f} on average, errors allow {allowed:.1f} (most {worst}, "
            "{largest:.1f}); a patch did not fill the strip, or the filter is not as it was "
            "calibrated: run lvf_calibration again",
            subject="through the filter",
            mean=summary.mean,
            allowed=summary.allowed,
            worst=summary.worst,
            largest=summary.largest,
        )
    if abs(through.shift_nm) > MOVED_NM:
        yield Disturbance(
            "strip-shifted",
            "the filter's strip lies {shift_nm:+.1f} nm along itself from where it was calibrated: "
            "it was moved, or the camera was; put it back, or run lvf_calibration again",
            shift_nm=through.shift_nm,
        )
    if through.misfit > ODD_MISFIT:
        yield Misfit(
            "card-through-filter",
            "the grey card through the filter differs {misfit:.1f} times as much as errors allow "
            "from the prediction by lamp, filter and camera; the lamp or the camera's curves are "
            "not "
            "those of the rig file, or the filter is not as it was calibrated",
            misfit=through.misfit,
        )
