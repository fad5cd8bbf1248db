"""Transfer of a file from a camera, in parts if possible, so that Ctrl-C is handled in between."""

from enum import IntEnum

from labrig.foundation.clock import Clock
from labrig.foundation.errors import DeviceError

from .session import Session, Timeouts

PIECE_BYTES = 1024 * 1024
#: Longest file, several times the largest RAW file; a longer announcement is damaged.
MAX_FILE_BYTES = 512 * 1024 * 1024
#: A camera that still develops or writes is busy for seconds.
LONG_TIMEOUTS = Timeouts(answer_s=10.0, busy_s=10.0)


class ObjectTransfer:
    """Transfer of files from a camera.

    Parameters
    ----------
    session
        Session with the camera.
    clock
        Clock that notices Ctrl-C.
    whole
        Operation that sends all of a file.
    part
        Operation that sends a part of it: handle, offset, size; None if there is none.
    """

    def __init__(
        self, session: Session, clock: Clock, whole: IntEnum, part: IntEnum | None
    ) -> None:
        self._session = session
        self._clock = clock
        self._whole = whole
        self._part = part

    def fetch(self, handle: int, name: str, size_bytes: int) -> bytes:
        """Return the file's bytes.

        Raises
        ------
        DeviceError
            The camera announces more than any file has, sends more or fewer bytes than it
            announced, or fails to send.
        """
        if size_bytes > MAX_FILE_BYTES:
            raise DeviceError(
                f"expected a file of at most {MAX_FILE_BYTES} bytes, the camera announces "
                f"{size_bytes} for {name}: take the frame again"
            )
        received = bytearray()
        while len(received) < size_bytes:
            missing = size_bytes - len(received)
            size = missing if self._part is None else min(PIECE_BYTES, missing)
            piece = self._piece(handle, len(received), size)
            if len(piece) != size:
                raise DeviceError(
                    f"expected {size} bytes of {name} from byte {len(received)} of {size_bytes} "
                    f"announced, the camera sent {len(piece)}: take the frame again"
                )
            received += piece
            self._clock.sleep(0.0)
        return bytes(received)

    def _piece(self, handle: int, offset: int, size: int) -> bytes:
        if self._part is None:
            request: tuple[IntEnum, *tuple[int, ...]] = (self._whole, handle)
        else:
            request = (self._part, handle, offset, size)
        return self._session.transact(*request, timeouts=LONG_TIMEOUTS, most_bytes=size).data
