"""The reference file: of which bench a calibration is, and what it looked like then."""

from datetime import datetime
from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import AwareDatetime, Field, model_validator

from labrig.calibration.camera_file import camera_body
from labrig.calibration.kind import CalibrationKind
from labrig.foundation.models import Finite, FrozenModel, NotNegative, Positive
from labrig.optics import Strip


class CardPicture(FrozenModel):
    """The grey card under the lamp, through the variable filter before the camera.

    Attributes
    ----------
    strip
        Position of the filter in the frame.
    iso, f_number
        Settings to which the rates belong.
    channels
        Names of the channels.
    wavelength_nm
        Wavelengths in nm at places of equal length along the strip, from left to right.
    rate_dn_per_s
        Mean signal above black in DN/s, a row for each place, a number for each channel.
    width
        Width of the frame in pixels.
    """

    strip: Strip
    iso: Positive
    f_number: Positive | None
    channels: tuple[str, ...]
    wavelength_nm: Annotated[tuple[Positive, ...], Field(min_length=6)]
    rate_dn_per_s: tuple[tuple[NotNegative, ...], ...]
    width: Positive

    @model_validator(mode="after")
    def _one_number_each(self) -> Self:
        steps = {b > a for a, b in pairwise(self.wavelength_nm)}
        if len(steps) > 1:
            raise ValueError("expected wavelengths in 'wavelength_nm' that only rise or only fall")
        if len(self.rate_dn_per_s) != len(self.wavelength_nm):
            raise ValueError("expected a row of 'rate_dn_per_s' for every wavelength")
        if any(len(row) != len(self.channels) for row in self.rate_dn_per_s):
            raise ValueError(f"expected {len(self.channels)} numbers in each row, one a channel")
        return self


class ReferenceFile(FrozenModel):
    """Result of `calibration`: the bench to which its other files belong.

    Attributes
    ----------
    bench
        Name of the rig.
    camera, lens
        Identity of the camera as it reports it, and its lens as recorded in the frames; null if
        unknown.
    lamp, grey_card, curves
        Names of the curves of lamp, card and camera in the rig file; null if it names none.
    made
        Time of the last frame.
    temperature_c
        Mean temperature in degrees Celsius; null without a thermometer.
    picture
        The card through the filter, with which later runs compare theirs; null if the filter was
        not calibrated.

    Examples
    --------
    >>> from pathlib import Path
    >>> from labrig.calibration import REFERENCE_KIND
    >>> reference = REFERENCE_KIND.read(Path("reference.yaml"))
    >>> reference.lens, f"{reference.made:%Y-%m-%d}"
    ('EF75mm, 75 mm', '2026-01-01')
    """

    kind: Literal["reference"] = "reference"
    bench: str
    camera: str | None
    lens: str | None
    lamp: str | None
    grey_card: str | None
    curves: str | None
    made: AwareDatetime
    temperature_c: Finite | None = None
    picture: CardPicture | None = None
    source: str = ""
    run: str | None = None

    def is_of(self, camera: str) -> bool:
        """Return whether a camera is the calibrated one, by its identity without the firmware."""
        return self.camera is None or camera_body(camera) == camera_body(self.camera)

    def age_s(self, now_s: float) -> float:
        """Return the time from the calibration to `now_s`, seconds since 1970; at least 0."""
        made: datetime = self.made
        return max(now_s - made.timestamp(), 0.0)


REFERENCE_KIND = CalibrationKind(
    name="reference",
    protocol="calibration",
    optics_key="reference",
    file_name="reference.yaml",
    model=ReferenceFile,
)
