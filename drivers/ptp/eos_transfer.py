"""Fetching a frame from an EOS."""

from labrig.clock import Clock
from labrig.errors import DeviceError

from .device_info import DeviceInfo
from .eos_events import ObjectOffered
from .eos_protocol import Eos
from .failures import RefusedError
from .ptp_codes import INVALID_OBJECT_HANDLE, Standard
from .session import Patience, Session

CHUNK_BYTES = 1024 * 1024
#: A camera that still develops or writes is busy for seconds.
PATIENT = Patience(answer_s=10.0, busy_s=10.0)
_CHUNKED: tuple[Eos | Standard, ...] = (Eos.GetPartialObject, Standard.GetPartialObject)


class EosTransfer:
    """Fetches what the camera offers, in pieces if it can, so that Ctrl-C is heard between them."""

    def __init__(self, session: Session, clock: Clock, info: DeviceInfo) -> None:
        self._session = session
        self._clock = clock
        self._chunked = next((op for op in _CHUNKED if op in info.operations), None)

    def fetch(self, offered: ObjectOffered) -> bytes:
        """The file's bytes.

        Raises
        ------
        DeviceError
            The camera sends more or fewer than it announced, or fails to send.
        """
        received = bytearray()
        while len(received) < offered.size_bytes:
            missing = offered.size_bytes - len(received)
            size = missing if self._chunked is None else min(CHUNK_BYTES, missing)
            piece = self._piece(offered, len(received), size)
            if len(piece) != size:
                raise DeviceError(
                    f"expected {size} bytes of {offered.name} from byte {len(received)} of "
                    f"{offered.size_bytes} announced, the camera sent {len(piece)}: take the "
                    "frame again"
                )
            received += piece
            self._clock.sleep(0.0)
        return bytes(received)

    def complete(self, offered: ObjectOffered) -> None:
        """Tell the camera that it may forget the file.

        Raises
        ------
        DeviceError
            The camera did not take it.
        """
        try:
            self._session.transact(Eos.TransferComplete, offered.handle, patience=PATIENT)
        except RefusedError as refusal:
            # it has forgotten it: it heard an earlier attempt, whose answer was lost
            if refusal.code != INVALID_OBJECT_HANDLE:
                raise

    def _piece(self, offered: ObjectOffered, offset: int, size: int) -> bytes:
        if self._chunked is None:
            whole = (Eos.GetObject, offered.handle)
            return self._session.transact(*whole, patience=PATIENT, most_bytes=size).data
        part = (self._chunked, offered.handle, offset, size)
        return self._session.transact(*part, patience=PATIENT, most_bytes=size).data
