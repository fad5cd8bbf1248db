"""The release button of an EOS: two stages, or one on older cameras."""

from abc import ABC, abstractmethod
from enum import Enum, auto

from ..codes import DEVICE_BUSY
from ..device_info import DeviceInfo
from ..failures import RefusedError
from ..session import Reply, Session, Timeouts
from .protocol import Eos

HALF, FULL = 1, 2
#: A slow lens keeps a 5D Mark II from answering for 8 s (libgphoto2).
FOCUS_S = 12.0
#: Time for which a busy full press is repeated; a frame any later belongs to no decay.
LATE_PRESS_S = 3.0

_RESULTS = {
    1: "it found no focus: set the lens to manual focus (MF)",
    3: "its mirror is locked up: switch mirror lock-up off",
    7: "it believes there is no room for the frame: start again",
}

#: An operation and its parameters.
Command = tuple[Eos, *tuple[int, ...]]


class Stage(Enum):
    """Position of a stage that can be held, as far as is known."""

    UP = auto()
    #: State after a command that was not answered with OK.
    UNKNOWN = auto()
    DOWN = auto()


class StageCommands:
    """A pair of commands that press and release a stage, in any state before.

    Parameters
    ----------
    session
        Session with the camera.
    press, release
        Operations that press and release the stage.
    """

    def __init__(self, session: Session, press: Command, release: Command) -> None:
        self._session = session
        self._press = press
        self._release_command = release
        self._stage = Stage.UP

    @property
    def is_down(self) -> bool:
        """Whether the stage is certainly held."""
        return self._stage is Stage.DOWN

    def press(self, timeouts: Timeouts) -> Reply:
        """Press the stage.

        Raises
        ------
        DeviceError
            The camera did not confirm that it is down.
        """
        self._stage = Stage.UNKNOWN
        reply = self._session.transact(*self._press, timeouts=timeouts)
        self._stage = Stage.DOWN
        return reply

    def release(self, busy_s: float) -> Reply | None:
        """Release the stage unless it is surely up; a camera that exposes may be busy for `busy_s`.

        Returns
        -------
        Reply | None
            The camera's reply; None if there was nothing to release.

        Raises
        ------
        DeviceError
            The stage may still be down.
        """
        previous = self._stage
        if previous is Stage.UP:
            return None
        self._stage = Stage.UNKNOWN
        reply = None
        try:
            reply = self._session.transact(
                *self._release_command, timeouts=Timeouts(FOCUS_S, busy_s)
            )
        except RefusedError as refusal:
            if refusal.code == DEVICE_BUSY:
                self._stage = previous
                raise
            # a camera may refuse to let go of what is not down: refused twice, it is not
            if previous is Stage.DOWN:
                raise
        self._stage = Stage.UP
        return reply

    def mark_unknown(self) -> None:
        """Note that a pressed stage may not be down."""
        self._stage = Stage.UNKNOWN

    def force_release(self) -> None:
        """Release a stage that another program, or this one before a reset, may hold.

        Raises
        ------
        DeviceError
            The stage may still be down.
        """
        self.mark_unknown()
        self.release(LATE_PRESS_S)


class Release(ABC):
    """The release button, which can be released in any state."""

    @abstractmethod
    def press_half(self) -> None:
        """Have the camera get ready."""

    @abstractmethod
    def press_full(self, exposure_s: float) -> Reply:
        """Begin an exposure of `exposure_s` seconds; the reply has the time.

        Raises
        ------
        RefusedError
            No exposure has begun.
        DeviceError
            Whether an exposure has begun is unknown.
        """

    @abstractmethod
    def release_full(self, busy_s: float) -> None:
        """Release the second stage; a camera that still exposes may be busy for `busy_s`."""

    @abstractmethod
    def release_half(self, busy_s: float) -> None:
        """Release the first stage."""

    @abstractmethod
    def force_release(self) -> None:
        """Release a button that another program, or this one before a reset, may have held."""


class TwoStageRelease(Release):
    """RemoteReleaseOn and Off: the first stage can be held, the second acts at once."""

    def __init__(self, session: Session) -> None:
        self._half, self.full = (
            StageCommands(session, (Eos.RemoteReleaseOn, stage, 0), (Eos.RemoteReleaseOff, stage))
            for stage in (HALF, FULL)
        )

    def press_half(self) -> None:
        if not self._half.is_down:
            self._half.press(Timeouts(answer_s=FOCUS_S, busy_s=LATE_PRESS_S))

    def press_full(self, exposure_s: float) -> Reply:
        # some cameras answer when the shutter has closed
        return self.full.press(Timeouts(answer_s=exposure_s + FOCUS_S, busy_s=LATE_PRESS_S))

    def release_full(self, busy_s: float) -> None:
        self.full.release(busy_s)

    def release_half(self, busy_s: float) -> None:
        self._half.release(busy_s)

    def force_release(self) -> None:
        self.full.force_release()
        self._half.force_release()


class OneStageRelease(Release):
    """RemoteRelease: presses and releases by itself."""

    def __init__(self, session: Session) -> None:
        self._session = session

    def press_half(self) -> None:
        pass

    def press_full(self, exposure_s: float) -> Reply:
        timeouts = Timeouts(answer_s=exposure_s + FOCUS_S, busy_s=LATE_PRESS_S)
        reply = self._session.transact(Eos.RemoteRelease, timeouts=timeouts)
        result = reply.params[0] if reply.params else 0
        if result != 0:
            remedy = _RESULTS.get(result, "leave its menus and try again")
            raise RefusedError(
                f"expected the camera to release, it answered {result} to RemoteRelease 0x910F: "
                f"{remedy}",
                result,
            )
        return reply

    def release_full(self, busy_s: float) -> None:
        pass

    def release_half(self, busy_s: float) -> None:
        pass

    def force_release(self) -> None:
        pass


def release_of(info: DeviceInfo, session: Session) -> Release:
    """Return the release that a camera has."""
    two_stages = {Eos.RemoteReleaseOn, Eos.RemoteReleaseOff} <= info.operations
    return TwoStageRelease(session) if two_stages else OneStageRelease(session)
