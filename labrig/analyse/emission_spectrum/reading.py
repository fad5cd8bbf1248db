"""From what the filter's places showed to pictures in DN/s: dark and fall-off put right."""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from labrig.analyse.emission_spectrum.noise import PixelNoise, Seen, pixel_noise, seen
from labrig.analyse.emission_spectrum.picture import Pictures
from labrig.calibration.camera_file import CameraFile
from labrig.errors import DataError
from labrig.reduce import DarkModel, SeriesFrame, fit_dark
from labrig.reduce.patches import TWO_DEGREES
from labrig.region import Region
from labrig.results import is_usable

FloatArray = NDArray[np.float64]
Patch = TypeVar("Patch", bound=Hashable)


@dataclass(frozen=True, eq=False)
class Reading:
    """All frames in all places of one patch.

    Attributes
    ----------
    frames, darks
        As seen.
    slices
        The places.
    holder
        Dark parts of the frame beside the filter, seen after the places.
    camera
        Its calibration, where there is one.
    noise
        Of its pixels.
    dark
        Level of each place in the dark.
    """

    frames: Sequence[Seen]
    darks: Sequence[Seen]
    slices: Mapping[str, Region]
    holder: Mapping[str, Region]
    camera: CameraFile | None
    noise: PixelNoise
    dark: Sequence[DarkModel]

    def pictures(self, unit: str) -> Pictures:
        """The frames of a unit, those a person excludes left out."""
        rows = [one for one in self.frames if one.frame.unit == unit and is_usable(one.frame.flag)]
        if not rows:
            raise DataError(f"expected frames of {unit}, got none that are not excluded")
        columns = [self._reduced(one) for one in rows]
        value, sigma, dark_sigma = (np.stack(column) for column in zip(*columns, strict=True))
        middles_s = [one.frame.t_s + one.frame.exposure_s / 2 for one in rows]
        return Pictures(np.array(middles_s), value, sigma, dark_sigma)

    def _reduced(self, one: Seen) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Value, σ and the σ of what all have in common, each (places · channels,) in DN/s."""
        frame, camera, told_s = one.frame, self.camera, one.frame.exposure_s
        levels = [model.dark_level(told_s) for model in self.dark]
        level, known = (np.array(column) for column in zip(*levels, strict=True))
        light, sigma = one.level_dn - level, self.noise.sigma_dn(one.level_dn, one.pixels)
        # A sensor that has warmed since the dark frames is off in all places together.
        common = TWO_DEGREES * np.abs(np.array([m.current(told_s) for m in self.dark]))
        count = len(self.slices)
        if self.holder:
            share = one.pixels[count:] / one.pixels[count:].sum(axis=0)
            light = light - np.sum(share * light[count:], axis=0)
            common = np.broadcast_to(
                np.sqrt(np.sum((share * sigma[count:]) ** 2, axis=0)), light.shape
            )
        sigma = np.where(np.isnan(light), np.nan, np.hypot(sigma, known))
        per_dn = np.full(light.shape, told_s if camera is None else camera.exposure_s(told_s)[0])
        if camera is not None:
            per_dn[:count] *= [
                camera.flat(frame.f_number, region, one.width, one.height)
                for region in self.slices.values()
            ]
        columns = (light, sigma, common)
        value, sigma, common = ((column / per_dn)[:count].ravel() for column in columns)
        return value, sigma, common


def read_places(
    frames: Sequence[SeriesFrame],
    darks: Sequence[SeriesFrame],
    patches: Mapping[Patch, Mapping[str, Region]],
    camera: CameraFile | None,
    holder: Mapping[str, Region] | None = None,
) -> dict[Patch, Reading]:
    """Read every frame once, in every place of each patch, and in the holder, whose light is
    subtracted.

    Raises
    ------
    DataError
        No dark frames, or some at another ISO.
    """
    isos = {frame.iso for frame in (*frames, *darks)}
    if not darks or len(isos) > 1:
        raise DataError(
            f"expected dark frames at the one ISO of all frames, got {len(darks)} and ISO "
            f"{', '.join(f'{iso:g}' for iso in sorted(filter(None, isos)))}"
        )
    beside = dict(holder or {})
    regions = [region for slices in patches.values() for region in slices.values()]
    lit, dark = (seen(some, [*regions, *beside.values()], darks) for some in (frames, darks))
    rising = sorted(dark, key=lambda one: one.frame.exposure_s)
    groups = [[o for o in lit if o.frame.unit == u] for u in {o.frame.unit: None for o in lit}]
    places, first = {}, 0
    for patch, slices in patches.items():
        after = first + len(slices)
        # The holder's places come last.
        places[patch] = [*range(first, after), *range(len(regions), len(regions) + len(beside))]
        first = after
    # Patches fade differently: the frames of a pair are brought to the same brightness in each.
    noise = pixel_noise(
        [[one.take(own) for one in group] for own in places.values() for group in (*groups, rising)]
    )
    return {
        patch: _reading(
            [one.take(own) for one in lit], [one.take(own) for one in dark], patches[patch],
            beside, camera, noise,
        )
        for patch, own in places.items()
    }  # fmt: skip


def _reading(
    lit: Sequence[Seen],
    dark: Sequence[Seen],
    slices: Mapping[str, Region],
    holder: Mapping[str, Region],
    camera: CameraFile | None,
    noise: PixelNoise,
) -> Reading:
    exposure_s = np.array([one.frame.exposure_s for one in dark])
    level = np.stack([np.nan_to_num(one.level_dn) for one in dark])
    sigma = np.stack([noise.sigma_dn(one.level_dn, one.pixels) for one in dark])
    models = [
        fit_dark(exposure_s, level[:, place], np.nan_to_num(sigma[:, place], nan=np.inf))
        for place in range(level.shape[1])
    ]
    return Reading(lit, dark, slices, holder, camera, noise, models)
