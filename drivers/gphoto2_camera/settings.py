"""Settings of a camera behind libgphoto2 in a rig file."""

from collections.abc import Iterable
from typing import Annotated, Literal

from pydantic import Field

from labrig.acquire import CameraCapabilities, FramePixels, frame_bytes
from labrig.foundation.models import FrozenModel
from labrig.foundation.quantity import DurationS, SizeBytes

#: In thirds of a stop, from 32 s down to 1/8192 s.
_MAX_THIRDS, _MIN_THIRDS = 15, -39

Positive = Annotated[DurationS, Field(gt=0)]


class Gphoto2CameraSettings(FrozenModel):
    """Keys of a camera behind libgphoto2 in a rig file.

    Attributes
    ----------
    shutter_lag
        Time from the release that the camera obeyed to the start of the exposure, for example
        `60 ms`; to be measured.
    release
        Way to release the shutter. `button` sends half and full press apart, so that nothing but
        the shutter follows the second; `trigger` leaves both to libgphoto2, which takes 0.15 to 0.5
        s. Default: `button` where the camera has it.
    isos
        Native ISO sensitivities of the sensor. The camera's others, which are gain after
        digitising, stay unused.
    f_numbers
        Apertures of the lens as f-numbers, for planning without the camera; with it, they are read
        from it.
    longest_exposure
        Longest shutter time to use, for example `32 s`. The dial's 30 s is an actual 32 s.
    frame_time
        Time from the end of an exposure until its frame is on the PC and the next can begin, for
        example `2 s`.
    change_time
        Time that the camera takes to change a setting between two frames, such as the shutter time,
        for example `50 ms`. A plan counts it until the run's own frames show it.
    frame_pixels
        Width and height of a frame in pixels, as `labrig rig check` measures them, for example
        `[5634, 3752]`. A plan refuses regions outside of it. Default: unknown before the first
        frame.
    frame_size
        Size of one RAW file, for planning disk space, for example `27 MB`. Default: 1.5 bytes for
        each pixel, or 30 MB where these are unknown.
    transfer_timeout
        Time from the end of an exposure within which its frame must be on the PC, for example
        `30 s`.
    answer_timeout
        Time within which the camera must have taken a setting, for example `5 s`.
    """

    shutter_lag: Annotated[DurationS, Field(ge=0)] = 0.0
    release: Literal["button", "trigger"] | None = None
    isos: Annotated[tuple[Annotated[int, Field(gt=0)], ...], Field(min_length=1)] = (
        100, 200, 400, 800, 1600,
    )  # fmt: skip
    f_numbers: tuple[Annotated[float, Field(gt=0)], ...] = (2.8, 4.0, 5.6, 8.0, 11.0, 16.0)
    longest_exposure: Positive = 32.0
    frame_time: Annotated[DurationS, Field(ge=0)] = 2.0
    change_time: Annotated[DurationS, Field(ge=0)] = 0.0
    frame_pixels: FramePixels | None = None
    frame_size: Annotated[SizeBytes, Field(gt=0)] | None = None
    transfer_timeout: Positive = 30.0
    answer_timeout: Positive = 5.0

    def allows_exposure(self, exposure_s: float) -> bool:
        """Return whether `exposure_s` seconds are within `longest_exposure`."""
        return exposure_s <= self.longest_exposure * 1.0001

    def planned_offers(self) -> CameraCapabilities:
        """Return the offers assumed without the camera: shutter times in thirds of a stop."""
        times_s = (2.0 ** (n / 3) for n in range(_MIN_THIRDS, _MAX_THIRDS + 1))
        return self.capabilities(filter(self.allows_exposure, times_s), self.isos, self.f_numbers)

    def capabilities(
        self, exposures_s: Iterable[float], isos: Iterable[int], f_numbers: Iterable[float]
    ) -> CameraCapabilities:
        """Return offers with this file's time and size of a frame."""
        return CameraCapabilities(
            exposures_s=tuple(sorted(set(exposures_s))),
            isos=tuple(sorted(set(isos))),
            f_numbers=tuple(sorted(set(f_numbers))),
            overhead_s=self.frame_time,
            change_s=self.change_time,
            frame_bytes=frame_bytes(self.frame_size, self.frame_pixels),
            frame_pixels=self.frame_pixels,
        )
