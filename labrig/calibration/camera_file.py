"""The camera file: how one body and lens turn light and settings into numbers."""

import math
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, model_validator

from labrig.calibration.flat_field import Flat
from labrig.calibration.kind import CalibrationKind
from labrig.errors import DataError
from labrig.region import Region
from labrig.yaml_file import read_model, write_yaml

FloatArray = NDArray[np.float64]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Number = Annotated[float, Field(allow_inf_nan=False)]

#: Two settings are the same if they differ by less: a Canon's dial says 1/60 s for 1/64 s.
SAME_SETTING = 0.02


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class Noise(_Part):
    """Of a pixel at one ISO; every σ is one standard deviation.

    Attributes
    ----------
    gain_e_per_dn
        Electrons to a number, by photon transfer.
    read_noise_e
        Of one pixel, without what whole rows share.
    row_noise_e
        What reading adds to all pixels of a row alike.
    """

    iso: Positive
    gain_e_per_dn: Positive
    gain_e_per_dn_sigma: NotNegative
    read_noise_e: NotNegative
    read_noise_e_sigma: NotNegative
    row_noise_e: NotNegative = 0.0


class Factor(_Part):
    """What a setting does over what its label says, and one standard deviation."""

    setting: Positive
    factor: Positive
    sigma: NotNegative


class Linearity(_Part):
    """ln(signal over what it would be if the sensor were linear) at levels above dark.

    Attributes
    ----------
    saturation_dn
        Level above dark from which numbers say nothing; null: it was not reached.
    """

    level_dn: tuple[Positive, ...]
    deviation: tuple[Number, ...]
    sigma: tuple[NotNegative, ...]
    saturation_dn: Positive | None = None

    @model_validator(mode="after")
    def _one_number_each(self) -> Self:
        if not len(self.level_dn) == len(self.deviation) == len(self.sigma):
            raise ValueError("expected one 'deviation' and one 'sigma' for every 'level_dn'")
        return self


class CameraFile(_Part):
    """What `camera_calibration` found.

    Attributes
    ----------
    camera
        The body that was calibrated, in the words with which it introduces itself.
    lens
        What the frames say of the lens; null: nothing.
    iso, f_number
        Settings at which all factors are 1; `f_number` is null for a lens that does not tell it.
    channels
        Of the sensor.
    noise
        By ISO.
    linearity
        Common to all channels.
    flicker, flicker_sigma
        Scatter of all light of a frame from frame to frame, relative.
    shutter
        True shutter time over the one the camera tells, by the latter in s. 1 at the longest.
    iso_gain
        Signal of the same light over that at `iso` times the ratio of the labels.
    aperture
        Light over that at `f_number` times the squared ratio of the labels.
    flats
        By f-number.
    """

    kind: Literal["camera"] = "camera"
    camera: str
    lens: str | None = None
    iso: Positive
    f_number: Positive | None
    channels: tuple[str, ...]
    noise: tuple[Noise, ...] = ()
    linearity: Linearity | None = None
    flicker: NotNegative
    flicker_sigma: NotNegative
    shutter: tuple[Factor, ...] = ()
    iso_gain: tuple[Factor, ...] = ()
    aperture: tuple[Factor, ...] = ()
    flats: Annotated[tuple[Flat, ...], Field(min_length=1)]
    source: str = ""
    run: str | None = None

    def insist_on(self, camera: str, lens: str | None, f_number: float | None) -> None:
        """Refuse frames that this calibration is not about.

        Parameters
        ----------
        camera
            In the words with which it introduced itself.
        lens
            As the frames say; None if they do not.
        f_number
            At which they were taken.

        Raises
        ------
        DataError
            Another body, another lens, or an aperture that was not calibrated.
        """
        if _body(camera) != _body(self.camera):
            raise DataError(
                f"calibration of another camera: expected '{_body(self.camera)}', the frames are "
                f"of '{_body(camera)}'; calibrate this one, or leave optics.camera_file out"
            )
        if lens is not None and self.lens is not None and lens != self.lens:
            raise DataError(
                f"calibration of another lens: expected {self.lens}, the frames were taken with "
                f"{lens}; calibrate this one, or leave optics.camera_file out"
            )
        if self._flat(f_number) is None:
            known = ", ".join(_stop(flat.f_number) for flat in self.flats)
            raise DataError(
                f"calibration of another lens or aperture: expected {known}, the frames were taken "
                f"at {_stop(f_number)}; calibrate that, too, or leave optics.camera_file out"
            )

    def exposure_s(self, told_s: float) -> tuple[float, float]:
        """True shutter time of one the camera tells, and its relative σ.

        Between two that were measured straight in the logarithm; beyond the longest as the camera
        tells, since a shutter's error is of milliseconds; below the shortest as that.
        """
        if not self.shutter:
            return told_s, 0.0
        told = np.log([one.setting for one in self.shutter])
        at = math.log(told_s)
        longest = self.shutter[-1].setting
        sigma = float(np.interp(at, told, [one.sigma for one in self.shutter]))
        if told_s > longest * (1 + SAME_SETTING):
            return told_s, sigma * longest / told_s
        return told_s * float(np.interp(at, told, [one.factor for one in self.shutter])), sigma

    def scale(self, iso: float, f_number: float | None) -> tuple[float, float]:
        """Signal of some light at those settings over that at the file's own, and its relative σ.

        The σ is common to all frames at those settings. A setting that was not calibrated counts
        by its label.
        """
        gain, gain_sigma = _found(self.iso_gain, iso)
        scale, sigma = gain * iso / self.iso, gain_sigma
        if f_number is not None and self.f_number is not None:
            light, light_sigma = _found(self.aperture, f_number)
            scale *= light * (self.f_number / f_number) ** 2
            sigma = math.hypot(sigma, light_sigma)
        return scale, sigma

    def flat(self, f_number: float | None, region: Region, width: int, height: int) -> FloatArray:
        """Light in a region over that in the middle of the lens, (channels,).

        Parameters
        ----------
        width, height
            Of the frame, in pixels.

        Raises
        ------
        DataError
            The aperture was not calibrated.
        """
        flat = self._flat(f_number)
        if flat is None:
            raise DataError(f"the camera file has no flat field at {_stop(f_number)}")
        return flat.mean(region, width, height)

    def _flat(self, f_number: float | None) -> Flat | None:
        return next((flat for flat in self.flats if _same(flat.f_number, f_number)), None)


def read_camera_file(path: Path) -> CameraFile:
    """The calibration in the file at `path`.

    Raises
    ------
    UsageError
        No such file, or it is malformed.
    """
    return read_model(path, CameraFile)


def write_camera_file(path: Path, file: CameraFile) -> None:
    """Write `file` so that `read_camera_file` gives it back."""
    write_yaml(path, file)


CAMERA_KIND = CalibrationKind(
    name="camera",
    protocol="camera_calibration",
    optics_key="camera_file",
    file_name="camera.yaml",
    read=read_camera_file,
    write=write_camera_file,
)


def _body(identity: str) -> str:
    """Without its firmware, which may have been renewed."""
    return identity.partition(", firmware")[0]


def _found(factors: tuple[Factor, ...], setting: float) -> tuple[float, float]:
    for one in factors:
        if _same(one.setting, setting):
            return one.factor, one.sigma
    return 1.0, 0.0


def _same(one: float | None, other: float | None) -> bool:
    if one is None or other is None:
        return one is other
    return abs(math.log(one / other)) < SAME_SETTING


def _stop(f_number: float | None) -> str:
    return "an unknown aperture" if f_number is None else f"f/{f_number:g}"
