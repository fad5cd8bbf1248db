"""A ColorChecker under the rig's lamp, with or without a grey card in its place."""

from dataclasses import dataclass, replace

import numpy as np

from labrig.analyse.frames import require_calibrated_camera, steady_frames
from labrig.analyse.inputs import Part
from labrig.calibration import CAMERA_KIND
from labrig.foundation.arrays import FloatArray
from labrig.foundation.detection import PRECISE_SIGMA
from labrig.foundation.errors import DataError
from labrig.foundation.region import Region
from labrig.optics import CHART_PATCHES
from labrig.record import FrameRole
from labrig.reduce import SeriesFrame, find_colour_chart, region_values
from labrig.results import SliceValues

#: Patches that must not be too dark: those that are not nearly black in some channel.
BRIGHT = (18, 19, 20, 21)
#: Relative σ of the light at the chart's edge against its middle, with and without a card.
EVENED, UNEVEN = 0.005, 0.1


@dataclass(frozen=True, eq=False)
class ChartScene:
    """Values of the chart's p patches in k channels, and of a card in the same places.

    Attributes
    ----------
    value, sigma
        Values in DN/s and σ by noise, shape (p, k); where there is a card, as if its light were the
        same everywhere.
    card
        Values of the card, the mean over all places, shape (k,); None without one.
    place
        Places of the patches from −1 to 1 across and down the chart, shape (p, 2).
    unevenness
        Relative σ of the light that is left at the chart's edge against its middle.
    range
        Ratio of the least to the most light that the card shows; None without a card.
    """

    value: FloatArray
    sigma: FloatArray
    card: FloatArray | None
    place: FloatArray
    unevenness: float
    range: float | None


def frames_of(part: Part, role: str) -> list[SeriesFrame]:
    """Return the frames of a role, checked against their sums and the calibrated camera.

    Raises
    ------
    DataError
        There are none, they are damaged, or they are of another camera.
    """
    frames = steady_frames(part.run, part.overrides, role)
    if not frames:
        raise DataError(
            f"{part.run.folder}: there are no complete '{role}' frames; go on with: labrig resume "
            f"{part.run.folder}"
        )
    require_calibrated_camera(part.inputs[CAMERA_KIND], part.run, part.run.frames(role))
    return frames


def chart_scene(part: Part, chart_role: str, card_role: str | None) -> ChartScene:
    """Find the chart in its frames, and measure its patches.

    Parameters
    ----------
    part
        Part of a run.
    chart_role, card_role
        Roles of the frames of chart and card; None without a card.

    Raises
    ------
    DataError
        Frames are missing or damaged, no chart is found, or it is too dark or clipped.
    """
    frames = frames_of(part, chart_role)
    # The shortest exposure of a bracket is metered: nothing clips.
    metered = min(frames, key=lambda frame: frame.exposure_s)
    patches = find_colour_chart(metered.path)
    chart = _measured(part, frames, patches)
    clipped = [
        name for name, row in zip(CHART_PATCHES, chart.value, strict=True) if np.isnan(row).any()
    ]
    if clipped:
        raise DataError(
            f"{metered.path}: expected patches that do not clip, clipped are {', '.join(clipped)}; "
            "lower camera.iso or close the aperture"
        )
    if (chart.value[list(BRIGHT)] < PRECISE_SIGMA * chart.sigma[list(BRIGHT)]).any():
        raise DataError(
            f"{metered.path}: the chart is too dark: expected grey patches {PRECISE_SIGMA:g} σ "
            "above the dark in every channel; expose for longer, or look whether the lamp burns"
        )
    middles = np.array([(x + wide / 2, y + high / 2) for x, y, wide, high in patches])
    place = middles - middles.mean(axis=0)
    place = place / np.abs(place).max(axis=0)
    scene = ChartScene(chart.value, chart.sigma, None, place, UNEVEN, None)
    if card_role is None:
        return scene
    card = _measured(part, frames_of(part, card_role), patches)
    if not (card.value > PRECISE_SIGMA * card.sigma).all():
        raise DataError(
            f"{part.run.folder}: expected a grey card lit at every place of the chart, got one "
            "that is too dark or clips; lay it where the chart lies, all of it"
        )
    return _evened(scene, card)


def _evened(scene: ChartScene, card: SliceValues) -> ChartScene:
    mean = card.value.mean(axis=0)
    light = card.value / mean
    value = scene.value / light
    sigma = np.hypot(scene.sigma / light, value * card.sigma / card.value)
    brightness = light.mean(axis=1)
    spread = float(brightness.min() / brightness.max())
    return replace(scene, value=value, sigma=sigma, card=mean, unevenness=EVENED, range=spread)


def _measured(part: Part, frames: list[SeriesFrame], patches: list[Region]) -> SliceValues:
    darks = steady_frames(part.run, part.overrides, FrameRole.DARK)
    regions = {f"{number:02d}": region for number, region in enumerate(patches)}
    values = region_values(frames, regions, darks, part.inputs[CAMERA_KIND])
    (unit,) = {frame.unit for frame in frames}
    return values[unit]
