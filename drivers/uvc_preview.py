"""A webcam, or a stick on the camera's HDMI output, for aiming: 8 bits, never used to measure.

Addresses: `uvc://0` is the system's first video device; a stream over the network, such as
`http://…/stream.mjpg`, is given as it is. Nothing else that OpenCV opens is: it also takes files,
and texts that start plugins.
"""

import cv2

from labrig.acquire import Connections
from labrig.foundation.errors import DeviceError
from labrig.foundation.models import FrozenModel

SCHEME = "uvc://"
STREAMS = ("http://", "https://", "rtsp://")
JPEG_QUALITY = 90


class UvcPreview:
    """Live view only; the device is opened with the first picture.

    Parameters
    ----------
    address
        Address of the video device, as in this module's description.
    settings
        The rig file's keys for this device, of which there are none.
    connections
        Connections, not needed: OpenCV opens video devices itself.

    Raises
    ------
    DeviceError
        The address is neither.
    """

    class Settings(FrozenModel):
        """Keys of a video device for aiming in a rig file: none of its own."""

    def __init__(self, address: str, settings: Settings, connections: Connections) -> None:
        self._address = address
        number = address.removeprefix(SCHEME)
        is_device = number != address and number.isdecimal() and number.isascii()
        if not is_device and not address.startswith(STREAMS):
            raise DeviceError(
                f"'{address}' is no video device; write uvc://0 for the first one, uvc://1 for the "
                "second, or a stream's own address"
            )
        self._source: int | str = int(number) if is_device else address
        self._capture: cv2.VideoCapture | None = None

    def identity(self) -> str:
        """Return the address: video devices do not report an identity to OpenCV."""
        return f"video device at {self._address}, for aiming only"

    def preview(self) -> bytes:
        """Return the next picture, as JPEG.

        Raises
        ------
        DeviceError
            There is no such device, or no picture comes.
        """
        if self._capture is None:
            self._capture = self._opened()
        is_read, picture = self._capture.read()
        encoded = is_read and cv2.imencode(
            ".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
        )
        if not encoded:
            self.make_safe()
            raise DeviceError(
                f"expected a picture from {self._address}, none came: plug the video device in "
                "again, and close other programs that show it"
            )
        return bytes(encoded[1])

    def make_safe(self) -> None:
        """Release the device; the next picture opens it again."""
        if self._capture is not None:
            self._capture.release()
            self._capture = None

    def disconnect(self) -> None:
        """Release the device."""
        self.make_safe()

    def _opened(self) -> cv2.VideoCapture:
        # OpenCV would write its own lines beside labrig's one.
        cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
        try:
            capture = cv2.VideoCapture(self._source)
        except cv2.error as error:
            raise DeviceError(f"cannot open {self._address}: {error.err}") from None
        if not capture.isOpened():
            raise DeviceError(
                f"cannot open {self._address}: check that the video device is plugged in, that no "
                "other program shows it, and that you may use it"
            )
        # One waiting picture at most, else what is seen lags behind the hand on the focus ring.
        capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        return capture
