"""The chart's patches through the variable filter: colours by their spectra."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from labrig.analyse.chart_scene import frames_of
from labrig.analyse.combined_frames import CombinedFrame, combined
from labrig.analyse.forward_model import (
    ForwardModel,
    card_light,
    card_misfit,
    forward_models,
    with_white_reference,
)
from labrig.analyse.frames import steady_frames
from labrig.analyse.inputs import Part
from labrig.analyse.place_reduction import reduce_places
from labrig.analyse.strip import StripPatch
from labrig.bench_optics import card_reflectance, lamp_spectrum
from labrig.calibration import CAMERA_KIND, LVF_KIND
from labrig.fit.spectrum import fit_spectrum
from labrig.foundation.arrays import FloatArray
from labrig.optics import Spectrum
from labrig.protocols.colour_check.analysis.colours import DRAWS, GRID_NM, PublishedChart
from labrig.protocols.colour_check.protocol import CheckFrames, patch_unit
from labrig.protocols.steps.chart_scenes import THROUGH_UNIT
from labrig.record import FrameRole
from labrig.reduce import SeriesFrame, find_strip_in, hot_pixels_of

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


def through_colours(part: Part, chart: PublishedChart) -> ThroughColours | None:
    """Return the colours of the patches that were seen through the filter; None if none were.

    Raises
    ------
    UsageError
        There is no calibrated LVF.
    DataError
        Frames are missing or damaged.
    """
    numbers = [n for n in part.protocol.numbers if patch_unit(n) in part.run.completed()]
    if not numbers:
        return None
    cards, patches = frames_of(part, CheckFrames.CARD_THROUGH), frames_of(part, CheckFrames.PATCH)
    darks = steady_frames(part.run, part.overrides, FrameRole.DARK)
    models, _ = forward_models(part, cards[0], [WHOLE])
    bare = models[WHOLE]
    reduction = reduce_places(
        [*cards, *patches], darks, {WHOLE: bare.slices}, part.inputs[CAMERA_KIND], bare.holder
    )[WHOLE]
    white = reduction.of_unit(THROUGH_UNIT)
    light = card_light(lamp_spectrum(part.rig), card_reflectance(part.rig))
    model, _ = with_white_reference(bare, part, white)
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
        _shift_nm(part, cards, darks),
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


def _shift_nm(part: Part, cards: Sequence[SeriesFrame], darks: Sequence[SeriesFrame]) -> float:
    """Return how far the filter's strip has moved along itself since its calibration, in nm."""
    calibrated = part.inputs[LVF_KIND]
    assert calibrated is not None
    assert calibrated.before_camera is not None
    before = calibrated.before_camera
    strip = find_strip_in(cards, hot_pixels_of(darks)).strip(before.rising)
    moved = (strip.left[0] - before.left[0] + strip.right[0] - before.right[0]) / 2
    nm = calibrated.wavelengths.map().wavelength_nm([0.0, 1.0])
    along = moved / (before.right[0] - before.left[0]) * float(nm[1] - nm[0])
    return along if before.rising else -along
