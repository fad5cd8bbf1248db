"""Analysis of camera curves: the chart's patches, and the family of shipped cameras."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from labrig.acquire import RigFile
from labrig.analyse.chart_scene import ChartScene, chart_scene, frames_of
from labrig.analyse.frames import steady_frames
from labrig.analyse.inputs import AnalysisContext
from labrig.bench_optics import (
    card_reflectance,
    lamp_spectrum,
    lens_transmittance,
    polariser_transmittance,
)
from labrig.calibration import CAMERA_KIND, LVF_KIND
from labrig.fit.camera_curves import (
    GRID_NM,
    CameraCurvesFit,
    ChartReadings,
    FilterReadings,
    fit_camera_curves,
)
from labrig.foundation.errors import DataError, UsageError
from labrig.foundation.result_warning import Contradiction, Disturbance, ResultWarning, Undetermined
from labrig.foundation.yaml_file import did_you_mean
from labrig.optics import (
    CHANNELS,
    CHART_PATCHES,
    CameraResponse,
    Spectrum,
    read_camera,
    read_colour_chart,
    shipped_cameras,
)
from labrig.protocols.camera_curves.protocol import CurvesFrames
from labrig.protocols.camera_curves.result import CameraCurvesResult
from labrig.record import FrameRole
from labrig.reduce import sensor_layout, slice_values

#: Misfit from which the chart is not what it is taken for.
ODD_CHART = 1.6
#: Distance from the family's mean from which a camera is like none of them; of the shipped ones
#: against all others 1.6 at most, but for two. Under another lamp than the file's it is 2.3 to 6.
ODD_CAMERA = 2.0
#: The same where the filter tells the curves better than the family does.
ODD_BY_FILTER = 5.0
#: Mean σ of the curves, relative to their peaks, from which they are poor.
POOR = 0.04
#: Wavelengths in nm over which σ is averaged.
SEEN_NM = (400.0, 700.0)
#: Ratio of the least to the most light on the card from which the lamp is uneven.
UNEVEN = 0.6


def analyse(context: AnalysisContext) -> CameraCurvesResult:
    """Estimate the camera's curves with σ.

    Raises
    ------
    UsageError
        The rig file lacks the lamp's spectrum, or the filter's calibration where it is needed; or
        a camera that is to be left out is unknown.
    DataError
        Frames are missing or damaged, or no chart is to be seen in them.
    """
    protocol = context.protocol
    lamp, patches = _seen_lamp(context.rig), read_colour_chart(protocol.chart)
    left_out = _left_out(context)
    cameras = [
        read_camera(camera.path) for camera in shipped_cameras() if camera.name not in left_out
    ]
    scene = chart_scene(context, CurvesFrames.CHART, CurvesFrames.CARD if protocol.card else None)
    if scene.value.shape[1] != len(CHANNELS):
        raise DataError(
            f"{context.run.folder}: expected frames with the channels R, G and B, got "
            f"{scene.value.shape[1]}; curves of a monochrome camera need a monochromator"
        )
    reflectance = np.array([patch.at(GRID_NM) for patch in patches])
    readings = ChartReadings(scene.value, scene.sigma, reflectance, scene.place, scene.unevenness)
    through = _through(context) if protocol.through else None
    identity = context.run.camera_identity.partition(",")[0]
    fit = fit_camera_curves(readings, lamp, cameras, through, name=identity or "camera")
    camera = fit.camera
    assert camera.sigma is not None, "estimated curves have σ"
    return CameraCurvesResult(
        camera=camera.name,
        wavelength_nm=camera.wavelength_nm,
        channels=camera.channels,
        sensitivity=camera.sensitivity,
        sigma=camera.sigma,
        family_mean=fit.family_mean,
        family_count=len(cameras),
        left_out=left_out,
        chart=protocol.chart,
        patch_value=scene.value,
        patch_fitted=fit.chart,
        patch_sigma=fit.chart_sigma,
        lamp=lamp.name,
        evenness=scene.range,
        through_filter=through is not None,
        unusualness=fit.unusualness,
        misfit=fit.misfit,
        mean_sigma=_mean_sigma(camera),
        warnings=tuple(_warnings(fit, scene, through is not None)),
    )


def _seen_lamp(rig: RigFile) -> Spectrum:
    """Return the lamp as it comes through what is before the camera.

    A rig file that names a lens or a polariser has curves without them; all that use such curves
    multiply them by those, and would else count them twice.
    """
    lamp = lamp_spectrum(rig)
    for part in (lens_transmittance(rig), polariser_transmittance(rig)):
        if part is not None:
            passed = part.at(lamp.wavelength_nm)
            sigma = None if lamp.sigma is None else lamp.sigma * passed
            lamp = replace(lamp, value=lamp.value * passed, sigma=sigma)
    return lamp


def _left_out(context: AnalysisContext) -> tuple[str, ...]:
    """Return the names of the shipped cameras from which nothing is concluded."""
    shipped = {camera.name: camera for camera in shipped_cameras()}
    for name in context.protocol.leave_out:
        if name not in shipped:
            raise UsageError(
                f"leave_out: no shipped camera is called '{name}'; "
                f"{did_you_mean(name, list(shipped))}"
            )
    identity = context.run.camera_identity.partition(",")[0]
    own = [name for name, camera in shipped.items() if camera.is_called(identity)]
    return tuple(sorted({*own, *context.protocol.leave_out}))


def _through(context: AnalysisContext) -> FilterReadings:
    """Return the readings of the card through the filter."""
    calibrated = context.inputs[LVF_KIND]
    if calibrated is None or calibrated.before_camera is None:
        raise UsageError(
            f"{context.run.folder}: no LVF is known that is before the camera; "
            "run lvf_calibration, "
            "and name its run in the rig file (optics: {lvf: …}) or to labrig process --optics"
        )
    frames, strip = frames_of(context, CurvesFrames.THROUGH), calibrated.before_camera
    darks = steady_frames(context.run, context.overrides, FrameRole.DARK)
    (values,) = slice_values(frames, strip, darks, context.inputs[CAMERA_KIND]).values()
    layout = sensor_layout(frames[0])
    places = np.array(strip.positions(layout.width, layout.height))
    inside = np.clip(places, calibrated.position[0], calibrated.position[-1])
    return FilterReadings(
        values.value, values.sigma, calibrated.lvf.at(inside), card_reflectance(context.rig)
    )


def _mean_sigma(camera: CameraResponse) -> float:
    """Return the root mean square of σ over the channels' peaks, where a camera sees."""
    assert camera.sigma is not None
    inside = (camera.wavelength_nm >= SEEN_NM[0]) & (camera.wavelength_nm <= SEEN_NM[1])
    relative = camera.sigma[inside] / camera.sensitivity.max(axis=0)
    return float(np.sqrt(np.mean(np.square(relative))))


def _warnings(fit: CameraCurvesFit, scene: ChartScene, filtered: bool) -> Iterator[ResultWarning]:
    if fit.misfit > ODD_CHART:
        pulls = np.abs(scene.value - fit.chart) / fit.chart_sigma
        worst = CHART_PATCHES[int(pulls.max(axis=1).argmax())]
        yield Contradiction(
            "chart-unusual",
            "the patches differ from the prediction by a camera {misfit:.1f} times as much as "
            "charts "
            "do from their published means: the chart is another one, faded, shiny or in glare "
            "(name a table of your own chart as 'chart:'); σ was raised by as much, and the worst "
            "patch, {worst}, is off by {most_sigmas:.1f} of it",
            misfit=fit.misfit,
            worst=worst,
            most_sigmas=pulls.max(),
        )
    if fit.unusualness > (ODD_BY_FILTER if filtered else ODD_CAMERA):
        yield Contradiction(
            "camera-unusual",
            "the camera is {unusualness:.1f} times as far from the mean of the shipped ones as "
            "these are: the lamp is not the one of the rig file (its spectrum enters the curves "
            "one to one), or the camera is of another kind, such as an old or a scientific one",
            unusualness=fit.unusualness,
        )
    if scene.range is not None and scene.range < UNEVEN:
        yield Disturbance(
            "chart-uneven",
            "the lamp shines unevenly on the chart (darkest place {darkest:.0%} of the brightest); "
            "glare and shadows may be left when the card has corrected that: move the lamp away or "
            "the chart to the middle",
            darkest=scene.range,
        )
    if _mean_sigma(fit.camera) > POOR:
        more = (
            "measure your own chart's reflectances"
            if filtered
            else "photograph the card through the variable filter, too ('through: true')"
        )
        yield Undetermined(
            "curves-uncertain",
            "the curves are uncertain by {sigma:.1%} of their peaks; {remedy}",
            sigma=_mean_sigma(fit.camera),
            remedy=more,
        )
