"""A trial frame at the begin of a run, which shows how large the camera's frames are."""

from dataclasses import replace

from labrig.acquire import Camera, CameraOffers, ExposureSettings
from labrig.foundation.errors import ProtocolError
from labrig.reduce import read_raw

#: Shutter time in seconds at most: the picture does not matter, only its size.
EXPOSURE_S = 1 / 60


def offers_with_frame_size(camera: Camera) -> CameraOffers:
    """Take a frame, which is not kept, and return the camera's offers with the size of its frames.

    Parameters
    ----------
    camera
        Open camera in its safe state.

    Returns
    -------
    CameraOffers
        Settings that the camera offers; `frame_pixels` is that of the frame.

    Raises
    ------
    ProtocolError
        The rig file gives another size of the frame.
    FrameError
        The frame cannot be read.
    """
    offers = camera.offers()
    camera.configure(
        ExposureSettings(
            offers.exposure_at_most(EXPOSURE_S), offers.isos[0], max(offers.f_numbers, default=None)
        )
    )
    camera.arm()
    raw = read_raw(camera.shoot().data, "a trial frame")
    frame_pixels = (raw.width, raw.height)
    if offers.frame_pixels is not None and offers.frame_pixels != frame_pixels:
        raise ProtocolError(
            f"the rig file expects frames of {list(offers.frame_pixels)} pixels, the camera's have "
            f"{list(frame_pixels)}; write frame_pixels: {list(frame_pixels)} under 'devices.camera'"
        )
    return replace(offers, frame_pixels=frame_pixels)
