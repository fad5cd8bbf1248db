"""Light of sample, card and glow along the strip, in each of the two arrangements of a run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from labrig.acquire import DOOR
from labrig.analyse.forward_model import channel_positions, conditioned_on_white, strip_system
from labrig.analyse.frames import intact_frames
from labrig.analyse.inputs import AnalysisContext
from labrig.analyse.strip import Slices, StripFrames, StripPatch, slice_strip, strip_regions
from labrig.bench_optics import camera_curves, card_reflectance, lamp_spectrum
from labrig.calibration import CAMERA_KIND, LvfFile
from labrig.fit.reflectance import (
    LitStrip,
    Luminescence,
    StripLight,
    luminescence_by_glow,
    relative_to_card,
)
from labrig.fit.spectrum import SpectralSystem
from labrig.foundation.arrays import FloatArray
from labrig.foundation.result_warning import ResultWarning
from labrig.optics import CameraResponse, Lvf, Spectrum, Strip, Transmittance
from labrig.protocols.reflectance.protocol import ReflectanceFrames
from labrig.reduce import FLICKER, SensorLayout, SeriesFrame, region_values, sensor_layout
from labrig.results import Measured, SliceValues

#: Knots of the fitted reflectance: finer than the filter's band, and beyond the grid of results.
KNOTS_NM: FloatArray = np.arange(380.0, 721.0, 5.0)
#: Significance from which light counts: of the card at a place, and of the glow at all places.
CARD_SEEN, GLOW_SEEN = 20.0, 10.0
#: Reach of a place's band in nm, and relative σ of the light from outside of it.
IN_BAND_NM, OUTSIDE_SIGMA = 40.0, 0.2
#: Number of free amounts of luminescence by white light, and reach of its change of colour in
#: widths of the emission; cosine of the angle between colours that are alike.
WHITE_AMOUNTS, REDDEST = 2, 2.5
ALIKE = 0.9995
#: Share of the change from the first photograph of the glow back to lamp off that is uncertain.
BACK_TO_OFF = 0.3


@dataclass(frozen=True)
class Arrangement:
    """Names of one arrangement of lamp, filter and camera.

    Attributes
    ----------
    name
        Name of the light on the sample.
    card, sample, glow
        Roles of the frames.
    """

    name: str
    card: str
    sample: str
    glow: str


WHITE = Arrangement(
    "white",
    ReflectanceFrames.CARD_WHITE,
    ReflectanceFrames.SAMPLE_WHITE,
    ReflectanceFrames.GLOW_WHITE,
)
NARROW = Arrangement(
    "narrow",
    ReflectanceFrames.CARD_NARROW,
    ReflectanceFrames.SAMPLE_NARROW,
    ReflectanceFrames.GLOW_NARROW,
)


@dataclass(frozen=True, eq=False)
class PatchStrip:
    """Light of one patch in one arrangement.

    Attributes
    ----------
    strip
        Ratios to the card, and the course of luminescence.
    glow
        Ratio of the glow to the card's light in the photograph that shows it best, (p, channels).
    at_off
        Glow at lamp off over that in this photograph.
    centre_nm
        Wavelength of each place, shape (p,).
    """

    strip: LitStrip
    glow: FloatArray
    at_off: Measured
    centre_nm: FloatArray

    def glow_at(
        self, wavelength_nm: FloatArray, card: Transmittance
    ) -> tuple[FloatArray, Measured]:
        """Return the radiance factor of the glow at some wavelengths, and its rise to lamp off.

        Parameters
        ----------
        wavelength_nm
            Wavelengths in nm, shape (n,).
        card
            Reflectance of the card.
        """
        weight = np.where(np.isfinite(self.strip.value), self.strip.sigma**-2, 0.0)
        weight = weight.reshape(self.glow.shape)
        total = weight.sum(axis=1)
        lit = total > 0
        ratio = (weight * np.nan_to_num(self.glow)).sum(axis=1)[lit] / total[lit]
        seen = np.interp(wavelength_nm, self.centre_nm[lit], ratio) * card.at(wavelength_nm)
        return np.maximum(seen, 0.0), self.at_off


@dataclass(frozen=True, eq=False)
class Arranged:
    """All patches in one arrangement.

    Attributes
    ----------
    name
        Name of the light on the sample.
    patches
        Light of each patch.
    refused
        Reasons for patches that do not lie below the filter.
    drift
        Relative change of the card's light from before the sample to after it.
    """

    name: str
    patches: Mapping[StripPatch, PatchStrip]
    refused: tuple[ResultWarning, ...]
    drift: float


def both_arranged(
    context: AnalysisContext,
    frames: StripFrames,
    calibrated: LvfFile,
    before_camera: Strip,
    on_sample: Strip,
) -> tuple[Arranged, Arranged, Mapping[StripPatch, Luminescence | None]]:
    """Measure card, sample and glow along both strips, and what luminescence both may have.

    Raises
    ------
    UsageError
        Curves of lamp, camera or card are missing in the rig file.
    DataError
        Frames are missing, or no patch lies below the filter.
    """
    is_direct = DOOR.key in context.rig.devices
    white = _seen(context, frames, WHITE, calibrated, calibrated.lvf, before_camera)
    # Without a door the camera sees the sample through the filter that lies on it.
    below = calibrated.lvf if is_direct else calibrated.lvf.twice()
    narrow = _seen(context, frames, NARROW, calibrated, below, on_sample)
    whites, narrows, excited = {}, {}, {}
    for patch in white.patches:
        one = white.patches[patch]
        whites[patch] = one.strip(_white_courses(one.scenes, one.centre_nm))
        if (other := narrow.patches.get(patch)) is not None:
            courses = _narrow_courses(
                other.scenes, one.scenes, one.centre_nm, other.centre_nm, is_direct=is_direct
            )
            narrows[patch] = other.strip(courses)
            excited[patch] = _excited(one, other, lamp_spectrum(context.rig), is_direct=is_direct)
    return (
        Arranged(WHITE.name, whites, white.refused, white.drift),
        Arranged(NARROW.name, narrows, narrow.refused, narrow.drift),
        excited,
    )


@dataclass(frozen=True, eq=False)
class _SeenPatch:
    """Scenes of one patch.

    Attributes
    ----------
    scenes
        Light of card, sample and glow.
    system
        System of the ratios by the reflectance.
    centre_nm
        Wavelength of each place, shape (p,).
    card_light
        Light of the card by the system, shape (p, channels).
    passed
        Light that the filter passes once at each place of an even spectrum, shape (p,).
    """

    scenes: "_Scenes"
    system: SpectralSystem
    centre_nm: FloatArray
    card_light: FloatArray
    passed: FloatArray

    def strip(self, courses: FloatArray) -> PatchStrip:
        """Return the ratios with the courses of luminescence."""
        scenes, card, glow = self.scenes, self.scenes.card, self.scenes.glow
        value = scenes.sample.value / card.value
        sigma = np.hypot(scenes.sample.sigma / card.value, value * card.sigma / card.value)
        value = np.where(card.value > CARD_SEEN * card.sigma, value, np.nan)
        scale = float(np.hypot(FLICKER * np.sqrt(1.5), scenes.drift / np.sqrt(12)))
        ratio = np.zeros_like(value) if glow is None else glow.value / card.value
        off = scenes.at_off
        strip = LitStrip(
            value.ravel(),
            sigma.ravel(),
            self.system,
            off.value * ratio.ravel(),
            off.sigma * np.abs(ratio.ravel()),
            np.nan_to_num(courses),
            scale,
        )
        return PatchStrip(strip, ratio, off, self.centre_nm)


@dataclass(frozen=True, eq=False)
class _Seen:
    """All patches in one arrangement, reasons for others, and the drift of the card's light."""

    patches: Mapping[StripPatch, _SeenPatch]
    refused: tuple[ResultWarning, ...]
    drift: float


def _seen(
    context: AnalysisContext,
    frames: StripFrames,
    names: Arrangement,
    calibrated: LvfFile,
    lvf: Lvf,
    strip: Strip,
) -> _Seen:
    """Measure card, sample and glow along a strip, for every patch."""
    layout = sensor_layout(frames.dark[0])
    slices, refused = slice_strip(strip_regions(context), strip, layout)
    camera = camera_curves(context.rig, context.overrides.camera, calibrated)
    lit, card = _lit(camera, lamp_spectrum(context.rig)), card_reflectance(context.rig)
    patches, drifts = {}, []
    for patch, regions in slices.items():
        scenes = _Scenes.of(context, frames, names, regions)
        light, centre_nm = _light_system(lvf, strip, layout, regions, lit)
        light = _known_by_card(light, scenes.card, card)
        scenes = scenes.within(_in_band(light, centre_nm).reshape(scenes.sample.value.shape))
        drifts.append(scenes.drift)
        of_card = (light.design @ card.at(light.knots_nm)).reshape(scenes.sample.value.shape)
        passed = np.interp(centre_nm, calibrated.lvf.bands.centre_nm, _passed(calibrated.lvf))
        system = relative_to_card(light, card)
        patches[patch] = _SeenPatch(scenes, system, centre_nm, of_card, passed)
    return _Seen(patches, refused, float(np.median(drifts)))


@dataclass(frozen=True, eq=False)
class _Scenes:
    """Light of card and sample, shape (p, channels), and of the glow in each of its photographs."""

    cards: tuple[SliceValues, SliceValues]
    sample: SliceValues
    glows: tuple[SliceValues, ...]
    glow_times_s: tuple[float, ...]

    @classmethod
    def of(
        cls, context: AnalysisContext, frames: StripFrames, names: Arrangement, regions: Slices
    ) -> "_Scenes":
        glow_frames = intact_frames(context.run, context.overrides, names.glow).decay
        each = [replace(frame, unit=f"glow-{n}") for n, frame in enumerate(glow_frames)]
        lit: list[SeriesFrame] = [*frames.of(names.card), *frames.of(names.sample)]
        values = region_values(
            [*lit, *each], regions, frames.dark, context.inputs[CAMERA_KIND], is_evened=True
        )
        cards = [values[f"card-{names.name}-{n}"] for n in (1, 2)
                 if f"card-{names.name}-{n}" in values]  # fmt: skip
        return cls(
            (cards[0], cards[-1]),
            values[f"sample-{names.name}"],
            tuple(values[frame.unit] for frame in each),
            tuple(frame.t_s + frame.exposure_s / 2 for frame in glow_frames),
        )

    def within(self, inside: FloatArray) -> "_Scenes":
        """Return the scenes with a σ for what is not `inside` of a place's band, (p, channels)."""
        sigma = np.hypot(self.sample.sigma, OUTSIDE_SIGMA * (1 - inside) * self.sample.value)
        return replace(self, sample=replace(self.sample, sigma=sigma))

    @property
    def card(self) -> SliceValues:
        """Mean of the two scenes of the card."""
        before, after = self.cards
        value = (before.value + after.value) / 2
        return SliceValues(value, np.hypot(before.sigma, after.sigma) / 2)

    @property
    def drift(self) -> float:
        """Relative change of the card's light."""
        before, after = self.cards
        bright = before.value > CARD_SEEN * before.sigma
        return float(np.median(after.value[bright] / before.value[bright])) - 1

    @property
    def glow(self) -> SliceValues | None:
        """The glow in its longest photograph in which nothing clips; None if it is not seen."""
        for glow in reversed(self.glows):
            if np.isfinite(glow.value).all():
                total = float(np.sum(glow.value / glow.sigma**2) / np.sqrt(np.sum(glow.sigma**-2)))
                return glow if total > GLOW_SEEN else None
        return None

    @property
    def at_off(self) -> Measured:
        """Glow at lamp off over that of `glow`, as it fades from photograph to photograph."""
        glow = self.glow
        if glow is None:
            return Measured(1.0, BACK_TO_OFF)
        levels, sigmas = np.transpose([_level_of(one, glow) for one in self.glows])
        found = [
            _back_to_off(self.glow_times_s[n : n + 2], levels[n : n + 2], sigmas[n : n + 2])
            for n in range(len(levels) - 1)
        ]
        known = [one for one in found if one is not None]
        if not known:
            return Measured(1.0, BACK_TO_OFF)
        value, sigma = np.transpose([(one.value, one.sigma) for one in known])
        weight = sigma**-2
        return Measured(float(weight @ value / weight.sum()), float(weight.sum() ** -0.5))


def _back_to_off(
    times_s: Sequence[float], levels: FloatArray, sigmas: FloatArray
) -> Measured | None:
    """Return the level at lamp off by two later ones, as of an exponential; None without light.

    A glow of several rates fades faster at first: a part of the rise is in σ.
    """
    if (levels <= GLOW_SEEN * sigmas).any():
        return None
    (first_s, second_s), (first, second) = times_s, levels
    lever = first_s / (second_s - first_s)
    rise = max(float(np.log(first / second)) * lever, 0.0)
    at_off = float(first * np.exp(rise))
    noise = np.hypot((1 + lever) * sigmas[0] / first, lever * sigmas[1] / second)
    return Measured(at_off, at_off * float(np.hypot(noise, BACK_TO_OFF * np.expm1(rise))))


def _level_of(glow: SliceValues, pattern: SliceValues) -> tuple[float, float]:
    """Return a glow over another one of the same pattern by least squares, and σ."""
    seen = np.isfinite(glow.value) & np.isfinite(glow.sigma) & (glow.sigma > 0)
    weight = np.where(seen, np.where(seen, glow.sigma, 1.0) ** -2, 0.0)
    total = float((weight * pattern.value**2).sum())
    if not total > 0:
        return 0.0, 0.0
    level = float((weight * pattern.value * np.where(seen, glow.value, 0.0)).sum())
    return level / total, total**-0.5


def _white_courses(scenes: _Scenes, centre_nm: FloatArray) -> FloatArray:
    """Return the ratios of luminescence by white light per unit of its amounts, (k, p · channels).

    It has the spectrum of the glow, and may be redder: what short waves excite can emit all of it,
    what longer ones excite only the part of still longer waves.
    """
    card, glow = scenes.card.value, scenes.glow
    if glow is None:
        return np.zeros((0, card.size))
    light = np.maximum(glow.value, 0.0)
    each = light.sum(axis=1)
    mean_nm = float(centre_nm @ each / each.sum())
    spread_nm = float(np.sqrt((centre_nm - mean_nm) ** 2 @ each / each.sum()))
    redder = np.clip((centre_nm - mean_nm) / spread_nm, -REDDEST, REDDEST)[:, np.newaxis]
    ratio = glow.value / card
    return np.stack([(redder**power * ratio).ravel() for power in range(WHITE_AMOUNTS)])


def _excited(
    white: _SeenPatch, narrow: _SeenPatch, lamp: Spectrum, *, is_direct: bool
) -> Luminescence | None:
    """Return what luminescence the ratios of both strips may have; None without a glow."""
    glow = white.scenes.glow
    if glow is None:
        return None
    # In the units of both systems, without what lens and lamp do at a place.
    seen = np.maximum(np.nan_to_num(glow.value / white.scenes.card.value), 0.0) * white.card_light
    strips = (StripLight(one.centre_nm, one.card_light, _per_place(one)) for one in (white, narrow))
    return luminescence_by_glow(
        seen, *strips, ultraviolet=_ultraviolet(narrow, lamp), is_direct=is_direct
    )


def _per_place(patch: _SeenPatch) -> FloatArray:
    """Return weights of the places of a strip whose sum is light that has not passed it, (p,)."""
    return np.asarray(np.abs(np.gradient(patch.centre_nm)) / patch.passed)


def _ultraviolet(patch: _SeenPatch, lamp: Spectrum) -> FloatArray:
    """Return weights as of `_per_place` for light of shorter wavelengths than the strip's, (p,)."""
    bluest = int(np.argmin(patch.centre_nm))
    end_nm = patch.centre_nm[bluest]
    below_nm = np.arange(
        lamp.wavelength_nm[0], end_nm - abs(np.gradient(patch.centre_nm)[bluest]) / 2
    )
    weight = np.zeros_like(patch.centre_nm)
    weight[bluest] = lamp.at(below_nm).sum() / lamp.at(end_nm) / patch.passed[bluest]
    return weight


def _passed(lvf: Lvf) -> FloatArray:
    """Return the light that a filter passes of an even spectrum at its positions, shape (p,)."""
    nodes = np.arange(KNOTS_NM[0], KNOTS_NM[-1] + 1.0)
    return np.asarray(lvf.transmission(nodes).sum(axis=1))


def _narrow_courses(
    scenes: _Scenes, white: _Scenes, white_nm: FloatArray, centre_nm: FloatArray, *, is_direct: bool
) -> FloatArray:
    """Return the ratios of luminescence by narrow light per unit of its amounts, (k, p · channels).

    Narrow light excites each place by itself. Seen directly, all places have the colour of the
    glow, and where the light is as red as the glow the colour of its redder part; seen through the
    filter, each has that of the glow there.
    """
    card, glow = scenes.card.value, scenes.glow
    places, channels = card.shape
    courses: list[FloatArray] = []
    if glow is None:
        return np.zeros((0, card.size))
    for place in range(places):
        colours = [glow.value[place]]
        if is_direct:
            colours = [glow.value.sum(axis=0)]
            if (spread := white.glow) is not None:
                redder = white_nm > centre_nm[place]
                colours.append(np.maximum(spread.value[redder].sum(axis=0), 0.0))
        for colour in _different(colours):
            course = np.zeros((places, channels))
            course[place] = colour / card[place]
            courses.append(course.ravel() / np.abs(course).max())
    return np.array(courses).reshape(-1, card.size)


def _different(colours: Sequence[FloatArray]) -> list[FloatArray]:
    """Return those colours that are there and do not look like one before."""
    kept: list[FloatArray] = []
    for colour in colours:
        length = float(np.linalg.norm(colour))
        if length > 0 and all(one @ colour < ALIKE * length for one in kept):
            kept.append(colour / length)
    return kept


def _light_system(
    lvf: Lvf, strip: Strip, layout: SensorLayout, regions: Slices, lit: CameraResponse
) -> tuple[SpectralSystem, FloatArray]:
    """Return the system of the light by the reflectance, and the wavelength of each place."""
    places = np.clip(channel_positions(layout, strip, regions), lvf.position[0], lvf.position[-1])
    lvfs = tuple(lvf.at(positions) for positions in places)
    centre_nm = np.mean([one.bands.centre_nm for one in lvfs], axis=0)
    return strip_system(lvfs, lit, KNOTS_NM), centre_nm


def _in_band(light: SpectralSystem, centre_nm: FloatArray) -> FloatArray:
    """Return the fraction of each value that is light of the place's own band, (p · channels,).

    A channel that is blind there sees what leaks through the filter all over the spectrum.
    """
    channels = len(light.design) // len(centre_nm)
    away_nm = np.abs(light.knots_nm - np.repeat(centre_nm, channels)[:, np.newaxis])
    inside = np.where(away_nm < IN_BAND_NM, light.design, 0.0).sum(axis=1)
    return np.asarray(inside / light.design.sum(axis=1))


def _known_by_card(light: SpectralSystem, seen: SliceValues, card: Transmittance) -> SpectralSystem:
    """Return the system corrected by the card's light, which tells what the curves are off by."""
    grey = Spectrum(card.name, light.knots_nm, card.at(light.knots_nm))
    expected = light.design @ grey.value
    return conditioned_on_white(light, seen.value.ravel(), seen.sigma.ravel(), grey, expected)


def _lit(camera: CameraResponse, lamp: Spectrum) -> CameraResponse:
    """Return the camera's response to the reflectance of what the lamp lights."""
    nm = np.union1d(camera.wavelength_nm, lamp.wavelength_nm)
    response = camera.at(nm) * lamp.at(nm)[:, np.newaxis]
    return CameraResponse(
        f"{camera.name} under {lamp.name}", nm, response / response.max(), camera.channels
    )
