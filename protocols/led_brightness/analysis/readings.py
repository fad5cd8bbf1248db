"""What camera and spectrometer saw of a white reference under each LED."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from labrig.analyse.frame_times import untimed
from labrig.analyse.frames import (
    part_frames,
    part_region,
    require_calibrated_camera,
    require_intact,
)
from labrig.analyse.inputs import AnalysisContext
from labrig.bench_optics import card_reflectance
from labrig.calibration import CAMERA_KIND
from labrig.fit.leds import LedBand, led_band
from labrig.foundation.arrays import FloatArray
from labrig.foundation.detection import DETECTION_SIGMA
from labrig.foundation.errors import DataError, UsageError
from labrig.optics import CameraResponse, read_spectrometer_reading
from labrig.protocols.led_brightness.protocol import BrightnessFrames
from labrig.record import FrameRecord, FrameRole, SpectrumRecord
from labrig.reduce import FLICKER, reduce_patches
from labrig.results import Series

#: Relative independent error of a channel's value: the sensor's pattern, the shutter.
PATTERN = 0.002
#: Part of an LED's light that counts as ambient light beside it.
AMBIENT = 1e-3
#: Relative σ of a standard lamp's calibration whose file has none.
CALIBRATION_SIGMA = 0.02


@dataclass(frozen=True, eq=False)
class CameraValues:
    """Values of the white reference under one LED, less those with the LED off.

    Attributes
    ----------
    value, sigma
        Values and σ in DN/s, shape (channels,); NaN where all frames are clipped.
    off, off_sigma
        Values with the LED off and σ in DN/s, shape (channels,).
    """

    value: FloatArray
    sigma: FloatArray
    off: FloatArray
    off_sigma: FloatArray

    @property
    def is_clipped(self) -> bool:
        """Whether no frame is usable."""
        return bool(np.isnan(self.value).all())

    @property
    def is_off_clipped(self) -> bool:
        """Whether the frame with the LED off is not usable."""
        return bool(np.isnan(self.off).all())

    @property
    def is_seen(self) -> bool:
        """Whether some channel sees the LED."""
        return bool((self.value > DETECTION_SIGMA * self.sigma).any())

    @property
    def is_ambient(self) -> bool:
        """Whether light is there with the LED off, enough to matter."""
        total = np.nanmax(np.append(self.value, 0.0))
        seen = self.off > np.maximum(DETECTION_SIGMA * self.off_sigma, AMBIENT * total)
        return bool(seen.any())


@dataclass(frozen=True, eq=False)
class Spectrometry:
    """Light of one LED by the spectrometer.

    Attributes
    ----------
    band
        Its band; None if no light was seen.
    is_saturated
        Whether a pixel of it is saturated.
    change
        Relative change of the light from the reading before the photographs to that after them.
    is_absolute
        Whether the light is in W m⁻².
    response_sigma
        Relative σ of the absolute scale; infinite if there is none.
    """

    band: LedBand | None
    is_saturated: bool
    change: float
    is_absolute: bool
    response_sigma: float


def camera_values(context: AnalysisContext, camera: CameraResponse) -> dict[str, CameraValues]:
    """Measure the white reference in the frames of every completed unit.

    Raises
    ------
    DataError
        Frames are missing or damaged, or they have other channels than the camera's curves.
    """
    lit = part_frames(context, BrightnessFrames.CARD)
    if not lit:
        raise DataError(
            f"{context.run.folder}: no LED's unit is complete; go on with: labrig resume "
            f"{context.run.folder}"
        )
    require_calibrated_camera(context.inputs[CAMERA_KIND], context.run, lit)
    off = part_frames(context, BrightnessFrames.CARD_OFF)
    darks = part_frames(context, FrameRole.DARK)
    series, off_series = (_series(context, frames, darks) for frames in (lit, off))
    if set(series.channels) != set(camera.channels):
        raise UsageError(
            f"{context.run.folder}: expected frames with the channels of the camera's curves, "
            f"{', '.join(camera.channels)}, got {', '.join(series.channels)}; name this camera's "
            "curves in the rig file (optics: camera)"
        )
    order = [series.channels.index(channel) for channel in camera.channels]
    by_unit = {unit_series.unit[0]: _mean(unit_series) for unit_series in off_series.by_unit()}
    return {
        one.unit[0]: _less(_mean(one), by_unit.get(one.unit[0]), order) for one in series.by_unit()
    }


def _series(
    context: AnalysisContext, frames: Sequence[FrameRecord], darks: Sequence[FrameRecord]
) -> Series:
    region = part_region(context, context.protocol.card)
    measured = reduce_patches(
        [untimed(frame) for frame in frames],
        {"card": region},
        [untimed(frame) for frame in darks],
        camera=context.inputs[CAMERA_KIND],
    )
    return measured["card"]


def _mean(series: Series) -> tuple[FloatArray, FloatArray]:
    """Return the weighted mean of a unit's frames and σ, with the shutter's flicker."""
    usable = series.usable
    if not usable.any():
        nothing = np.full(len(series.channels), np.nan)
        return nothing, nothing
    values, sigma = series.values[usable], series.sigma[usable]
    # Flicker bounds what a single frame says, however many photons it has.
    weight = 1 / (sigma**2 + (FLICKER * values) ** 2)
    mean = (weight * values).sum(axis=0) / weight.sum(axis=0)
    noise = np.sqrt((weight**2 * sigma**2).sum(axis=0)) / weight.sum(axis=0)
    dark = np.nan_to_num(series.dark_sigma)
    return mean, np.sqrt(noise**2 + dark**2 + (PATTERN * mean) ** 2)


def _less(
    lit: tuple[FloatArray, FloatArray], off: tuple[FloatArray, FloatArray] | None, order: list[int]
) -> CameraValues:
    """Return values less those with the LED off where these show light."""
    value, sigma = lit[0][order], lit[1][order]
    if off is None:
        return CameraValues(value, sigma, np.zeros_like(value), np.zeros_like(value))
    off_value, off_sigma = off[0][order], off[1][order]
    measured = CameraValues(value, sigma, off_value, off_sigma)
    if not measured.is_ambient:
        return measured
    return replace(measured, value=value - off_value, sigma=np.hypot(sigma, off_sigma))


def spectrometry(context: AnalysisContext, unit: str, name: str) -> Spectrometry | None:
    """Return what the spectrometer saw in a unit; None if it was not read.

    Raises
    ------
    DataError
        A reading is damaged.
    """
    roles = (BrightnessFrames.SPECTRUM, BrightnessFrames.SPECTRUM_OFF)
    require_intact(context.run, roles, context.overrides)
    lit, off = (_records(context, role, unit) for role in roles)
    if not lit or not off:
        return None
    readings = [read_spectrometer_reading(record.path) for record in lit]
    dark = read_spectrometer_reading(off[-1].path)
    stacked = replace(
        readings[0], raw_counts=np.concatenate([reading.raw_counts for reading in readings])
    )
    measured = stacked.corrected(dark)
    if measured.sigma is None:
        raise DataError(f"{lit[0].path}: expected two or more spectra in a reading, got one")
    factor, response_sigma = np.ones_like(measured.counts), math.inf
    calibration = stacked.calibration
    if calibration is not None:
        factor = np.interp(measured.wavelength_nm, calibration.wavelength_nm, calibration.value)
        response_sigma = CALIBRATION_SIGMA
        if calibration.sigma is not None:
            response_sigma = float(np.median(calibration.sigma / calibration.value))
    # It reads the reference, whose reflectance is not that of a white.
    reflected = card_reflectance(context.rig).at(measured.wavelength_nm)
    factor = factor / (measured.integration_s * reflected)
    inside = np.ones(len(factor), dtype=np.bool_)
    inside[list(stacked.dark_pixels)] = False
    if calibration is not None:
        inside &= measured.wavelength_nm >= calibration.wavelength_nm[0]
        inside &= measured.wavelength_nm <= calibration.wavelength_nm[-1]
    grid_nm = measured.wavelength_nm[inside]
    band = led_band(
        name, grid_nm, (factor * measured.counts)[inside], (factor * measured.sigma)[inside]
    )
    change = 0.0
    if band is not None and len(readings) > 1:
        lights = [
            float((factor * reading.corrected(dark).counts)[inside] @ _in_band(band, grid_nm))
            for reading in (readings[0], readings[-1])
        ]
        change = lights[1] / lights[0] - 1
    return Spectrometry(
        band, bool(measured.saturated[inside].any()), change, calibration is not None,
        response_sigma,
    )  # fmt: skip


def _records(context: AnalysisContext, role: str, unit: str) -> list[SpectrumRecord]:
    return [
        record
        for record in context.run.spectra(role)
        if record.unit == unit and not context.overrides.excludes(record)
    ]


def _in_band(band: LedBand, grid_nm: FloatArray) -> FloatArray:
    return np.where(band.beside == 0.0, np.gradient(grid_nm), 0.0)
