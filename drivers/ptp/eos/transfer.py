"""Transfer of a frame from an EOS, and its confirmation."""

from labrig.foundation.clock import Clock

from ..codes import INVALID_OBJECT_HANDLE, Standard
from ..device_info import DeviceInfo
from ..failures import RefusedError
from ..object_transfer import PATIENT, ObjectTransfer
from ..session import Session
from .events import ObjectOffered
from .protocol import Eos

_IN_PARTS: tuple[Eos | Standard, ...] = (Eos.GetPartialObject, Standard.GetPartialObject)


class EosTransfer:
    """Transfer of the files that the camera offers."""

    def __init__(self, session: Session, clock: Clock, info: DeviceInfo) -> None:
        self._session = session
        part = next((op for op in _IN_PARTS if op in info.operations), None)
        self._objects = ObjectTransfer(session, clock, Eos.GetObject, part)

    def fetch(self, offered: ObjectOffered) -> bytes:
        """Return the file's bytes.

        Raises
        ------
        DeviceError
            The camera sends more or fewer bytes than it announced, or fails to send.
        """
        return self._objects.fetch(offered.handle, offered.name, offered.size_bytes)

    def complete(self, offered: ObjectOffered) -> None:
        """Confirm the transfer, so that the camera may delete the file.

        Raises
        ------
        DeviceError
            The camera did not take the confirmation.
        """
        try:
            self._session.transact(Eos.TransferComplete, offered.handle, timeouts=PATIENT)
        except RefusedError as refusal:
            # it has forgotten it: it heard an earlier attempt, whose answer was lost
            if refusal.code != INVALID_OBJECT_HANDLE:
                raise
