"""A calibrated camera."""

from labrig.calibration import CameraFile
from labrig.optics import Flat

BODY = "Canon EOS 5D Mark II, serial 7, firmware 2.1.2"


def camera(**changes: object) -> CameraFile:
    content: dict[str, object] = {
        "camera": BODY, "iso": 100.0, "f_number": 4.0, "channels": ("R", "G", "B"),
        "flicker": 0.007, "flicker_sigma": 0.001,
        "flats": (Flat(f_number=4.0, falloff=((-0.2,), (-0.2,), (-0.1,))),),
    }  # fmt: skip
    return CameraFile.model_validate(content | changes)
