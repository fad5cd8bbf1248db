"""Settings of a camera on PTP in a rig file, and the offers that planning without it assumes."""

from typing import Annotated

from pydantic import Field, field_validator

from labrig.acquire import CameraCapabilities, FramePixels, frame_bytes
from labrig.foundation.models import FrozenModel
from labrig.foundation.quantity import DurationS, SizeBytes

from .eos.codes import F_NUMBERS, ISOS, bulb_times_s, shutter_time_s, third_stop_codes
from .eos.iso import NativeIsos, isos_of_model


class PtpCameraSettings(FrozenModel):
    """Keys of a camera on PTP in a rig file.

    Attributes
    ----------
    shutter_lag
        Time from the release to the start of the exposure, as `labrig rig check` measures it, for
        example `60 ms`.
    isos
        Native ISO sensitivities of the sensor. The camera's others, which are gain after
        digitising, stay unused. Default: those known of the EOS model, else 100 to 1600.
    f_numbers
        Apertures of the lens as f-numbers, for planning without the camera; with it, they are read
        from it.
    longest_exposure
        Longest shutter time to use, for example `32 s`. The dial's 30 s is an actual 32 s. From 64
        s on an EOS exposes at bulb: 64 s, 128 s, … up to this time.
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
        Time from the end of an exposure within which the camera must have offered its frame, for
        example `30 s`.
    answer_timeout
        Time within which the camera must have taken a setting, for example `5 s`.
    """

    shutter_lag: Annotated[DurationS, Field(ge=0)] = 0.0
    isos: Annotated[tuple[int, ...], Field(min_length=1)] = isos_of_model("").values
    f_numbers: tuple[float, ...] = (2.8, 4.0, 5.6, 8.0, 11.0, 16.0)
    longest_exposure: Annotated[DurationS, Field(gt=0)] = 32.0
    frame_time: Annotated[DurationS, Field(ge=0)] = 2.0
    change_time: Annotated[DurationS, Field(ge=0)] = 0.0
    frame_pixels: FramePixels | None = None
    frame_size: Annotated[SizeBytes, Field(gt=0)] | None = None
    transfer_timeout: Annotated[DurationS, Field(gt=0)] = 30.0
    answer_timeout: Annotated[DurationS, Field(gt=0)] = 5.0

    @field_validator("isos")
    @classmethod
    def _canon_isos(cls, isos: tuple[int, ...]) -> tuple[int, ...]:
        if unknown := sorted(set(isos) - set(ISOS.values())):
            raise ValueError(f"expected ISO values of a Canon dial, such as 100, got {unknown}")
        return tuple(sorted(set(isos)))

    @field_validator("f_numbers")
    @classmethod
    def _canon_f_numbers(cls, f_numbers: tuple[float, ...]) -> tuple[float, ...]:
        if unknown := sorted(set(f_numbers) - set(F_NUMBERS.values())):
            raise ValueError(f"expected f-numbers of a Canon lens, such as 5.6, got {unknown}")
        return tuple(sorted(set(f_numbers)))

    def allows_exposure(self, exposure_s: float) -> bool:
        """Return whether `exposure_s` seconds are within `longest_exposure`."""
        return exposure_s <= self.longest_exposure * 1.0001

    @property
    def bulb_times_s(self) -> tuple[float, ...]:
        """Times beyond the dial's, within `longest_exposure`; empty if it asks for none."""
        return bulb_times_s(self.longest_exposure * 1.0001)

    def native_isos(self, model: str) -> NativeIsos:
        """Return the rig file's native ISOs if it gives some, else those of the model."""
        if "isos" in self.model_fields_set:
            return NativeIsos(self.isos, "rig file")
        return isos_of_model(model)

    def planned_offers(self) -> CameraCapabilities:
        """Return the expected offers of a camera with these settings, in thirds of a stop."""
        times_s = (shutter_time_s(code) for code in third_stop_codes())
        return CameraCapabilities(
            exposures_s=(
                *sorted(t for t in times_s if t and self.allows_exposure(t)),
                *self.bulb_times_s,
            ),
            isos=self.isos,
            f_numbers=self.f_numbers,
            overhead_s=self.frame_time,
            change_s=self.change_time,
            frame_bytes=frame_bytes(self.frame_size, self.frame_pixels),
            frame_pixels=self.frame_pixels,
        )
