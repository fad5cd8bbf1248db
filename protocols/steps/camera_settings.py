"""How the camera is set, and what a photograph needs of it."""

from pydantic import BaseModel, ConfigDict, Field

#: Frames at each exposure of the dark unit: enough for a mean, its scatter and a map of hot pixels.
DARKS_PER_EXPOSURE = 4
#: Left free between a frame and the next deadline: setting the camera, half-pressing it.
MARGIN_S = 0.5


class CameraSettings(BaseModel):
    """How the camera is set; the shutter time has a key of its own."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    iso: int = Field(400, gt=0)
    f_number: float | None = Field(4.0, gt=0)
