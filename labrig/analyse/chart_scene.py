"""A ColorChecker under the rig's lamp, and colours from a camera's values by its curves."""

from dataclasses import dataclass, replace

import numpy as np

from labrig.analyse.frames import require_calibrated_camera, steady_frames
from labrig.analyse.inputs import AnalysisContext
from labrig.calibration import CAMERA_KIND
from labrig.foundation.arrays import FloatArray
from labrig.foundation.detection import PRECISE_SIGMA
from labrig.foundation.errors import DataError
from labrig.foundation.region import Region
from labrig.optics import CHART_PATCHES, CIE_1931, CameraResponse, Spectrum, observer
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


def frames_of(context: AnalysisContext, role: str) -> list[SeriesFrame]:
    """Return the frames of a role, checked against their sums and the calibrated camera.

    Raises
    ------
    DataError
        There are none, they are damaged, or they are of another camera.
    """
    frames = steady_frames(context.run, context.overrides, role)
    if not frames:
        raise DataError(
            f"{context.run.folder}: there are no complete '{role}' frames; go on with: "
            "labrig resume "
            f"{context.run.folder}"
        )
    require_calibrated_camera(context.inputs[CAMERA_KIND], context.run, context.run.frames(role))
    return frames


def chart_scene(context: AnalysisContext, chart_role: str, card_role: str | None) -> ChartScene:
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
    frames = frames_of(context, chart_role)
    # The shortest exposure of a bracket is metered: nothing clips.
    metered = min(frames, key=lambda frame: frame.exposure_s)
    patches = find_colour_chart(metered.path)
    chart = _measured(context, frames, patches)
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
            "above the dark in every channel; expose for longer, or check that the lamp is on"
        )
    middles = np.array([(x + wide / 2, y + high / 2) for x, y, wide, high in patches])
    place = middles - middles.mean(axis=0)
    place = place / np.abs(place).max(axis=0)
    scene = ChartScene(chart.value, chart.sigma, None, place, UNEVEN, None)
    if card_role is None:
        return scene
    card = _measured(context, frames_of(context, card_role), patches)
    if not (card.value > PRECISE_SIGMA * card.sigma).all():
        raise DataError(
            f"{context.run.folder}: expected a grey card lit at every place of the chart, got one "
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


def _measured(
    context: AnalysisContext, frames: list[SeriesFrame], patches: list[Region]
) -> SliceValues:
    darks = steady_frames(context.run, context.overrides, FrameRole.DARK)
    regions = {f"{number:02d}": region for number, region in enumerate(patches)}
    values = region_values(frames, regions, darks, context.inputs[CAMERA_KIND])
    (unit,) = {frame.unit for frame in frames}
    return values[unit]


#: Reflectances that a camera's matrix is for: smooth, σ of their level and course, and distance in
#: nm at which they are independent.
LEVEL_SIGMA, COURSE_SIGMA, COURSE_NM = 0.5, 0.25, 50.0
#: Width in nm of the structure of emissions.
EMISSION_NM = 20.0
STEP_NM = 5.0


def camera_matrix(camera: CameraResponse, light: Spectrum | None) -> FloatArray:
    """Return the matrix (3, k) from values to X, Y, Z, best for what may come back of a light.

    It minimises the mean squared error over smooth reflectances of a normal density; without a
    light, over spectra as dyes emit.
    """
    nm = np.arange(camera.wavelength_nm[0], camera.wavelength_nm[-1] + STEP_NM / 2, STEP_NM)
    power = np.ones_like(nm) if light is None else light.at(nm)
    eye = observer(CIE_1931)
    seen = power * np.array([np.interp(nm, eye.wavelength_nm, f) for f in eye.functions.T])
    counted = power * camera.at(nm).T
    level, course_nm = (0.0, EMISSION_NM) if light is None else (LEVEL_SIGMA, COURSE_NM)
    off = (nm[:, np.newaxis] - nm) / course_nm
    covariance = level**2 + COURSE_SIGMA**2 * np.exp(-(off**2) / 2)
    matrix = np.linalg.solve(counted @ covariance @ counted.T, counted @ covariance @ seen.T).T
    return np.asarray(matrix)
