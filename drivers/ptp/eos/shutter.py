"""The shutter of an EOS: opened and closed, with times, and closed again after any error."""

from labrig.foundation.clock import Clock
from labrig.foundation.errors import DeviceError

from ..device_info import DeviceInfo
from ..failures import RefusedError
from ..session import Reply, Session
from .bulb import bulb_of
from .frames import EosFrames
from .release import LATE_PRESS_S, release_of


class EosShutter:
    """Shutter of an EOS, timed by the camera, or at bulb by the PC.

    An exposure begins in the middle of its command's round trip, give or take half of it, plus the
    camera's own lag; one at bulb ends in the middle of the second round trip. The frame is noted as
    due before a command is sent: whether a command that is broken off was received is unknown.

    Parameters
    ----------
    session
        Session with the camera.
    clock
        Clock of the waiting for the end of an exposure.
    info
        Abilities of the camera.
    frames
        Bookkeeping of frames that are due.
    lag_s
        Seconds from a press to the open shutter.
    """

    def __init__(
        self, session: Session, clock: Clock, info: DeviceInfo, frames: EosFrames, lag_s: float
    ) -> None:
        self._clock = clock
        self._frames = frames
        self._lag_s = lag_s
        self._release = release_of(info, session)
        self._bulb = bulb_of(info, session, self._release)
        self._bulb_is_open = False

    @property
    def has_bulb(self) -> bool:
        """Whether the PC can end an exposure."""
        return self._bulb is not None

    def get_ready(self, *, at_bulb: bool) -> None:
        """Press half and hold, where the next exposure needs it.

        Raises
        ------
        DeviceError
            The camera does not get ready.
        """
        if not at_bulb or (self._bulb is not None and self._bulb.needs_half_press):
            self._release.press_half()

    def expose(self, exposure_s: float) -> tuple[float, float]:
        """Expose with the camera's settings; return the clock times of the start and the end.

        Raises
        ------
        DeviceError
            The camera did not release.
        """
        self._frames.expect(self._clock.now() + LATE_PRESS_S + exposure_s)
        try:
            reply = self._release.press_full(exposure_s)
        except RefusedError:
            self._frames.expect_none()
            raise
        start_s = _middle_s(reply) + self._lag_s
        end_s = start_s + exposure_s
        self._frames.expect(end_s)
        self._release.release_full(self._busy_s())
        self._clock.sleep_until(end_s)
        return start_s, end_s

    def expose_at_bulb(self, exposure_s: float) -> tuple[float, float]:
        """Expose for a time on the clock; return the clock times of the start and the end.

        Raises
        ------
        DeviceError
            The camera has no bulb, did not open its shutter, or may not have closed it.
        """
        if self._bulb is None:
            raise DeviceError(
                "expected a camera with a command to end an exposure, this one has neither "
                "BulbEnd 0x9126 nor RemoteReleaseOff 0x9129: set longest_exposure to 32 s"
            )
        self._frames.expect(self._clock.now() + LATE_PRESS_S + exposure_s)
        self._bulb_is_open = True
        try:
            opened = self._bulb.open()
        except RefusedError:
            self._frames.expect_none()
            raise
        start_s = _middle_s(opened) + self._lag_s
        self._clock.sleep_until(start_s + exposure_s)
        closed = self._bulb.close()
        self._bulb_is_open = False
        assert closed is not None, "it was open"
        end_s = _middle_s(closed)
        self._frames.expect(end_s)
        return start_s, end_s

    def close(self) -> None:
        """Close the shutter at bulb; release the full stage. Other exposures run to their end.

        Raises
        ------
        DeviceError
            The camera did not confirm it.
        """
        if self._bulb is not None and self._bulb_is_open:
            was_open = self._bulb.close() is not None
            self._bulb_is_open = False
            if was_open:
                self._frames.expect(self._clock.now())
            else:
                self._frames.expect_none()
        self._release.release_full(self._busy_s())

    def release(self) -> None:
        """Release the first stage.

        Raises
        ------
        DeviceError
            The camera did not confirm it.
        """
        self._release.release_half(self._busy_s())

    def force_release(self) -> None:
        """Release a button that another program, or this one before a reset, may have held.

        Raises
        ------
        DeviceError
            The camera does not answer.
        """
        if self._bulb is not None:
            self._bulb.close_blindly()
        self._release.force_release()

    def _busy_s(self) -> float:
        """Return how long the camera may be busy: to the end of an exposure, and a little more."""
        return self._frames.exposing_for_s() + LATE_PRESS_S


def _middle_s(reply: Reply) -> float:
    return (reply.sent_s + reply.answered_s) / 2
