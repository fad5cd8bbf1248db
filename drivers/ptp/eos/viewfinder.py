"""The electronic viewfinder: the camera's live picture, sent to the PC as JPEG.

Sources: libgphoto2's ptp2 camera library (`ptp_canon_eos_get_viewfinder_image`, `camera_capture_
preview`), its dump of a 5D Mark II (lists 0x9153 and 0x9154) and the command samples of Canon's
EDSDK (`Evf_Mode` before `Evf_OutputDevice`). Not documented by Canon.
"""

import struct

from labrig.foundation.clock import Clock
from labrig.foundation.errors import DeviceError

from ..codes import DEVICE_BUSY
from ..device_info import DeviceInfo
from ..failures import MalformedError, RefusedError
from ..session import SHORT_TIMEOUTS, Session
from .protocol import VIEWFINDER_OFF, VIEWFINDER_TO_PC, Eos, Property, number
from .state import EosState

#: The one parameter of GetViewFinderData; what Canon's own program sends, by libgphoto2's traces.
WHOLE_PICTURE = 0x00200000
#: Response while the mirror goes up and the sensor starts; in libgphoto2 "ObjectNotReady".
NOT_READY = 0xA102
#: libgphoto2 waits this long between two questions, too.
POLL_PERIOD_S = 0.05
#: A 750D was not ready after 20 tries (libgphoto2 issue 71): be more patient than that.
READY_TIMEOUT_S = 5.0

_HEAD = struct.Struct("<II")
#: Kinds of records that are a JPEG: usual, in movie mode, of newer bodies.
_JPEG_KINDS = (1, 9, 11)
_JPEG_START = b"\xff\xd8"


class EosViewfinder:
    """Viewfinder that is switched to the PC with the first picture, and off again.

    Parameters
    ----------
    session, state
        Session and state of the camera.
    clock
        Clock of the waiting for a picture.
    info
        Abilities that the camera reports.
    """

    def __init__(self, session: Session, state: EosState, clock: Clock, info: DeviceInfo) -> None:
        self._session = session
        self._state = state
        self._clock = clock
        self._info = info
        self._is_on = False

    def picture(self) -> bytes:
        """Return the next picture of the viewfinder, a JPEG.

        Raises
        ------
        DeviceError
            The camera has no viewfinder, does not start it, or sends no picture.
        """
        if not self._is_on:
            self._switch_on()
        deadline_s = self._clock.now() + READY_TIMEOUT_S
        while True:
            try:
                data = self._session.transact(
                    Eos.GetViewFinderData, WHOLE_PICTURE, timeouts=SHORT_TIMEOUTS
                ).data
            except RefusedError as refusal:
                if refusal.code not in (NOT_READY, DEVICE_BUSY):
                    raise
                if self._clock.now() >= deadline_s:
                    raise DeviceError(
                        f"expected a picture of the camera's viewfinder within "
                        f"{READY_TIMEOUT_S:g} s, it still answers 0x{refusal.code:04X}: leave its "
                        "menus, allow live view in them, and turn its dial to M"
                    ) from None
            else:
                # A camera that is never listened to stops answering other questions.
                self._state.listen()
                return jpeg_in(data)
            self._state.listen()
            self._clock.sleep(POLL_PERIOD_S)

    def off(self) -> None:
        """Lower the mirror and switch the sensor off, if this object switched the viewfinder on.

        Raises
        ------
        DeviceError
            The camera does not confirm it.
        """
        if self._is_on:
            self.off_whoever_switched_it_on()

    def off_whoever_switched_it_on(self) -> None:
        """Switch the viewfinder off, also where a program that died left it on.

        Raises
        ------
        DeviceError
            The camera does not confirm it.
        """
        if self._state.value(Property.viewfinder_output) is not None:
            self._state.set(Property.viewfinder_output, number(VIEWFINDER_OFF))
        self._is_on = False

    def _switch_on(self) -> None:
        if Eos.GetViewFinderData not in self._info.operations:
            raise DeviceError(
                "expected a camera with live view (0x9153 GetViewFinderData), this one has none: "
                "aim through its own viewfinder"
            )
        self._is_on = True  # also if it is broken off half-way: `off` must then do something
        # "Live view shooting" disabled in the camera's menu: EDSDK's samples enable it first.
        if self._state.value(Property.viewfinder_mode) == 0:
            self._state.set(Property.viewfinder_mode, number(1))
        self._state.set(Property.viewfinder_output, number(VIEWFINDER_TO_PC))


def jpeg_in(data: bytes) -> bytes:
    """Return the JPEG among GetViewFinderData's records: u32 length of everything, u32 kind, data.

    Raises
    ------
    MalformedError
        No record is a JPEG.
    """
    position = 0
    while position + _HEAD.size <= len(data):
        length, kind = _HEAD.unpack_from(data, position)
        if length < _HEAD.size:
            break
        # Some bodies count more bytes than they send; libgphoto2 cuts such a record, too.
        payload = data[position + _HEAD.size : position + length]
        if kind in _JPEG_KINDS and payload.startswith(_JPEG_START):
            return payload
        position += length
    raise MalformedError("expected a JPEG from the camera's viewfinder", data)
