"""Forward model of a frame through the LVF: filter, strip, camera curves, white reference.

Camera curves from another laboratory are off by some per cent, and so is every spectrum obtained
with them. A grey card under a known lamp, seen through the same filter, measures the deviation in
every position and channel, and constrains the model's errors.
"""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from labrig.analyse.combined_frames import CombinedFrame, combined
from labrig.analyse.inputs import AnalysisContext
from labrig.analyse.strip import Slices, StripPatch, slice_strip, strip_regions, tilt_offset
from labrig.bench_optics import camera_curves, card_reflectance, lamp_spectrum
from labrig.calibration import LVF_KIND
from labrig.fit.spectrum import CurveError, SpectralSystem, system_through_lvf
from labrig.foundation.arrays import FloatArray
from labrig.foundation.errors import DataError, UsageError
from labrig.foundation.region import Region
from labrig.foundation.result_warning import ResultWarning, Unmeasured
from labrig.optics import (
    Bands,
    CameraResponse,
    Lvf,
    Spectrum,
    Strip,
    Transmittance,
    read_monochrome_camera,
    signal_through,
)
from labrig.reduce import SensorLayout, SeriesFrame, sensor_layout
from labrig.results import FilterFrames

#: Relative uncertainty of a lamp's spectrum whose file has none.
LAMP_SIGMA = 0.01
#: Prior σ of the frame's relative brightness, uninformative.
ANY_BRIGHTNESS = 1e3


def channel_positions(layout: SensorLayout, strip: Strip, slices: Slices) -> FloatArray:
    """Return the middle of each channel's own pixels in every slice, shape (channels, positions).

    Pixels of one colour are two apart: where slices are few pixels wide, that is some nanometres.
    """
    middles = np.array([layout.middle_columns(region) for region in slices.values()]).T
    across = (strip.right[0] - strip.left[0]) * layout.width
    fraction = (middles - strip.left[0] * layout.width) / across + tilt_offset(
        strip, slices, layout
    )
    return fraction if strip.rising else 1 - fraction


def strip_system(
    lvfs: Sequence[Lvf], camera: CameraResponse, knots_nm: FloatArray
) -> SpectralSystem:
    """Return the system whose channels each see the filter in a place of their own.

    An error of the filter is common to the channels of a slice, one of a curve is the channel's.
    """
    error = CurveError()
    parts = [
        system_through_lvf(lvf, channel, knots_nm, error)
        for lvf, channel in zip(lvfs, channel_cameras(camera), strict=True)
    ]
    filter_modes = sum(
        int(np.count_nonzero(getattr(lvfs[0].sigma, parameter.name))) for parameter in fields(Bands)
    )
    curves = len(parts[0].modes) - filter_modes
    count, knots = len(parts), len(knots_nm)
    shape = (len(parts[0].design), count, knots)
    design = np.stack([part.design for part in parts], axis=1)
    modes = []
    for number, part in enumerate(parts):
        channel_modes = np.zeros((curves, *shape))
        channel_modes[:, :, number] = part.modes[:curves]
        modes.append(channel_modes)
    modes.append(np.stack([part.modes[curves:] for part in parts], axis=2))
    rows = shape[0] * count
    return SpectralSystem(
        knots_nm, design.reshape(rows, knots), np.concatenate(modes).reshape(-1, rows, knots)
    )


def channel_cameras(camera: CameraResponse) -> list[CameraResponse]:
    """Return each channel as a camera of its own."""
    return [
        CameraResponse(
            camera.name,
            camera.wavelength_nm,
            camera.sensitivity[:, [number]],
            (name,),
            None if camera.sigma is None else camera.sigma[:, [number]],
        )
        for number, name in enumerate(camera.channels)
    ]


def conditioned_on_white(
    system: SpectralSystem,
    value: FloatArray,
    sigma: FloatArray,
    light: Spectrum,
    expected: FloatArray,
) -> SpectralSystem:
    """Condition the system on a frame of a known light.

    With value = g (expected + Σ_k z_k modes_k · light) + noise, z and g normal, this is the mean
    and covariance of z given the frame.

    Parameters
    ----------
    system
        Linear model with error modes.
    value, sigma
        Values of the frame in any unit and their standard uncertainties, shape (m,); NaN where it
        clips.
    light
        Spectrum of the light that was photographed.
    expected
        Values by the system's own curves, wavelengths beyond its knots included, shape (m,).
    """
    is_finite = np.isfinite(value) & np.isfinite(sigma)
    gain = float(
        expected[is_finite] @ value[is_finite] / (expected[is_finite] @ expected[is_finite])
    )
    y, s = value[is_finite] / gain, sigma[is_finite] / gain
    mode_values = system.modes[:, is_finite] @ light.at(system.knots_nm)
    levers = np.vstack([mode_values, ANY_BRIGHTNESS * expected[is_finite]])
    noise = np.hypot(s, LAMP_SIGMA * expected[is_finite])
    whitened = levers / noise
    precision = np.eye(len(levers)) + whitened @ whitened.T
    mean = np.linalg.solve(precision, whitened @ ((y - expected[is_finite]) / noise))
    # Rows of the root of the covariance: independent again, each of unit variance.
    root = np.linalg.inv(np.linalg.cholesky(precision))[:, :-1]
    design = system.design + np.tensordot(mean[:-1], system.modes, axes=1)
    return SpectralSystem(
        system.knots_nm, np.maximum(design, 0.0), np.tensordot(root, system.modes, axes=1)
    )


#: Range in which the holder is read, in heights of the strip from its middle; the filter's own
#: blurred edges end at 0.7.
HOLDER = (0.8, 1.1)
#: Knots of the fitted spectrum: finer than the filter's 25 nm, and beyond the grid of results.
KNOTS_NM: FloatArray = np.arange(380.0, 721.0, 5.0)


@dataclass(frozen=True, eq=False)
class ForwardModel:
    """Model of a frame's values by the spectrum of one patch.

    Attributes
    ----------
    slices, holder
        Regions in which the filter is read, and those of its opaque holder beside it.
    camera
        Curves of the camera.
    system
        Linear model of the values by a spectrum, and its error modes.
    white_reference
        Whether the curves were corrected by a grey card under the known lamp.
    """

    slices: Mapping[str, Region]
    holder: Mapping[str, Region]
    camera: CameraResponse
    system: SpectralSystem
    white_reference: bool = False

    @property
    @abstractmethod
    def centre_nm(self) -> FloatArray:
        """Middle of the band in which each value is read in nm, place by place, (m,)."""

    @abstractmethod
    def expected_of(self, light: Spectrum) -> FloatArray:
        """Return the values of a light by the model, shape (m,)."""


@dataclass(frozen=True, eq=False)
class LvfModel(ForwardModel):
    """Model of a frame through the variable filter.

    Attributes
    ----------
    lvfs
        The filter at the middle of each slice's own pixels, for every channel.
    """

    lvfs: tuple[Lvf, ...] = ()

    @property
    def centre_nm(self) -> FloatArray:
        """Centre of the band in which each value is read in nm, shape (positions · channels,)."""
        return np.stack([lvf.bands.centre_nm for lvf in self.lvfs], axis=1).ravel()

    def expected_of(self, light: Spectrum) -> FloatArray:
        """Return the values of a light by the model, shape (positions · channels,)."""
        columns = [
            signal_through(lvf, channel, light)[:, 0]
            for lvf, channel in zip(self.lvfs, channel_cameras(self.camera), strict=True)
        ]
        return np.stack(columns, axis=1).ravel()


def forward_models(
    context: AnalysisContext, frame: SeriesFrame, patches: Sequence[StripPatch] | None = None
) -> tuple[dict[StripPatch, LvfModel], tuple[ResultWarning, ...]]:
    """Return the model of every patch of a part, and warnings of patches without one.

    Parameters
    ----------
    part
        Part of a run.
    frame
        Any of the part's frames, for the camera's pixels and channels.
    patches
        The patches; None for those of the part's protocol.

    Raises
    ------
    UsageError
        There is no LVF calibrated for this place, or there are no camera curves.
    DataError
        No patch lies below the filter.
    """
    calibration = context.inputs[LVF_KIND]
    if calibration is None or calibration.before_camera is None:
        raise UsageError(
            "a spectrum needs the LVF calibrated before the camera: run the protocol "
            "lvf_calibration, and name its run in the rig file (optics: {lvf: …}) or to labrig "
            "process --optics"
        )
    layout, strip, lvf = sensor_layout(frame), calibration.before_camera, calibration.lvf
    camera, holder = channel_curves(context, layout.channels), _holder_regions(strip)
    asked = strip_regions(context) if patches is None else patches
    sliced, refused = slice_strip(asked, strip, layout)
    models: dict[StripPatch, LvfModel] = {}
    for patch, slices in sliced.items():
        # At either end pixels reach a little beyond the places that were calibrated.
        seen = channel_positions(layout, strip, slices)
        places = np.clip(seen, lvf.position[0], lvf.position[-1])
        lvfs = tuple(lvf.at(positions) for positions in places)
        system = strip_system(lvfs, camera, KNOTS_NM)
        models[patch] = LvfModel(slices, holder, camera, system, lvfs=lvfs)
    return models, refused


def with_white_reference(
    model: ForwardModel, context: AnalysisContext, white: FilterFrames | None
) -> tuple[ForwardModel, tuple[ResultWarning, ...]]:
    """Condition the model on frames of the grey card, if there are any; return it with warnings.

    Raises
    ------
    UsageError
        The files of lamp or grey card are malformed.
    """
    if white is None:
        return model, ()
    optics = context.rig.optics
    if optics.lamp is None or optics.grey_card is None:
        return model, (
            Unmeasured(
                "white-picture-unused",
                "the white picture is not used, since the spectra of lamp and grey card are not "
                "known: name them in the rig file, as 'lamp' and 'grey_card' under 'optics'",
            ),
        )
    light = card_light(lamp_spectrum(context.rig), card_reflectance(context.rig))
    white_frame = combined(white)
    if not white_frame.shows_light:
        return model, (
            Unmeasured(
                "white-picture-dark",
                "the white picture is dark or clips throughout; the spectrum does without",
            ),
        )
    system = conditioned_on_white(
        model.system, white_frame.value, white_frame.sigma, light, model.expected_of(light)
    )
    return replace(model, system=system, white_reference=True), ()


def card_misfit(model: ForwardModel, frame: CombinedFrame, light: Spectrum) -> float:
    """Return the root of χ² per degree of freedom of a frame of a known light, its brightness free.

    Parameters
    ----------
    model
        Model that is not conditioned on the frame.
    frame
        Frame of the light.
    light
        Spectrum of the light.
    """
    used = np.isfinite(frame.value) & np.isfinite(frame.sigma)
    expected = model.expected_of(light)[used]
    gain = float(expected @ frame.value[used] / (expected @ expected))
    residual = frame.value[used] / gain - expected
    modes = model.system.modes[:, used] @ light.at(model.system.knots_nm)
    modes = np.vstack([modes, ANY_BRIGHTNESS * expected])
    noise = np.square(frame.sigma[used] / gain) + np.square(LAMP_SIGMA * expected)
    covariance = modes.T @ modes + np.diag(noise)
    chi2 = float(residual @ np.linalg.solve(covariance, residual))
    return float(np.sqrt(chi2 / max(int(used.sum()) - 1, 1)))


def _holder_regions(strip: Strip) -> dict[str, Region]:
    """Return dark stripes above and below the strip, as far as they lie in the frame."""
    (left, left_y), (right, right_y) = strip.left, strip.right
    upper, lower = min(left_y, right_y), max(left_y, right_y)
    near, far = (fraction * strip.height for fraction in HOLDER)
    stripes = {"above": (upper - far, upper - near), "below": (lower + near, lower + far)}
    return {
        name: (left, top, right - left, bottom - top)
        for name, (top, bottom) in stripes.items()
        if top >= 0 and bottom <= 1
    }


def card_light(lamp: Spectrum, card: Transmittance) -> Spectrum:
    """Return the spectrum of the lamp's light that the card reflects."""
    inside = (card.wavelength_nm > lamp.wavelength_nm[0]) & (
        card.wavelength_nm < lamp.wavelength_nm[-1]
    )
    fine = np.union1d(lamp.wavelength_nm, card.wavelength_nm[inside])
    return Spectrum(lamp.name, fine, lamp.at(fine) * card.at(fine))


def channel_curves(context: AnalysisContext, channels: tuple[str, ...]) -> CameraResponse:
    """Return the curves of the camera, in the order of a frame's channels.

    Raises
    ------
    DataError
        The camera has other channels.
    """
    if len(channels) == 1:
        name = context.overrides.camera or context.rig.optics.camera
        if name is not None:
            return read_monochrome_camera(name)
    camera = camera_curves(context.rig, context.overrides.camera, context.inputs[LVF_KIND])
    if camera.channels != channels:
        raise DataError(
            f"expected frames with the channels {', '.join(camera.channels)} or one alone, got "
            f"{', '.join(channels)}"
        )
    return camera
