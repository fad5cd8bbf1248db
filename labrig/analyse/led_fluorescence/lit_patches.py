"""Values of patches under LEDs or lamps, from brackets of frames with and without light."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from labrig.analyse.frames import require_calibrated_camera, steady_frames
from labrig.analyse.inputs import Part
from labrig.analyse.series_fit import TYPICAL_FLICKER
from labrig.errors import DataError
from labrig.protocols.steps.led_scenes import AGAIN
from labrig.record import FrameRole
from labrig.reduce import reduce_patches
from labrig.region import Region
from labrig.results import BoolArray, FloatArray, Measured, Series

#: Significance in σ from which light that is left without a light counts.
SEEN_SIGMA = 5.0


@dataclass(frozen=True, eq=False)
class LitPatch:
    """Values of one patch under m LEDs, in k channels.

    Attributes
    ----------
    value, variance
        Values in DN/s and their variances, with the frames' flicker, shape (m, k).
    off, off_sigma
        Values in DN/s just after each LED, and their σ, shape (m, k).
    is_clipped
        Whether even the shortest exposures were clipped, shape (m,).
    bleaching
        Value under the first LED at the end of the run over that at its begin; None if it was not
        lit again.
    """

    value: FloatArray
    variance: FloatArray
    off: FloatArray
    off_sigma: FloatArray
    is_clipped: BoolArray
    bleaching: Measured | None = None

    def under(self, rows: Sequence[int]) -> "LitPatch":
        """Return the values under some of the LEDs."""
        return LitPatch(
            self.value[rows],
            self.variance[rows],
            self.off[rows],
            self.off_sigma[rows],
            self.is_clipped[rows],
            self.bleaching,
        )

    def times(self, factor: FloatArray, relative_variance: FloatArray) -> "LitPatch":
        """Return the values under each LED times a factor with an error, each shape (m,)."""
        by = factor[:, np.newaxis]
        value = self.value * by
        variance = self.variance * by**2 + value**2 * relative_variance[:, np.newaxis]
        return LitPatch(
            value, variance, self.off * by, self.off_sigma * by, self.is_clipped, self.bleaching
        )


def lit_patches(
    part: Part,
    role: str,
    begin: str,
    lights: Sequence[str],
    first: str | None = None,
    patches: Mapping[str, Region] | None = None,
) -> dict[str, LitPatch]:
    """Return each patch under all lights, in their order.

    Parameters
    ----------
    part
        The run.
    role
        Role of the frames with a light on; `-off` is added for those with all lights off.
    begin
        Begin of the names of the units, which end with the light.
    lights
        Names of the lights.
    first
        Light under which the patches were photographed once more at the end; None for none.
    patches
        Regions of the patches; None for those of the protocol.

    Raises
    ------
    DataError
        Frames are missing, damaged, or of another camera than the calibrated one.
    """
    camera = part.inputs.camera
    flicker = TYPICAL_FLICKER if camera is None else camera.flicker
    lit, left = (_series(part, each, patches) for each in (role, f"{role}-off"))
    units = [f"{begin}{light}" for light in lights]
    again = None if first is None else (f"{begin}{first}", f"{AGAIN}{first}")
    return {
        name: _lit_patch(part, series, left[name], units, again, flicker)
        for name, series in lit.items()
    }


def without_rest(patch: LitPatch) -> LitPatch:
    """Return a patch without the light that is left when its lights are off, if there is any."""
    is_left = patch.off > SEEN_SIGMA * patch.off_sigma
    return replace(
        patch,
        value=np.where(is_left, patch.value - patch.off, patch.value),
        variance=np.where(is_left, patch.variance + patch.off_sigma**2, patch.variance),
    )


def mean_of(patches: Mapping[str, LitPatch]) -> LitPatch:
    """Return the mean of some patches, with the variance of one: neighbours share their light."""
    each = list(patches.values())
    return LitPatch(
        np.mean([patch.value for patch in each], axis=0),
        np.mean([patch.variance for patch in each], axis=0),
        np.mean([patch.off for patch in each], axis=0),
        np.mean([patch.off_sigma for patch in each], axis=0),
        np.any([patch.is_clipped for patch in each], axis=0),
    )


def _series(part: Part, role: str, patches: Mapping[str, Region] | None) -> dict[str, Series]:
    run, camera = part.run, part.inputs.camera
    frames = steady_frames(run, part.overrides, role)
    if not frames:
        raise DataError(
            f"{run.folder}: there are no complete '{role}' frames; go on with: labrig resume "
            f"{run.folder}"
        )
    require_calibrated_camera(camera, run, run.frames(role))
    darks = steady_frames(run, part.overrides, FrameRole.DARK)
    regions = part.overrides.patches(part.protocol) if patches is None else patches
    return reduce_patches(frames, regions, darks, camera=camera)


def _lit_patch(
    part: Part,
    series: Series,
    left: Series,
    units: Sequence[str],
    again: tuple[str, str] | None,
    flicker: float,
) -> LitPatch:
    lit = {unit.unit[0]: _merged(unit, flicker) for unit in series.by_unit()}
    off = {unit.unit[0]: (unit.values[0], unit.sigma[0]) for unit in left.by_unit()}
    if missing := [unit for unit in units if unit not in lit or unit not in off]:
        raise DataError(
            f"{part.run.folder}: the unit '{missing[0]}' is not complete; go on with: labrig "
            f"resume {part.run.folder}"
        )
    columns = [np.array(column) for column in zip(*(lit[unit] for unit in units), strict=True)]
    offs = [np.array(column) for column in zip(*(off[unit] for unit in units), strict=True)]
    bleaching = None
    if again is not None and again[1] in lit:
        bleaching = _ratio(lit[again[1]], lit[again[0]])
    return LitPatch(columns[0], columns[1], offs[0], offs[1], columns[2], bleaching)


def _merged(unit: Series, flicker: float) -> tuple[FloatArray, FloatArray, bool]:
    """Merge a bracket: values (k,), variances (k,), and whether all frames are clipped."""
    usable = unit.usable
    if not usable.any():
        return unit.values[0], np.square(unit.sigma[0]), True
    value, variance = unit.values[usable], np.square(unit.sigma[usable])
    # Flicker is that of the mean: of each value itself, it would prefer the low ones.
    mean = (value / variance).sum(axis=0) / (1 / variance).sum(axis=0)
    weight = 1 / (variance + np.square(flicker * mean))
    mean = (weight * value).sum(axis=0) / weight.sum(axis=0)
    return mean, 1 / weight.sum(axis=0), False


def _ratio(
    after: tuple[FloatArray, FloatArray, bool], before: tuple[FloatArray, FloatArray, bool]
) -> Measured:
    """Return the ratio of two brackets, of the channels together."""
    weight = before[0] / before[1]
    numerator, denominator = weight @ after[0], weight @ before[0]
    relative = weight**2 @ after[1] / numerator**2 + weight**2 @ before[1] / denominator**2
    ratio = numerator / denominator
    return Measured(float(ratio), float(abs(ratio) * np.sqrt(relative)))
