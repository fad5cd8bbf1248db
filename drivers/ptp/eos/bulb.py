"""Bulb: an exposure that the PC begins and ends, for times longer than the dial's 30 s.

BulbStart and BulbEnd, where a camera has them; newer ones (an EOS M50, for example) have the full
stage of the release button held instead, with the shutter time at bulb. Sources: libgphoto2's
`ptp_canon_eos_bulbstart`, its documentation for newer EOS, and its issues 193 and 413.
"""

from ..codes import OK, response_text
from ..device_info import DeviceInfo
from ..failures import RefusedError
from ..session import Reply, Session, Timeouts
from .protocol import Eos
from .release import FOCUS_S, LATE_PRESS_S, Release, StageCommands, TwoStageRelease

#: Time for which a busy camera is asked again to close its shutter.
CLOSING_S = 30.0
_GENERAL_ERROR = 0x2002
#: BulbStart may answer OK and hide a response code in its first parameter (libgphoto2).
_HIDDEN_MASK, _HIDDEN = 0x7000, 0x2000


class EosBulb:
    """Shutter that the PC opens and closes.

    Parameters
    ----------
    release
        Command pair whose press keeps the shutter open.
    needs_half_press
        Whether the button's first stage goes first; BulbStart goes alone.
    """

    def __init__(self, release: StageCommands, *, needs_half_press: bool) -> None:
        self._release = release
        self.needs_half_press = needs_half_press

    def open(self) -> Reply:
        """Begin the exposure; the reply has the time.

        Raises
        ------
        RefusedError
            No exposure has begun.
        DeviceError
            Whether an exposure has begun is unknown.
        """
        try:
            reply = self._release.press(Timeouts(answer_s=FOCUS_S, busy_s=LATE_PRESS_S))
        except RefusedError as refusal:
            if refusal.code == _GENERAL_ERROR:
                raise _refused(refusal.code) from None
            raise
        hidden = reply.params[0] & 0xFFFF if reply.params else 0
        if hidden & _HIDDEN_MASK == _HIDDEN and hidden != OK:
            self._release.mark_unknown()
            raise _refused(hidden)
        return reply

    def close(self) -> Reply | None:
        """End the exposure; return None if certainly none was under way.

        Raises
        ------
        DeviceError
            The shutter may still be open.
        """
        try:
            return self._release.release(CLOSING_S)
        except RefusedError as refusal:
            if refusal.code != _GENERAL_ERROR:
                raise
            raise RefusedError(
                f"expected to end a bulb exposure, the camera answered "
                f"{response_text(refusal.code)}: it was ended at the camera: leave its buttons "
                "alone, charge its battery, and take the frame again",
                refusal.code,
            ) from None

    def close_blindly(self) -> None:
        """End an exposure that another program, or this one before a reset, may have begun.

        Raises
        ------
        DeviceError
            The shutter may still be open.
        """
        self._release.force_release()


def bulb_of(info: DeviceInfo, session: Session, release: Release) -> EosBulb | None:
    """Return the camera's way of bulb exposures; None if it has none."""
    if {Eos.BulbStart, Eos.BulbEnd} <= info.operations:
        commands = StageCommands(session, (Eos.BulbStart,), (Eos.BulbEnd,))
        return EosBulb(commands, needs_half_press=False)
    if isinstance(release, TwoStageRelease):
        return EosBulb(release.full, needs_half_press=True)
    return None


def _refused(code: int) -> RefusedError:
    return RefusedError(
        f"expected a bulb exposure to begin, the camera answered {response_text(code)}: turn its "
        "dial to M (with the shutter time at bulb) or to B, set its lens to MF, leave its menus",
        code,
    )
