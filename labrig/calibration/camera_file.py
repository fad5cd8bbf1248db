"""The camera file: calibration of a camera body and lens, and its sensitivity by settings."""

import math
from typing import Literal, Self

from pydantic import model_validator

from labrig.calibration.kind import CalibrationKind
from labrig.foundation.errors import DataError
from labrig.foundation.models import Finite, FrozenModel, NotNegative, Positive
from labrig.optics import CameraModel, f_number_text

#: Flicker without a calibration: shutters, apertures and lamps scatter by 0.5 to 1 % (1 σ).
TYPICAL_FLICKER = 0.007
#: Error of a shutter in s without a calibration (1 σ).
TYPICAL_SHUTTER_S = 2e-4


class Noise(FrozenModel):
    """Noise of a pixel at one ISO; every σ is one standard deviation.

    Attributes
    ----------
    iso
        The ISO setting.
    gain_e_per_dn, gain_e_per_dn_sigma
        Electrons per DN from the photon transfer curve, and σ.
    read_noise_e, read_noise_e_sigma
        Read noise of one pixel in electrons without the row noise, and σ.
    read_noise_is_limit
        Whether the read noise is only known to be below `read_noise_e`, with 95 % confidence: it is
        too small a part of a step of the camera's numbers to change them.
    row_noise_e
        Read noise in electrons that is common to all pixels of a row.
    """

    iso: Positive
    gain_e_per_dn: Positive
    gain_e_per_dn_sigma: NotNegative
    read_noise_e: NotNegative
    read_noise_e_sigma: NotNegative
    read_noise_is_limit: bool = False
    row_noise_e: NotNegative = 0.0


class Linearity(FrozenModel):
    """Deviation from linearity: ln(signal over that of a linear sensor) at levels above dark.

    Attributes
    ----------
    level_dn
        Signal levels above dark in DN.
    deviation, sigma
        Deviation from linearity at these levels, and one standard deviation.
    saturation_dn
        Saturation level above dark in DN; null if it was not reached.
    """

    level_dn: tuple[Positive, ...]
    deviation: tuple[Finite, ...]
    sigma: tuple[NotNegative, ...]
    saturation_dn: Positive | None = None

    @model_validator(mode="after")
    def _one_number_each(self) -> Self:
        if not len(self.level_dn) == len(self.deviation) == len(self.sigma):
            raise ValueError("expected one 'deviation' and one 'sigma' for every 'level_dn'")
        return self


class CameraFile(CameraModel):
    """Result of `camera_calibration`: camera model, identity, noise and linearity.

    Attributes
    ----------
    camera
        Identity of the calibrated body as it reports it.
    lens
        Lens as recorded in the frames; null if they do not record it.
    noise
        Noise of a pixel, one entry for each ISO.
    linearity
        Deviation from linearity, common to all channels.
    flicker, flicker_sigma
        Relative scatter of the light from frame to frame, common to all channels, and its σ.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.calibration import CAMERA_KIND
    >>> camera = CAMERA_KIND.read(Path("camera.yaml"))
    >>> exposure_s, relative_sigma = camera.exposure_s(1 / 64)
    >>> f"{1e3 * exposure_s:.1f} ms ± {100 * relative_sigma:.1f} %"
    '15.6 ms ± 0.5 %'
    """

    kind: Literal["camera"] = "camera"
    camera: str
    lens: str | None = None
    noise: tuple[Noise, ...] = ()
    linearity: Linearity | None = None
    flicker: NotNegative
    flicker_sigma: NotNegative
    source: str = ""
    run: str | None = None

    def require_match(self, camera: str, lens: str | None, f_number: float | None) -> None:
        """Refuse frames to which this calibration does not apply.

        Parameters
        ----------
        camera
            Identity of the camera as it reports it.
        lens
            Lens as recorded in the frames; None if they do not record it.
        f_number
            The f-number of the frames; None if it is not known.

        Raises
        ------
        DataError
            The frames are of another body or lens, or of an aperture that was not calibrated.
        """
        if camera_body(camera) != camera_body(self.camera):
            raise DataError(
                f"calibration of another camera: expected '{camera_body(self.camera)}', the frames "
                f"are of '{camera_body(camera)}'; calibrate this one, or leave optics.camera_file "
                "out"
            )
        if lens is not None and self.lens is not None and lens != self.lens:
            raise DataError(
                f"calibration of another lens: expected {self.lens}, the frames were taken with "
                f"{lens}; calibrate this one, or leave optics.camera_file out"
            )
        if self.flat_at(f_number) is None:
            calibrated = ", ".join(f_number_text(flat.f_number) for flat in self.flats)
            raise DataError(
                f"calibration of another lens or aperture: expected {calibrated}, the frames were "
                f"taken at {f_number_text(f_number)}; calibrate that, too, or leave "
                "optics.camera_file out"
            )


CAMERA_KIND = CalibrationKind(
    name="camera",
    protocol="camera_calibration",
    optics_key="camera_file",
    file_name="camera.yaml",
    model=CameraFile,
)


def camera_body(identity: str) -> str:
    """Return the identity without the firmware version, which may have been updated."""
    return identity.partition(", firmware")[0]


#: Relative σ of a nominal ISO and of a nominal f-number whose ratio was not calibrated.
ISO_SIGMA, APERTURE_SIGMA = 0.02, 0.05

#: ISO and f-number; None for a lens that does not report it.
Settings = tuple[float, float | None]


def relative_sensitivity(
    camera: CameraFile | None, settings: Settings, reference: Settings
) -> tuple[float, float]:
    """Return the signal of a light at some settings over that at others, and its relative σ.

    Parameters
    ----------
    camera
        Calibration of the camera; None takes the nominal ratio.
    settings, reference
        ISO and f-number of the two.

    Returns
    -------
    tuple of float
        The ratio, and its relative σ: 0 where both settings are the same.

    Examples
    --------
    >>> from labrig.calibration import relative_sensitivity
    >>> relative_sensitivity(None, (400.0, 4.0), (100.0, 4.0))
    (4.0, 0.02)
    """
    if camera is not None:
        at_settings, sigma = camera.scale(*settings)
        at_reference, reference_sigma = camera.scale(*reference)
        differ = at_settings != at_reference
        return at_settings / at_reference, math.hypot(sigma, reference_sigma) if differ else 0.0
    (iso, f_number), (reference_iso, reference_f_number) = settings, reference
    value, sigma = iso / reference_iso, 0.0 if iso == reference_iso else ISO_SIGMA
    if f_number is not None and reference_f_number is not None and f_number != reference_f_number:
        value *= (reference_f_number / f_number) ** 2
        sigma = math.hypot(sigma, APERTURE_SIGMA)
    return value, sigma


def flicker_of(camera: CameraFile | None) -> float:
    """Return the relative flicker of a frame: that of its calibration, else a typical one.

    Parameters
    ----------
    camera
        Calibration of the camera; None without one.

    Returns
    -------
    float
        Standard deviation over the signal.

    Examples
    --------
    >>> from labrig.calibration import flicker_of
    >>> flicker_of(None)
    0.007
    """
    return TYPICAL_FLICKER if camera is None else camera.flicker


def shutter_sigma(camera: CameraFile | None, exposure_s: float) -> float:
    """Return the relative σ of an exposure time: that of its calibration, else a typical one.

    Parameters
    ----------
    camera
        Calibration of the camera; None without one.
    exposure_s
        Exposure time in seconds, above 0.

    Returns
    -------
    float
        Standard uncertainty over the exposure time.

    Examples
    --------
    >>> from labrig.calibration import shutter_sigma
    >>> shutter_sigma(None, 0.1)
    0.002
    """
    if camera is None or not camera.shutter:
        return TYPICAL_SHUTTER_S / float(exposure_s)
    return camera.exposure_s(float(exposure_s))[1]
