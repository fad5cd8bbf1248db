"""A trial frame at the begin of a run: regions outside of it are refused before devices warm up."""

from labrig.acquire import CAMERA, ExposureSettings, ProtocolModel, Rig, require_inside
from labrig.errors import ProtocolError

#: Shutter time in seconds at most: the picture does not matter, only its size.
EXPOSURE_S = 1 / 60


def check_regions(protocol: ProtocolModel, rig: Rig, *, trust_offers: bool) -> None:
    """Refuse regions of a protocol outside the camera's frame, whose size a trial frame shows.

    Parameters
    ----------
    protocol
        Protocol of the run.
    rig
        Open devices of the bench, in their safe state.
    trust_offers
        Whether the size that the rig file gives is certain, so that no frame has to be taken.

    Raises
    ------
    ProtocolError
        A region is outside, or the rig file gives another size of the frame.
    FrameError
        The camera's frame cannot be read.
    """
    if CAMERA not in rig or not (regions := protocol.named_regions()):
        return
    camera = rig[CAMERA]
    offers = camera.offers()
    if offers.frame_pixels is not None and trust_offers:
        return
    from labrig.reduce import read_raw

    settings = ExposureSettings(
        offers.exposure_at_most(EXPOSURE_S), offers.isos[0], max(offers.f_numbers, default=None)
    )
    camera.configure(settings)
    camera.arm()
    raw = read_raw(camera.shoot().data, "a trial frame")
    frame_pixels = (raw.width, raw.height)
    if offers.frame_pixels not in (None, frame_pixels):
        raise ProtocolError(
            f"the rig file expects frames of {offers.frame_pixels} pixels, the camera's have "
            f"{frame_pixels}; write frame_pixels: {list(frame_pixels)} under 'devices.camera'"
        )
    require_inside(regions, frame_pixels)
