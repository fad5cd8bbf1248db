"""The frames of an EOS: the one that is due, its transfer, and abandoned ones."""

import math
import re

from labrig.foundation.clock import Clock
from labrig.foundation.errors import DeviceError

from ..codes import INVALID_OBJECT_HANDLE, Standard
from ..device_info import DeviceInfo
from ..failures import RefusedError
from ..object_transfer import LONG_TIMEOUTS, ObjectTransfer
from ..session import DEFAULT_TIMEOUTS, Session
from .events import ObjectOffered
from .protocol import Eos
from .state import POLL_PERIOD_S, EosState

_SUFFIX = re.compile(r"\.[a-z0-9]{1,5}")
_JPEG_FORMAT = 0x3801
#: Time after which a frame of a dead program's exposure is no longer offered.
LEFT_OVER_S = 2.0


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
            self._session.transact(Eos.TransferComplete, offered.handle, timeouts=LONG_TIMEOUTS)
        except RefusedError as refusal:
            # it has forgotten it: it heard an earlier attempt, whose answer was lost
            if refusal.code != INVALID_OBJECT_HANDLE:
                raise


class EosFrames:
    """Bookkeeping of the frame that is due, so that none is ever taken for another.

    Parameters
    ----------
    state
        State in which offered frames appear.
    transfer
        Transfer that fetches the frames.
    clock
        Clock of the waiting for frames.
    timeout_s
        Seconds from the end of an exposure until its frame must have been offered.
    """

    def __init__(
        self, state: EosState, transfer: EosTransfer, clock: Clock, timeout_s: float
    ) -> None:
        self._state = state
        self._transfer = transfer
        self._clock = clock
        self._timeout_s = timeout_s
        self._due_after_s: float | None = None
        self._left_over_until_s = -math.inf

    def expect(self, exposure_end_s: float) -> None:
        """Note that an exposure has begun, or may have, and ends at this clock time at latest."""
        self._due_after_s = exposure_end_s

    def expect_none(self) -> None:
        """Note that no exposure is under way."""
        self._due_after_s = None

    def expect_left_over(self) -> None:
        """Note that another program's exposure may have ended just now."""
        self._left_over_until_s = self._clock.now() + LEFT_OVER_S

    def exposing_for_s(self) -> float:
        """Return the seconds for which the camera may still expose."""
        now_s = self._clock.now()
        return max(0.0, (self._due_after_s or now_s) - now_s)

    def fetch(self) -> tuple[bytes, str]:
        """Return the bytes of the frame that is due and its suffix, such as `.cr2`.

        Raises
        ------
        DeviceError
            No frame came, one that is no RAW file, or not as many bytes as announced.
        """
        if not self._wait():
            raise DeviceError(
                f"expected a frame within {self._timeout_s:g} s of the exposure's end, the camera "
                "offered none: set its lens to manual focus (MF), its mirror lock-up and "
                "self-timer off"
            )
        offered = self._state.offered[0]
        suffix = _raw_suffix(offered)
        data = self._transfer.fetch(offered)
        self._settle(offered)
        return data, suffix

    def discard_abandoned(self) -> None:
        """Wait for abandoned frames that are due, and discard all frames.

        Raises
        ------
        DeviceError
            The camera does not answer.
        """
        if self._due_after_s is not None:
            self._clock.sleep_until(self._due_after_s)
            self._wait()
            self._due_after_s = None
        self._clock.sleep_until(self._left_over_until_s)
        self.discard_offered()

    def discard_offered(self) -> None:
        """Discard the frames that have been offered.

        Raises
        ------
        DeviceError
            The camera does not answer.
        """
        self._state.refresh(DEFAULT_TIMEOUTS.busy_s + self.exposing_for_s())
        for offered in self._state.offered:
            try:
                self._settle(offered)
            except RefusedError:
                self._state.forget(offered)  # else it would be refused, and in the way, for ever
                raise

    def _wait(self) -> bool:
        deadline_s = (self._due_after_s or self._clock.now()) + self._timeout_s
        while True:
            self._state.listen()
            if self._state.offered:
                return True
            if self._clock.now() >= deadline_s:
                return False
            self._clock.sleep(POLL_PERIOD_S)

    def _settle(self, offered: ObjectOffered) -> None:
        self._transfer.complete(offered)
        self._state.forget(offered)
        self._due_after_s = None


def _raw_suffix(offered: ObjectOffered) -> str:
    suffix = "." + offered.name.rpartition(".")[2].lower()
    is_jpeg = offered.object_format == _JPEG_FORMAT or suffix in (".jpg", ".jpeg")
    if is_jpeg or not _SUFFIX.fullmatch(suffix) or offered.size_bytes == 0:
        raise DeviceError(
            f"expected a RAW file from the camera, it offers {offered.name!r} of "
            f"{offered.size_bytes} bytes, format 0x{offered.object_format:04X}: "
            "set its image quality to RAW alone"
        )
    return suffix
