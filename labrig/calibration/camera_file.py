"""The camera file: how one body and lens turn light and settings into numbers."""

from pathlib import Path
from typing import Literal, Self

from pydantic import BaseModel, ConfigDict, model_validator

from labrig.calibration.kind import CalibrationKind
from labrig.errors import DataError
from labrig.finite import Finite, NotNegative, Positive
from labrig.optics import CameraModel, stop_text
from labrig.yaml_file import read_model, write_yaml


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


class Linearity(_Part):
    """ln(signal over what it would be if the sensor were linear) at levels above dark.

    Attributes
    ----------
    saturation_dn
        Level above dark from which numbers say nothing; null: it was not reached.
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
    """What `camera_calibration` found: a camera model, whose it is, and what else is known.

    Attributes
    ----------
    camera
        The body that was calibrated, in the words with which it introduces itself.
    lens
        What the frames say of the lens; null: nothing.
    noise
        By ISO.
    linearity
        Common to all channels.
    flicker, flicker_sigma
        Scatter of all light of a frame from frame to frame, relative.
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
        if self.flat_at(f_number) is None:
            known = ", ".join(stop_text(flat.f_number) for flat in self.flats)
            raise DataError(
                f"calibration of another lens or aperture: expected {known}, the frames were taken "
                f"at {stop_text(f_number)}; calibrate that, too, or leave optics.camera_file out"
            )


def read_camera_file(path: Path) -> CameraFile:
    """Read the calibration of a camera body and lens.

    Parameters
    ----------
    path
        Path of the file.

    Returns
    -------
    CameraFile
        The validated calibration.

    Raises
    ------
    UsageError
        There is no such file, or it is malformed.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.calibration import read_camera_file
    >>> camera = read_camera_file(Path("camera.yaml"))
    >>> exposure_s, relative_sigma = camera.exposure_s(1 / 64)
    >>> f"{1e3 * exposure_s:.2f} ms ± {100 * relative_sigma:.1f} %"
    '15.58 ms ± 0.5 %'
    """
    return read_model(path, CameraFile)


def write_camera_file(path: Path, file: CameraFile) -> None:
    """Write the calibration of a camera to a file that `read_camera_file` reads.

    Parameters
    ----------
    path
        Path of the file, which is overwritten.
    file
        The calibration.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.calibration import read_camera_file, write_camera_file
    >>> camera = read_camera_file(Path("camera.yaml"))
    >>> write_camera_file(Path("no-lens.yaml"), camera.model_copy(update={"lens": None}))
    >>> read_camera_file(Path("no-lens.yaml")).lens is None
    True
    """
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
